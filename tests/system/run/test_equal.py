"""One seed, one result: live, replay by file and by lcm-logplayer, and campaign publish the same estimates."""
import os
import subprocess
import unittest

import harness
from harness import RunTest, call, sets


def end(child):
    if child.poll() is None:
        child.kill()
        child.wait()


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
        """Feeds fresh estimators with lcm-logplayer and records what they say.

        The test's own socket records: lcm-logger keeps a queue of 30 messages, which a slow machine overflows.
        """
        url = run.lcm_url
        estimators = []
        for name in ("secure", "neglect"):
            estimators.append(subprocess.Popen([harness.program("estimator"), "--scenario",
                                                os.path.join(run.folder, "scenario.yaml"), "--name", name,
                                                "--lcm-url", url]))
            self.addCleanup(end, estimators[-1])
        waiting = {"STATUS_SECURE", "STATUS_NEGLECT"}
        while waiting:
            message = run.link.receive(timeout_s=20 * harness.PATIENCE)
            self.assertIsNotNone(message, f"not ready: {waiting}")
            waiting.discard(message[0])
        player = subprocess.Popen(["lcm-logplayer", "-l", url, "-e", "(RUN_META|MEASUREMENT|KNOWN_INPUT)", run.log],
                                  stdout=subprocess.DEVNULL)
        self.addCleanup(end, player)
        recorded = []
        while sum(channel.startswith("EST_") for channel, _ in recorded) < 80:
            message = run.link.receive(timeout_s=20 * harness.PATIENCE)
            self.assertIsNotNone(message, f"{len(recorded)} messages, then nothing")
            if message[0] == "RUN_META" or message[0].startswith("EST_"):
                recorded.append(message)
        for child in (player, *estimators):
            self.assertEqual(child.wait(timeout=60 * harness.PATIENCE), 0)
        harness.write_log(self.path("played.lcm"), recorded)

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
