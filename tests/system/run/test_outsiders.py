"""Estimators from outside, in Python and C++, stand in the results table beside ours."""
import os
import subprocess
import time
import unittest

import harness
from harness import RunTest, call, is_running, sets

PYTHON = os.environ["HOLDFAST_SYSTEM_PYTHON"]


# An estimator that says that it is ready, notes what it was given, and answers so many steps.
ANSWERS = """
import os, sys, time
from holdfast import estimate_t, measurement_set_t, status_t
from lcm_socket import LcmSocket
url, name, scenario, notes, steps = sys.argv[1:]
open_descriptors = [fd for fd in os.listdir("/proc/self/fd") if int(fd) > 2 and os.path.exists("/proc/self/fd/" + fd)]
with open(notes, "w") as stream:
    print(scenario, os.path.exists(scenario), len(open_descriptors), sep="\\n", file=stream)
link = LcmSocket(url)
status = status_t()
status.name, status.state = name, status_t.READY
done, next_status = 0, 0.0
while done < int(steps):
    if time.monotonic() >= next_status:
        link.publish("STATUS_" + name.upper(), status.encode())
        next_status = time.monotonic() + 0.2
    received = link.receive(timeout_s=0.1)
    if received and received[0] == "MEASUREMENT":
        measurement = measurement_set_t.decode(received[1])
        message = estimate_t()
        message.utime, message.seq, message.step = measurement.utime, done, measurement.step
        message.measurement_seq, message.attack_probability, message.input_step = measurement.seq, -1.0, -1
        message.num_states, message.mean, message.num_covariance, message.covariance = 4, [0.0] * 4, 16, [0.0] * 16
        link.publish("EST_" + name.upper(), message.encode())
        done += 1
"""


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

    def outside(self, command):
        ours = "{name: secure, method: secure_particle_filter}"
        return "--set", f'estimators=[{ours}, {{name: odd, command: "{command}"}}]'

    def answers(self, steps):
        script = self.path("answers.py")
        with open(script, "w", encoding="utf-8") as stream:
            stream.write(ANSWERS)
        return (f"PYTHONPATH='{harness.PYTHON_TYPES}:{harness.EXAMPLES}' {PYTHON} {script} {{lcm_url}} {{name}} "
                f"{{scenario}} {self.path('notes.txt')} {steps}")

    def script(self, text):
        path = self.path("script.sh")
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(text)
        return path

    def run_to_failure(self, *arguments):
        started = time.monotonic()
        status, output, errors = call("run", harness.TRACKING, "--runs", self.path("runs"), *arguments)
        self.assertEqual(status, 1, output + errors)
        return errors, time.monotonic() - started

    def test_an_outsider_that_ends_too_soon_fails_the_run_whatever_its_exit_status(self):
        errors, _ = self.run_to_failure(*sets(steps=200, period_s=0.02), *self.outside(self.answers(3)))
        self.assertIn("odd ended before its last step: its newest estimate is of step 3 of 200 (exit status 0)", errors)
        # Negative control: the same program with every step answered.
        run = self.start(*sets(steps=20, period_s=0.02), *self.outside(self.answers(20)))
        self.assert_succeeds(run.finish())

    def test_an_outsider_that_is_never_ready_is_named(self):
        errors, duration_s = self.run_to_failure(*self.outside("true"))
        self.assertIn("odd ended before the run began (exit status 0)", errors)
        self.assertLess(duration_s, 20)
        errors, _ = self.run_to_failure("--ready-timeout", "3", *self.outside("exec sleep 1000"))
        self.assertIn("not ready in time: odd;", errors)

    def test_an_outsiders_last_words_do_no_harm_to_a_terminal(self):
        script = self.script("printf 'first\\n\\033[2Jsecond\\n' >&2; exit 3\n")
        errors, _ = self.run_to_failure(*self.outside(f"sh {script}"))
        self.assertIn("odd ended before the run began (exit status 3)", errors)
        self.assertNotIn("\033", errors)
        self.assertRegex(errors, r"(?m)^    first\n    \\x1[Bb]\[2Jsecond$")

    def test_nothing_that_an_outsider_started_outlives_the_run(self):
        pids = self.path("pids")
        # One that obeys, one that does not; their parent ends in good order before the run is stopped.
        script = self.script(f"sleep 1000 & echo $! >{pids}\n"
                             f"(trap '' TERM; while :; do sleep 1; done) & echo $! >>{pids}\n"
                             "exec env \"$@\"\n")
        run = self.start(*sets(steps=20, period_s=0.02), *self.outside(f"sh {script} {self.answers(20)}"))
        status, output, errors = run.finish()
        self.assertEqual(status, 0, output + errors)
        self.assertIn("killed, as it did not stop: what odd started", errors)
        with open(pids, encoding="utf-8") as stream:
            left = [pid for pid in stream.read().split() if is_running(pid)]
        self.assertEqual(left, [])

    def test_an_outsider_gets_its_values_whole_and_no_descriptor_of_ours(self):
        folder = self.path("it's {name}")
        run = harness.Run(folder.replace(" ", "_"), *sets(steps=5), *self.outside(self.answers(5)))
        self.addCleanup(run.link.close)
        self.assert_succeeds(run.finish())
        with open(self.path("notes.txt"), encoding="utf-8") as stream:
            self.assertEqual(stream.read().split(), [run.folder + "/scenario.yaml", "True", "0"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
