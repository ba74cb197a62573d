"""A vcan that goes down and up again in mid-run: driver and attacker say so, recover, and lose nothing."""
import subprocess
import unittest

import harness
from harness import RunTest, call, sets


class VcanDownTest(RunTest):
    def check(self, interface):
        options = sets(steps=80, period_s=0.05)
        run = self.start(*options)
        run.wait_for_step(5)
        subprocess.run(["ip", "link", "set", interface, "down"], check=True)
        self.addCleanup(subprocess.run, ["ip", "link", "set", interface, "up"])

        def says_down(channel, payload):
            return channel in ("STATUS_DRIVER", "STATUS_ATTACKER") and b"is down" in payload
        run.wait_for(says_down, "remark that the bus is down")
        subprocess.run(["ip", "link", "set", interface, "up"], check=True)
        status, output, errors = run.finish()
        self.assertEqual(status, 0, output + errors)
        with open(run.folder + "/attacker.txt", encoding="utf-8") as stream:
            text = stream.read()
        self.assertIn(f"{interface} is down", text)
        self.assertIn(f"{interface} is up again", text)
        self.assert_succeeds(call("campaign", harness.TRACKING, *options, "--log", self.path("clean.lcm")))
        self.assert_equal_logs(run.log, self.path("clean.lcm"))

    def test_monitor_side(self):
        self.check("vcan1")

    def test_sensor_side(self):
        self.check("vcan0")


if __name__ == "__main__":
    unittest.main(verbosity=2)
