"""What was recorded of real sensors, without ticks, is cut into steps by its stamps."""
import os
import re
import subprocess
import unittest

import harness
import holdfast
from harness import RunTest, program, sets
from lcm_socket import LcmSocket

SCENARIO = os.path.join(harness.SOURCE, "scenarios", "binary_canopen.yaml")
STEPS = 30
URL = "udpm://239.255.76.68:7668?ttl=0"


class RecordingTest(RunTest):
    def record(self, plain, without_ticks):
        """The same frames twice; the second log has stamps 20 ms apart in place of ticks."""
        subprocess.run([program("plant"), SCENARIO, "--bus", f"candump-write:{plain}", "--lcm-url", URL,
                        *sets(steps=STEPS, period_s=0)], check=True)
        step = 1
        with open(plain, encoding="ascii") as source, open(without_ticks, "w", encoding="ascii") as target:
            for line in source:
                if "7F0#" in line:
                    step += 1
                else:
                    target.write(re.sub(r"^\([0-9.]+\)", f"({1700000000 + 0.02 * step:.6f})", line))
            # Somebody else's frame, which shows that the last step has passed.
            target.write(f"({1700000000 + 0.02 * step:.6f}) can0 555#00\n")

    def drive(self, log, **values):
        """{step: values by source}, and the driver's exit status."""
        link = LcmSocket(URL)
        self.addCleanup(link.close)
        driver = subprocess.Popen([program("can-driver"), SCENARIO, "--bus", f"candump:{log}", "--lcm-url", URL,
                                   *sets(steps=STEPS, **values)], stderr=subprocess.PIPE, text=True)
        found = {}
        while True:
            message = link.receive(timeout_s=1.0)
            if message is None:
                break
            if message[0] == "MEASUREMENT":
                measured = holdfast.measurement_set_t.decode(message[1])
                found[measured.step] = {packet.source: packet.values[0] for packet in measured.packets}
        _, errors = driver.communicate(timeout=20)
        return found, driver.returncode, errors

    def test_steps_by_stamps_are_those_by_ticks(self):
        plain, stamped = self.path("plain.log"), self.path("stamped.log")
        self.record(plain, stamped)
        by_ticks, status, errors = self.drive(plain)
        self.assertEqual((status, len(by_ticks)), (0, STEPS), errors)
        self.assertIn("only read", errors)
        by_stamps, status, errors = self.drive(stamped, network__close_step="clock", period_s=0.02)
        self.assertEqual(status, 0, errors)
        self.assertEqual(by_stamps, by_ticks)
        self.assertTrue(all(len(values) == 16 for values in by_ticks.values()))


if __name__ == "__main__":
    unittest.main()
