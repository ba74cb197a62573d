"""A frame that somebody sends into the monitor bus in mid-run is labelled foreign and shifts no other label."""
import csv
import struct
import subprocess
import unittest

import can
import harness
import holdfast
from harness import RunTest, call, sets

STEPS = 60


class ForeignTest(RunTest):
    def send(self, run, identifier, payloads):
        """All of them at once: a process for each would fall behind the run on a slow machine."""
        if harness.BUS == "vcan":
            bus = run.monitor_bus.split(":")[1]
            subprocess.run(["cansend", bus, f"{identifier:03X}#{payloads[0].hex()}"], check=True)
            lines = "".join(f"(0.000000) {bus} {identifier:03X}#{data.hex()}\n" for data in payloads[1:])
            subprocess.run(["canplayer", "-t", f"{bus}={bus}"], input=lines, text=True, check=True)
            return
        _, group, port = run.monitor_bus.split(":")
        with can.Bus(interface="udp_multicast", channel=group, port=int(port)) as bus:
            for data in payloads:
                bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data))

    def labels(self, log):
        """[(step, source, value, label)] of every packet."""
        path = self.path("labels.csv")
        self.assert_succeeds(call("review", log, "--labels", path))
        with open(path, encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        return [(row["step"], row["source"], row["label"]) for row in rows]

    def test_foreign_frames_shift_no_label(self):
        options = sets(steps=STEPS, period_s=0.03 * harness.PATIENCE)
        run = self.start(*options)
        # Counters of many steps to come, so that one of them is right when the frame arrives.
        run.wait_for_step(10)
        self.send(run, 0x105, [bytes([1]) + struct.pack("<H", step) for step in range(11, STEPS)])
        self.assert_succeeds(run.finish())
        foreign = [label for label in self.labels(run.log) if label[2] == "foreign"]
        self.assertGreaterEqual(len(foreign), 1)
        self.assertTrue(all(label[1] == "4" for label in foreign))

        calm = harness.Run(self.path("calm"), *options)
        self.addCleanup(calm.link.close)
        self.assert_succeeds(calm.finish())
        self.assertEqual([label for label in self.labels(run.log) if label[2] != "foreign"], self.labels(calm.log))


if __name__ == "__main__":
    unittest.main(verbosity=2)
