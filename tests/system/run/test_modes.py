"""Other ways to run the driver: steps closed by its own clock, and a recorded bus."""
import os
import struct
import subprocess
import unittest

import harness
from harness import RunTest, call, sets


class ModesTest(RunTest):
    def test_the_driver_closes_steps_by_its_own_clock(self):
        run = self.start(*sets(steps=40, period_s=0.03 * harness.PATIENCE, network__close_step="clock"))
        self.assert_succeeds(run.finish())
        measured = harness.measurement_sets(run.log)
        self.assertEqual(sorted(measured), list(range(1, 41)))
        # The two clocks are not in step, but nearly all packets fall into some set.
        self.assertGreater(sum(len(packets) for packets in measured.values()), 16 * 30)

    def test_two_proxies_never_make_a_circle(self):
        """One way and the other way round between the same buses, or two writers on one: refused."""
        buses = [f"udp:239.74.163.2:{port}" for port in (44101, 44102, 44103)]
        if harness.BUS == "vcan":
            buses = ["socketcan:vcan0", "socketcan:vcan1", "udp:239.74.163.2:44103"]
        attacker = [harness.program("attacker"), harness.TRACKING, "--no-record"]
        first = subprocess.Popen([*attacker, "--from", buses[0], "--to", buses[1]], stdout=subprocess.PIPE, text=True)
        self.addCleanup(first.stdout.close)
        self.addCleanup(first.wait)
        self.addCleanup(first.terminate)
        self.assertEqual(first.stdout.readline(), "ready\n")
        for one, other in ((1, 0), (0, 1), (2, 1)):
            done = subprocess.run([*attacker, "--from", buses[one], "--to", buses[other]], capture_output=True,
                                  text=True, timeout=60)
            self.assertEqual(done.returncode, 1, done.stderr)
            self.assertIn("another holdfast-attacker", done.stderr)
        done = subprocess.run([*attacker, "--from", "udp:239.74.163.2:44103", "--to", "udp:239.74.163.2:044103"],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertIn("circles", done.stderr)

    def test_a_replay_does_not_write_over_its_log(self):
        log = self.path("run.lcm")
        self.assert_succeeds(call("campaign", harness.TRACKING, *sets(steps=5), "--log", log))
        with open(log, "rb") as stream:
            before = stream.read()
        status, _, errors = call("estimator", "--log", log, "--out", os.path.join(self.folder, ".", "run.lcm"))
        self.assertEqual(status, 2)
        self.assertIn("name another file", errors)
        with open(log, "rb") as stream:
            self.assertEqual(stream.read(), before)

    def test_a_recorded_bus_gives_the_measurement_sets_of_its_steps(self):
        recording = self.path("bus.log")
        with open(recording, "w", encoding="utf-8") as stream:
            for step in range(1, 6):
                for sensor in range(step):
                    data = struct.pack("<BH", sensor % 2, step).hex().upper()
                    stream.write(f"({step:010d}.000000) can0 {0x101 + sensor:03X}#{data}\n")
                stream.write(f"({step:010d}.500000) can0 7F0#{struct.pack('<I', step).hex().upper()}\n")
        url = "udpm://239.255.76.67:17999?ttl=0"
        link = harness.LcmSocket(url)
        self.addCleanup(link.close)
        driver = [harness.program("can-driver"), harness.TRACKING, "--lcm-url", url, "--bus", "candump:" + recording]
        done = subprocess.run([*driver, "--set", "steps=5"], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stderr)
        sets_received = {}
        while len(sets_received) < 5:
            message = link.receive(timeout_s=5)
            self.assertIsNotNone(message, f"only {len(sets_received)} sets came")
            if message[0] == "MEASUREMENT":
                measured = harness.holdfast.measurement_set_t.decode(message[1])
                sets_received[measured.step] = [(p.source, p.values[0]) for p in measured.packets]
        self.assertEqual(sets_received, {k: [(s, float(s % 2)) for s in range(k)] for k in range(1, 6)})

        # A recording that ends before the run that it is read for is said, not waited for.
        done = subprocess.run([*driver, "--set", "steps=6"], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 1)
        self.assertIn("ended before the last step", done.stderr)
        self.assertEqual(call("can-driver", harness.TRACKING, "--bus", "candump:" + self.path("none.log"))[0], 2)
        self.assertEqual(call("can-driver", harness.TRACKING, "--bus", "carrier:pigeon")[0], 2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
