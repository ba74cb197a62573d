"""scripts/run, as somebody calls it who has just built: its words, its exit status and the files that it leaves."""
import json
import os
import re
import subprocess
import unittest
import xml.etree.ElementTree as ElementTree

import harness
import yaml
from harness import RunTest

SCRIPT = os.path.join(harness.SOURCE, "scripts", "run")


class ScriptsTest(RunTest):
    def call_script(self, *arguments, **environment):
        done = subprocess.run([SCRIPT, *arguments], capture_output=True, text=True, cwd=self.folder,
                              timeout=60 * harness.PATIENCE,
                              env={**os.environ, "HOLDFAST_BUILD": harness.BINARY, **environment})
        return done.returncode, done.stdout, done.stderr

    def test_the_default_run_leaves_log_report_and_picture(self):
        output = self.assert_succeeds(self.call_script("--runs", self.path("runs")))
        if harness.BUS == "vcan":
            self.assertIn("sensors socketcan:vcan0, monitor socketcan:vcan1", output)
            self.assertNotIn("embedded", output)
        else:
            self.assertRegex(output, r"(?m)^bus +embedded")
        if os.environ.get("HOLDFAST_VCAN_GUEST"):
            self.assertRegex(output, r"(?m)^look .*guest kernel")
        else:
            self.assertRegex(output, r"(?m)^look .*LCM_DEFAULT_URL='udpm://[^']+\?ttl=0' scripts/spy$")
        self.assertRegex(output, r"(?m)^losses +0$")
        table = {name: float(rmse) for name, rmse in re.findall(r"(?m)^(secure|neglect) +([0-9.e+]+) ", output)}
        self.assertEqual(set(table), {"secure", "neglect"})
        self.assertLess(table["secure"], table["neglect"])

        folder = re.search(r"(?m)^run +(\S+)$", output).group(1)
        self.assertEqual(os.path.dirname(folder), self.path("runs"))
        self.assertTrue(any(channel == "EST_SECURE" for channel, _ in harness.read_log(os.path.join(folder, "log.lcm"))))
        with open(os.path.join(folder, "review.json"), encoding="utf-8") as stream:
            review = json.load(stream)
        self.assertEqual(review["losses"]["sum"], 0)
        for estimator in review["estimators"]:
            if estimator["name"] in table:
                # The table has four digits.
                rmse = estimator["rmse"]["position"]["value"]
                self.assertAlmostEqual(rmse, table[estimator["name"]], delta=1e-3 * rmse)
        self.assert_picture(os.path.join(folder, "path.svg"), ("truth", "secure", "neglect"))

    def assert_picture(self, path, names):
        """The file is SVG, has a drawn line for each name, and a legend with them."""
        with open(path, encoding="utf-8") as stream:
            text = stream.read()
        self.assertRegex(text, r"^<(\?xml|svg)")
        root = ElementTree.fromstring(text)
        tags = [element.tag.rpartition("}")[2] for element in root.iter()]
        self.assertGreaterEqual(tags.count("path") + tags.count("polyline"), len(names))
        legend = " ".join(element.text or "" for element in root.iter() if element.tag.endswith("text"))
        for name in names:
            self.assertIn(name, legend)

    def test_the_scenario_with_an_outsider(self):
        scenario = os.path.join(harness.SOURCE, "scenarios", "outsiders.yaml")
        with open(scenario, encoding="utf-8") as stream:
            entry = next(e for e in yaml.safe_load(stream)["estimators"] if e["name"] == "kalman")
        # The file names the release build, relative to the repository's folder.
        command = entry["command"].replace("build/release", harness.BINARY).replace("examples/", harness.SOURCE + "/examples/")
        output = self.assert_succeeds(self.call_script(scenario, "--runs", self.path("runs"), "--set", "steps=30",
                                                       "--set", f'estimators.kalman.command="{command}"'))
        self.assertRegex(output, r"(?m)^kalman +[0-9.]+ +[0-9.]+ +30 +0 ")

    def test_a_wrong_scenario_is_refused_with_its_place(self):
        wrong = self.path("wrong.yaml")
        with open(wrong, "w", encoding="utf-8") as stream:
            stream.write("holdfast: 1\nname: wrong\nnonsense: 3\n")
        status, output, errors = self.call_script(wrong, "--runs", self.path("runs"))
        self.assertEqual(status, 2, output + errors)
        self.assertIn("wrong.yaml:3:", errors)
        self.assertFalse(os.path.exists(self.path("runs")))

    def test_what_is_not_built_is_said(self):
        status, _, errors = self.call_script(HOLDFAST_BUILD=self.path("nothing"))
        self.assertEqual(status, 1)
        self.assertIn("there is no", errors)
        # A clone without a build, called from inside a network that packages cannot come through.
        os.mkdir(self.path("scripts"))
        with open(SCRIPT, encoding="utf-8") as source, open(self.path("scripts/run"), "w", encoding="utf-8") as copy:
            copy.write(source.read())
        for inside in ({"HOLDFAST_VCAN_GUEST": "1"}, {"HOLDFAST_NAMESPACE_PID": "1"}):
            done = subprocess.run(["bash", self.path("scripts/run")], capture_output=True, text=True, timeout=60,
                                  env={"PATH": os.environ["PATH"], **inside})
            self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
            self.assertIn("nothing is built yet", done.stderr)
            self.assertIn("run scripts/run first", done.stderr)
        # Help is there all the same, and nothing is installed or built for it.
        done = subprocess.run(["bash", self.path("scripts/run"), "--help"], capture_output=True, text=True, timeout=60,
                              env={"PATH": os.environ["PATH"]})
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("run [SCENARIO] [OPTION...]", done.stdout)
        self.assertEqual(os.listdir(self.folder), ["scripts"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
