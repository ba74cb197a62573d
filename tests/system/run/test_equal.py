"""One seed, one result: live, replay by file and by lcm-logplayer, and campaign publish the same estimates."""
import os
import subprocess
import time
import unittest

import harness
from harness import RunTest, call, sets


class EqualTest(RunTest):
    def check(self, scenario):
        small = sets(steps=40, period_s=0.005)
        run = self.start(*small, scenario=scenario)
        self.assert_succeeds(run.finish())
        self.assertEqual(run.review()["losses"]["sum"], 0)

        self.assert_succeeds(call("campaign", scenario, *small, "--log", self.path("campaign.lcm")))
        self.assert_equal_logs(run.log, self.path("campaign.lcm"))
        self.assert_succeeds(call("estimator", "--log", run.log, "--out", self.path("replay.lcm")))
        self.assert_equal_logs(run.log, self.path("replay.lcm"))
        self.play(run)
        self.assert_equal_logs(run.log, self.path("played.lcm"))

        # Negative control: another seed is another run, and the comparison says so.
        self.assert_succeeds(call("campaign", scenario, *small, *sets(seed=2), "--log", self.path("other.lcm")))
        self.assertEqual(call("review", "--compare", run.log, self.path("other.lcm"))[0], 1)

    def play(self, run):
        """Feeds fresh estimators with lcm-logplayer and records what they say."""
        url = run.lcm_url
        children = [subprocess.Popen(["lcm-logger", f"--lcm-url={url}", "-q", "-c", "(RUN_META|EST_.*)",
                                      self.path("played.lcm")])]
        waiting = {"STATUS_SECURE", "STATUS_NEGLECT"}
        for name in ("secure", "neglect"):
            children.append(subprocess.Popen([harness.program("estimator"), "--scenario",
                                              os.path.join(run.folder, "scenario.yaml"), "--name", name,
                                              "--lcm-url", url]))
        while waiting:
            message = run.link.receive(timeout_s=20 * harness.PATIENCE)
            self.assertIsNotNone(message, f"not ready: {waiting}")
            waiting.discard(message[0])
        subprocess.run(["lcm-logplayer", "-l", url, "-e", "(RUN_META|MEASUREMENT|KNOWN_INPUT)", run.log],
                       check=True, timeout=60 * harness.PATIENCE, stdout=subprocess.DEVNULL)
        for child in children[1:]:
            self.assertEqual(child.wait(timeout=30 * harness.PATIENCE), 0)
        # The logger writes every 100 ms.
        deadline = time.monotonic() + 10 * harness.PATIENCE
        while sum(channel.startswith("EST_") for channel, _ in harness.read_log(self.path("played.lcm"))) < 80:
            self.assertLess(time.monotonic(), deadline, "lcm-logger did not record every estimate")
        children[0].terminate()
        children[0].wait(timeout=30)

    def test_digital_bits(self):
        self.check(harness.TRACKING)

    def test_radio_channel(self):
        self.check(os.path.join(harness.SOURCE, "scenarios", "binary_radio.yaml"))

    def test_without_a_bus_the_plant_publishes_what_an_unattacked_bus_would(self):
        calm = sets(steps=40, period_s=0.005, attacks="[]")
        run = self.start(*calm)
        self.assert_succeeds(run.finish())
        bare = harness.Run(self.path("bare"), *calm, *sets(network__sensor_bus="none", network__monitor_bus="none"))
        self.addCleanup(bare.link.close)
        self.assert_succeeds(bare.finish())
        self.assert_equal_logs(run.log, bare.log)


if __name__ == "__main__":
    unittest.main(verbosity=2)
