"""Pages of a real run and of a real campaign, opened in a browser by check_page.mjs."""
import os
import subprocess
import sys
import tempfile
import unittest

BIN = os.path.join(os.environ["HOLDFAST_BINARY_DIR"], "bin")
SCENARIO = os.path.join(os.environ["HOLDFAST_SOURCE_DIR"], "scenarios", "binary_tracking.yaml")
CHECK_PAGE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "check_page.mjs")


class RealPagesTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def call(self, *command):
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=self.folder.name)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def test_run(self):
        self.call(os.path.join(BIN, "holdfast-campaign"), SCENARIO, "--log", self.path("run.lcm"))
        self.call(os.path.join(BIN, "holdfast-review"), self.path("run.lcm"), "--report", self.path("run.html"))
        self.call("node", CHECK_PAGE, self.path("run.html"))

    def test_campaign(self):
        results = self.path("results.sqlite")
        self.call(os.path.join(BIN, "holdfast-campaign"), SCENARIO, "--runs", "8", "--set", "steps=30",
                  "--sweep", "attacks.flip.probability=0,0.2,0.4", "--out", results)
        self.call(os.path.join(BIN, "holdfast-review"), results, "--report", self.path("campaign.html"),
                  "--csv", self.path("csv"), "--figures", self.path("figures"), "--json", self.path("all.json"))
        self.call("node", CHECK_PAGE, self.path("campaign.html"), "--quick")
        self.assertIn("sweep_rmse_step_mean_position.svg", os.listdir(self.path("figures")))
        with open(self.path("csv/metrics.csv"), encoding="utf-8") as stream:
            self.assertIn("attacks.flip.probability=0.4", stream.read())


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
