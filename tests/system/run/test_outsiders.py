"""Estimators from outside, in Python and C++, stand in the results table beside ours."""
import os
import subprocess
import unittest

import harness
from harness import RunTest, call, sets

PYTHON = os.environ["HOLDFAST_SYSTEM_PYTHON"]


class OutsidersTest(RunTest):
    def build_cpp_estimator(self):
        """Installs holdfast and builds the example against it, as a user would."""
        prefix, build = self.path("prefix"), self.path("build")
        source = os.path.join(harness.SOURCE, "examples", "cpp_estimator")
        for command in (["cmake", "--install", harness.BINARY, "--prefix", prefix],
                        ["cmake", "-S", source, "-B", build, f"-DCMAKE_PREFIX_PATH={prefix}"],
                        ["cmake", "--build", build]):
            done = subprocess.run(command, capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stdout[-4000:] + done.stderr[-4000:])
        return os.path.join(build, "last_seen"), os.path.join(prefix, "share", "holdfast", "python")

    def test_both_outsiders_are_in_the_table(self):
        last_seen, types = self.build_cpp_estimator()
        script = os.path.join(harness.EXAMPLES, "kalman_filter.py")
        kalman = f"PYTHONPATH='{types}' {PYTHON} {script} {{lcm_url}} {{name}} {{scenario}}"
        estimators = ("[{name: secure, method: secure_particle_filter}, "
                      f"{{name: kalman, command: \"{kalman}\"}}, "
                      f"{{name: last_seen, command: \"{last_seen} {{lcm_url}} {{name}} {{scenario}}\"}}]")
        run = self.start(*sets(steps=50, period_s=0.02), "--set", "estimators=" + estimators)
        self.assertIn("outside    kalman:", run.head)
        output = self.assert_succeeds(run.finish())
        rmse = {}
        for estimator in run.review()["estimators"]:
            self.assertEqual(estimator["steps"], 50, estimator["name"])
            rmse[estimator["name"]] = estimator["rmse"]["position"]["value"]
        self.assertEqual(set(rmse), {"secure", "kalman", "last_seen"})
        self.assertLess(rmse["secure"], rmse["last_seen"])
        for name in rmse:
            self.assertRegex(output, rf"(?m)^{name} +\d")
        status, _, errors = call("campaign", harness.TRACKING, "--runs", "2", "--set", "estimators=" + estimators)
        self.assertEqual(status, 0)
        self.assertIn("kalman is an outside command", errors)

    def test_a_plant_from_outside(self):
        script = os.path.join(harness.EXAMPLES, "straight_plant.py")
        plant = f"PYTHONPATH='{harness.PYTHON_TYPES}' {PYTHON} {script} {{lcm_url}} {{sensor_bus}} {{scenario}}"
        run = self.start(*sets(steps=40, period_s=0.02), "--set", f"plant.command=\"{plant}\"")
        self.assertIn("outside    plant:", run.head)
        self.assert_succeeds(run.finish())
        review = run.review()
        self.assertEqual(review["truth_steps"], 40)
        self.assertEqual(review["losses"]["sum"], 0)
        secure = review["estimators"][0]
        self.assertEqual((secure["name"], secure["steps"]), ("secure", 40))
        self.assertLess(secure["rmse"]["position"]["value"], 15.0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
