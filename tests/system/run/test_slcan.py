"""A serial adapter in front of the driver: can-utils' slcanpty stands for it, between a pty and vcan0."""
import os
import re
import struct
import subprocess
import time
import unittest

import harness
from harness import RunTest

LCM_URL = "udpm://239.255.76.67:17997?ttl=0"


class SlcanTest(RunTest):
    def start_adapter(self, name):
        """The adapter on a new pty, which `name` leads to."""
        adapter = subprocess.Popen(["stdbuf", "-oL", "slcanpty", "/dev/ptmx", "vcan0"], stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True)
        self.addCleanup(self.end, adapter)
        device = None
        while device is None:
            line = adapter.stdout.readline()
            self.assertTrue(line, "slcanpty ended")
            found = re.search(r"/dev/pts/\d+", line)
            device = found and found.group(0)
        if os.path.islink(name):
            os.remove(name)
        os.symlink(device, name)
        return adapter

    @staticmethod
    def end(child):
        if child.poll() is None:
            child.kill()
        child.wait()
        if child.stdout:
            child.stdout.close()

    def send(self, steps):
        """Frames of all sixteen sensors in each step, and the tick, onto the adapter's bus."""
        lines = []
        for step in steps:
            lines += [f"(0.000000) vcan0 {0x101 + s:03X}#{struct.pack('<BH', (s + step) % 2, step).hex().upper()}"
                      for s in range(16)]
            lines.append(f"(0.000000) vcan0 7F0#{struct.pack('<I', step).hex().upper()}")
        subprocess.run(["canplayer", "-t", "vcan0=vcan0"], input="\n".join(lines) + "\n", text=True, check=True)

    def receive(self, link, steps):
        sets = {}
        while len(sets) < len(steps):
            message = link.receive(timeout_s=20 * harness.PATIENCE)
            self.assertIsNotNone(message, f"only {sorted(sets)} of {steps} came")
            if message[0] == "MEASUREMENT":
                measured = harness.holdfast.measurement_set_t.decode(message[1])
                sets[measured.step] = [(p.source, p.values[0]) for p in measured.packets]
        return sets

    def wait_for(self, link, condition, what):
        deadline = time.monotonic() + 20 * harness.PATIENCE
        while time.monotonic() < deadline:
            message = link.receive(timeout_s=0.5)
            if message is not None and message[0] == "STATUS_DRIVER":
                if condition(harness.holdfast.status_t.decode(message[1])):
                    return
        self.fail(what)

    def test_the_driver_reads_an_adapter_that_is_pulled_out_and_put_back(self):
        device = self.path("adapter")
        adapter = self.start_adapter(device)
        link = harness.LcmSocket(LCM_URL)
        self.addCleanup(link.close)
        driver = subprocess.Popen([harness.program("can-driver"), harness.TRACKING, "--lcm-url", LCM_URL, "--bus",
                                   "slcan:" + device, "--set", "steps=6"])
        self.addCleanup(self.end, driver)
        # The peer knows no listen-only, so the driver must have found another way by now.
        self.wait_for(link, lambda status: "listen-only" in status.remark, "the driver did not open the adapter")
        self.send(range(1, 4))
        sets = self.receive(link, [1, 2, 3])
        self.end(adapter)
        self.wait_for(link, lambda status: "is gone" in status.remark, "nobody saw that the adapter was gone")
        self.start_adapter(device)
        self.wait_for(link, lambda status: "is back" in status.remark, "nobody saw that the adapter was back")
        self.send(range(4, 7))
        sets.update(self.receive(link, [4, 5, 6]))
        self.assertEqual(sets, {k: [(s, float((s + k) % 2)) for s in range(16)] for k in range(1, 7)})
        self.assertEqual(driver.wait(timeout=20 * harness.PATIENCE), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
