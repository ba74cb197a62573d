"""Rules that change while a run goes on, and an attacker that only says what it would do."""
import json
import os
import socket
import subprocess
import unittest

import harness
import holdfast
from harness import RunTest, measurement_sets, program, read_log, sets

PERIOD_S = 0.03 * harness.PATIENCE
LIE = "{name: lie, match: {messages: [Sensor01, Sensor02]}, action: flip, signal: DETECT}"


def attack_frames(log, name="ATTACK_FRAME"):
    return [holdfast.attack_frame_t.decode(payload) for channel, payload in read_log(log) if channel == name]


class ControlTest(RunTest):
    def control(self, *arguments, status=0):
        done = subprocess.run([program("control"), self.path("sock"), *arguments], capture_output=True, text=True,
                              timeout=20 * harness.PATIENCE)
        self.assertEqual(done.returncode, status, done.stderr)
        return done.stdout + done.stderr

    def rule_file(self, text):
        with open(self.path("rule.yaml"), "w", encoding="utf-8") as stream:
            stream.write(text)
        return self.path("rule.yaml")

    @staticmethod
    def told(frame):
        """All but the times at which frames came."""
        return (frame.step, frame.rule, frame.disposition, frame.actions, frame.rx_index, frame.tx_index, frame.draw,
                frame.original.identifier, bytes(frame.original.data), bytes(frame.forwarded.data))

    def test_rules_come_and_go_while_frames_pass(self):
        run = self.start("--control", self.path("sock"), *sets(steps=100, period_s=PERIOD_S, attacks="[]"))
        run.wait_for_step(10)
        self.assertIn("generation 0", self.control("list"))
        self.assertIn("generation 1", self.control("add", self.rule_file(LIE)))
        run.wait_for(lambda channel, _: channel == "ATTACK_FRAME", "altered frame")
        self.assertIn("active  lie  flip", self.control("list"))
        self.assertIn("no rule is named 'nobody'", self.control("remove", "nobody", status=2))
        self.assertIn("flop", self.control("change", self.rule_file(LIE.replace("flip", "flop")), status=2))
        self.assertIn("generation 2", self.control("swap", self.rule_file("[" + LIE.replace("flip, signal: DETECT", "drop") + "]")))
        run.wait_for(lambda channel, payload: channel == "ATTACK_FRAME" and holdfast.attack_frame_t.decode(payload).generation == 2,
                     "dropped frame")
        self.assertIn("generation 3", self.control("remove", "lie"))
        self.assert_succeeds(run.finish())
        frames = attack_frames(run.log)
        for generation, action in ((1, "flip"), (2, "drop")):
            self.assertEqual({f.action for f in frames if f.generation == generation}, {action})
        self.assertEqual({f.generation for f in frames}, {1, 2})
        steps = [f.step for f in frames]
        self.assertEqual(steps, sorted(steps))
        self.assertGreater(min(steps), 9)
        # Whole and at once: from its first step to the last one a rule met every frame that it matches.
        for generation in (1, 2):
            of_generation = [f.step for f in frames if f.generation == generation]
            whole = range(min(of_generation) + 1, max(of_generation))
            self.assertEqual([of_generation.count(step) for step in whole], [2] * len(whole))
        self.assertFalse(os.path.exists(self.path("sock")))

    def test_rules_pause_when_who_controls_them_dies(self):
        run = self.start("--control", self.path("sock"), *sets(steps=100, period_s=PERIOD_S, attacks="[" + LIE + "]"))
        run.wait_for_step(10)
        with subprocess.Popen([program("control"), self.path("sock"), "watch", "5"], stdout=subprocess.PIPE, text=True) as watcher:
            self.assertIn("generation 0", watcher.stdout.readline())
            watcher.kill()
        run.wait_for(lambda channel, payload: channel == "STATUS_ATTACKER"
                     and "went away" in holdfast.status_t.decode(payload).remark, "remark")
        with socket.socket(socket.AF_UNIX) as client:
            client.connect(self.path("sock"))
            client.sendall(b'{"do": "list"}\n')
            answer = json.loads(client.makefile().readline())
        self.assertEqual([rule["paused"] for rule in answer["rules"]], [True])
        self.assert_succeeds(run.finish())
        steps = [f.step for f in attack_frames(run.log)]
        self.assertLess(max(steps), 100)
        self.assertEqual([steps.count(step) for step in range(1, max(steps))], [2] * (max(steps) - 1))

    def test_a_dry_run_changes_nothing_and_says_all(self):
        options = sets(steps=40, period_s=PERIOD_S)
        rules = sets(attacks="[" + LIE + ", {name: late, match: {messages: [Sensor03]}, action: delay, delay_steps: [1, 3]}, "
                     "{name: forge, match: {messages: [Sensor04]}, action: inject, signal: DETECT, value: {value: 1}}]")
        dry = self.start("--dry-run", *options, *rules)
        self.assert_succeeds(dry.finish())
        calm = self.start(*options, *sets(attacks="[]"))
        self.assert_succeeds(calm.finish())
        wet = self.start(*options, *rules)
        self.assert_succeeds(wet.finish())
        self.assertEqual(measurement_sets(dry.log), measurement_sets(calm.log))
        self.assertNotEqual(measurement_sets(wet.log), measurement_sets(calm.log))
        self.assertEqual(attack_frames(dry.log), [])
        labels = [self.told(f) for f in attack_frames(dry.log, "ATTACK_LABEL")]
        self.assertGreater(len(labels), 150)
        self.assertEqual(labels, [self.told(f) for f in attack_frames(wet.log)])


if __name__ == "__main__":
    unittest.main()
