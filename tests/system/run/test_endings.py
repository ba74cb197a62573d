"""How runs end: a killed process, Ctrl-C, wrong scenarios; the log stays readable each time."""
import os
import signal
import subprocess
import time
import unittest

import harness
import holdfast
from harness import RunTest, call, is_running, sets


class EndingsTest(RunTest):
    def check_kill(self, pattern, name):
        run = self.start(*sets(steps=5000, period_s=0.02 * harness.PATIENCE))
        run.wait_for_step(3)
        os.kill(run.pid_of(pattern), signal.SIGKILL)
        status, _, errors = run.finish()
        self.assertEqual(status, 1, errors)
        self.assertIn(name, errors)
        self.assertIn("signal 9", errors)
        self.assert_succeeds(call("review", run.log))

    def test_killed_driver(self):
        self.check_kill("holdfast-can-driver", "driver")

    def test_killed_attacker(self):
        self.check_kill("holdfast-attacker", "attacker")

    def test_killed_plant(self):
        self.check_kill("holdfast-plant", "plant")

    def test_killed_estimator(self):
        self.check_kill("holdfast-estimator .*--name secure", "secure")

    def test_killed_launcher_takes_its_processes_along_and_leaves_a_log(self):
        run = self.start(*sets(steps=5000, period_s=0.02 * harness.PATIENCE))
        run.wait_for_step(3)
        pids = [run.pid_of(p) for p in ("holdfast-plant", "holdfast-attacker", "holdfast-can-driver")]
        run.process.kill()
        run.process.communicate(timeout=30 * harness.PATIENCE)
        deadline = time.monotonic() + 20 * harness.PATIENCE
        while any(is_running(pid) for pid in pids):
            self.assertLess(time.monotonic(), deadline, "processes outlive their launcher")
        self.assert_succeeds(call("review", run.log))

    def test_interrupt_stops_all_in_order(self):
        run = self.start(*sets(steps=5000, period_s=0.02 * harness.PATIENCE))
        run.wait_for_step(3)
        run.process.send_signal(signal.SIGINT)
        status, output, errors = run.finish()
        self.assertEqual(status, 130, errors)
        self.assertIn("RMSE", output)
        self.assertNotIn("killed", errors)
        self.assert_succeeds(call("review", run.log))

    def test_two_runs_at_once_do_not_meet(self):
        if harness.BUS == "vcan":
            first = self.start(*sets(steps=5000))
            status, _, errors = call("run", harness.TRACKING, "--runs", self.folder)
            self.assertEqual(status, 1)
            self.assertIn("vcan0", errors)
            first.wait_for_step(1)
            return
        options = sets(steps=60, period_s=0.01)
        first, second = self.start(*options), self.start(*options)
        self.assertNotEqual(first.lcm_url, second.lcm_url)
        self.assertNotEqual(first.sensor_bus, second.sensor_bus)
        for run in (first, second):
            self.assert_succeeds(run.finish())
        self.assert_equal_logs(first.log, second.log)

    def test_forged_steps_overflow_nothing_and_end_nothing(self):
        run = self.start(*sets(steps=30, period_s=0.02 * harness.PATIENCE))
        message = holdfast.status_t()
        for name in ("driver", "attacker", "secure", "plant"):
            for step in (2**63 - 1, -2**63, 2**63 - 1):
                message.name, message.state, message.step = name, message.RUNNING, step
                run.link.publish("STATUS_" + name.upper(), message.encode())
        self.assert_succeeds(run.finish())
        self.assertEqual(run.review()["truth_steps"], 30)

    def test_a_slow_period_is_no_stall(self):
        run = self.start("--stall-timeout", "0.1", *sets(steps=2, period_s=2.5))
        self.assert_succeeds(run.finish())

    def test_a_stopped_process_stalls_the_run_and_is_killed(self):
        run = self.start("--stall-timeout", "1", *sets(steps=100, period_s=0.02 * harness.PATIENCE))
        run.wait_for_step(3)
        os.kill(run.pid_of("holdfast-can-driver"), signal.SIGSTOP)
        status, _, errors = run.finish()
        self.assertEqual(status, 1, errors)
        self.assertRegex(errors, r"no new step for \d+ s: driver at \d+; attacker at \d+;")
        self.assertIn("killed, as it did not stop: driver\n", errors)

    def test_a_full_disk_fails_the_run_and_leaves_its_report(self):
        # 512-byte blocks: the log outgrows them, no other file does.
        limited = 'ulimit -f 200; trap "" XFSZ; exec "$@"'
        command = ["sh", "-c", limited, "sh", harness.program("run"), harness.TRACKING, "--runs", self.folder]
        done = subprocess.run([*command, *sets(steps=5000, period_s=0.005)], capture_output=True, text=True,
                              timeout=60 * harness.PATIENCE)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("log.lcm: cannot be written: File too large", done.stderr)
        self.assertIn("RMSE", done.stdout)

    def test_runs_folder_that_cannot_be(self):
        with open(self.path("file"), "w", encoding="utf-8"):
            pass
        status, _, errors = call("run", harness.TRACKING, "--runs", self.path("file") + "/runs")
        self.assertEqual(status, 1)
        self.assertIn(self.path("file") + "/runs", errors)
        self.assertIn("Not a directory", errors)
        self.assertIn("name another folder by --runs", errors)

    def test_buses_that_processes_cannot_share(self):
        for url in ("loop:a", "candump:" + self.path("bus.log"), "candump-write:" + self.path("bus.log")):
            for key in ("network.sensor_bus", "network.monitor_bus"):
                status, _, errors = call("run", harness.TRACKING, "--runs", self.path("none"), "--set", f"{key}={url}")
                self.assertEqual(status, 2, errors)
                self.assertIn(f"{key}: {url} ", errors)
        self.assertFalse(os.path.exists(self.path("none")))

    def test_the_way_in_is_one_that_works(self):
        run = self.start(*sets(steps=2))
        if "HOLDFAST_VCAN_GUEST" in os.environ:
            self.assertIn("inside a guest kernel", run.head)
            self.assertIn("& candump vcan1'", run.head)
            self.assertNotIn("nsenter", run.head)
        else:
            self.assertRegex(run.head, r"(?m)^look +(nsenter .* -n -t \d+ -- )?env LCM_DEFAULT_URL='\S+' scripts/spy$")
            self.assertEqual("nsenter" in run.head, "HOLDFAST_NAMESPACE_PID" in os.environ)
        self.assert_succeeds(run.finish())

    def test_wrong_scenarios(self):
        path = self.path("wrong.yaml")
        with open(harness.TRACKING, encoding="utf-8") as stream:
            text = stream.read()
        dbc = os.path.join(harness.SOURCE, "scenarios", "binary_sensors.dbc")
        text = text.replace("dbc: binary_sensors.dbc", f"dbc: {dbc}")
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(text.replace("dos: 0.1", "dos: 1.5").replace("seed: 1", "sead: 1"))
        for name in ("run", "campaign"):
            status, _, errors = call(name, path)
            self.assertEqual(status, 2, errors)
            self.assertRegex(errors, r"wrong\.yaml:\d+:\d+: plant\.attack\.dos: 1\.5 must be in \[0, 1\]")
            self.assertRegex(errors, r"wrong\.yaml:\d+:\d+: sead: unknown key")
        self.assertEqual(call("run", self.path("missing.yaml"))[0], 2)
        self.assertEqual(call("run", harness.TRACKING, "--no-such-option")[0], 2)
        self.assertEqual(call("review", self.path("missing.lcm"))[0], 2)
        for name in ("run", "campaign", "review", "plant", "attacker", "can-driver", "estimator"):
            self.assertIn("xample", self.assert_succeeds(call(name, "--help")))
            self.assertIn("holdfast", self.assert_succeeds(call(name, "--version")))


if __name__ == "__main__":
    unittest.main(verbosity=2)
