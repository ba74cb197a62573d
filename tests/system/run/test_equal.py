"""One seed, one result: live, replay by file and by lcm-logplayer, and campaign publish the same estimates."""
import os
import subprocess
import unittest

import harness
import holdfast
from harness import RunTest, call, sets


NETWORK_FILTERS = ("hybrid", "nearest", "joint")
HYBRID = ("{name: hybrid, method: hybrid_bernoulli, delivery_probability: same, substitution_probability: same, "
          "attack_models: [{terms: [{std: 10}]}], start: {std: 0.1}, packet_box: {low: -10, high: 5}}")
ONLY_HYBRID = ["--set", f"estimators=[{HYBRID}]"]
IS_SLOW = os.environ.get("HOLDFAST_TEST_BUS") == "vcan"  # a guest of one processor, which each process costs seconds
# Forty steps do not reach the scenario's attack.
EARLY_ATTACK = [part for channel in (0, 1)
                for part in ("--set", f"plant.signal_attacks.{channel}.window.first_step=15")]


def network_scenario(name):
    return os.path.join(harness.SOURCE, "scenarios", f"{name}.yaml")


def end(child):
    if child.poll() is None:
        child.kill()
        child.wait()


class EqualTest(RunTest):
    def check(self, scenario, names=("secure", "neglect"), extra=()):
        small = [*sets(steps=40, period_s=0.005), *extra]
        run = self.start(*small, scenario=scenario)
        self.assert_succeeds(run.finish())
        self.assertEqual(run.review()["losses"]["sum"], 0)

        self.assert_succeeds(call("campaign", scenario, *small, "--log", self.path("campaign.lcm")))
        self.assert_equal_runs(run.log, self.path("campaign.lcm"))
        self.assert_succeeds(call("estimator", "--log", run.log, "--out", self.path("replay.lcm")))
        self.assert_equal_logs(run.log, self.path("replay.lcm"))
        self.play(run, names)
        self.assert_equal_logs(run.log, self.path("played.lcm"))

        # Negative control: another seed is another run, and the comparison says so.
        self.assert_succeeds(call("campaign", scenario, *small, *sets(seed=2), "--log", self.path("other.lcm")))
        self.assertEqual(call("review", "--compare", run.log, self.path("other.lcm"))[0], 1)
        return run

    def play(self, run, names):
        """Feeds fresh estimators with lcm-logplayer and records what they say.

        The test's own socket records: lcm-logger keeps a queue of 30 messages, which a slow machine overflows.
        """
        url = run.lcm_url
        estimators = []
        for name in names:
            estimators.append(subprocess.Popen([harness.program("estimator"), "--scenario",
                                                os.path.join(run.folder, "scenario.yaml"), "--name", name,
                                                "--lcm-url", url]))
            self.addCleanup(end, estimators[-1])
        waiting = {f"STATUS_{name.upper()}" for name in names}
        while waiting:
            message = run.link.receive(timeout_s=20 * harness.PATIENCE)
            self.assertIsNotNone(message, f"not ready: {waiting}")
            waiting.discard(message[0])
        player = subprocess.Popen(["lcm-logplayer", "-l", url, "-e", "(RUN_META|MEASUREMENT|KNOWN_INPUT)", run.log],
                                  stdout=subprocess.DEVNULL)
        self.addCleanup(end, player)
        recorded = []
        while sum(channel.startswith("EST_") for channel, _ in recorded) < 40 * len(names):
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

    def check_network(self, scenario, names):
        if IS_SLOW:
            return self.check(network_scenario(scenario), ("hybrid",), (*EARLY_ATTACK, *ONLY_HYBRID))
        return self.check(network_scenario(scenario), names, EARLY_ATTACK)

    def test_packet_injection(self):
        self.check_network("ieee14", NETWORK_FILTERS + ("mean", "association", "two_modes"))

    def test_packet_substitution(self):
        self.check_network("ieee14_substitution", NETWORK_FILTERS)

    @unittest.skipIf(IS_SLOW, "injection and substitution run there")
    def test_replayed_packets(self):
        replay = "{distribution: replay, delay_steps: [2, 6]}"
        self.check(network_scenario("ieee14"), ("hybrid",), (
            *EARLY_ATTACK, *sets(attacks__injection__value=replay), *ONLY_HYBRID))

    def test_breakers_and_commands_of_three_areas(self):
        """Ties opened by a forged command, closed again by one of the operator that the attacker bends."""
        rules = ("[{name: open, match: {messages: [BreakerCommand]}, window: {first_step: 2, last_step: 2}, "
                 "action: inject, mode: '000', lead_steps: 18}, "
                 "{name: bend, match: {messages: [BreakerCommand]}, action: substitute, mode: '001'}, "
                 "{name: lie, match: {messages: [Area1]}, action: add, signal: OMEGA, "
                 "value: {distribution: random_walk, std: 0.5}}]")
        commands = "[{after_step: 8, mode: '111', lead_steps: 22}, {after_step: 15, mode: '100', lead_steps: 22}]"
        run = self.check(network_scenario("three_area"), ("static", "dynamic"),
                         # A command must not be late, which in the guest it is at 5 ms a step.
                         ("--set", f"attacks={rules}", "--set", f"network.commands={commands}",
                          *sets(period_s=0.005 * harness.PATIENCE)))
        modes, orders, records, signals = {}, [], [], []
        for channel, payload in harness.read_log(run.log):
            if channel == "PLANT_TRUTH":
                truth = holdfast.truth_t.decode(payload)
                modes[truth.step] = truth.mode
            elif channel == "CAN_COMMAND":
                message = holdfast.can_frames_t.decode(payload)
                orders += [(message.step, frame.data[0]) for frame in message.frames]
            elif channel == "ATTACK_FRAME":
                record = holdfast.attack_frame_t.decode(payload)
                if record.direction == record.TO_PLANT:
                    records.append((record.rule, record.step))
            elif channel == "ATTACK_SIGNAL":
                signal = holdfast.attack_signal_t.decode(payload)
                if signal.name == "rule/lie":
                    signals.append((signal.step, len(signal.value)))
        self.assertEqual(orders, [(20, 4), (30, 2), (37, 2)])
        self.assertEqual([modes[k] for k in (19, 20, 29, 30, 36, 37, 40)], [1, 4, 4, 2, 2, 2, 2])
        self.assertEqual(sorted(records), [("bend", 30), ("bend", 37), ("open", 2)])
        self.assertEqual(signals, [(k, 1) for k in range(1, 41)])
        self.assertEqual([w for w in run.review()["warnings"] if "command" in w], [])

    def test_canopen_nodes_that_wait_for_a_start_and_are_unplugged(self):
        """Heartbeats and inputs on the way to the driver, its NMT commands on the way back; delayed and forged frames."""
        rules = ("[{name: late, match: {messages: [Inputs2]}, window: {first_step: 10, last_step: 14}, action: delay, delay_steps: [1, 3]}, "
                 "{name: mask, match: {messages: [Life1]}, window: {first_step: 20, last_step: 25}, action: masquerade}]")
        run = self.check(network_scenario("binary_canopen"), ("secure", "trusting"), sets(
            attacks=rules, network__sensor_options__nodes_start_themselves="false",
            network__sensor_options__outages="[{sensor: node 2 input 1, first_step: 30, last_step: 33}]",
            # The NMT start must be back before the next step, also right after the processes began.
            period_s=0.04 * harness.PATIENCE))
        invalid = {}
        for channel, payload in harness.read_log(run.log):
            if channel == "MEASUREMENT":
                message = holdfast.measurement_set_t.decode(payload)
                self.assertEqual(message.num_packets + message.num_invalid, 16)
                if message.num_invalid:
                    invalid[message.step] = {(reading.source // 8, reading.reason) for reading in message.invalid}
        reason = holdfast.invalid_reading_t
        waiting, silent = reason.NOT_OPERATIONAL, reason.SILENT
        # Unplugged after its heartbeat of step 29, silent from the second step on, back in step 34 and started after it.
        self.assertEqual(invalid, {1: {(0, waiting), (1, waiting)}, 31: {(1, silent)}, 32: {(1, silent)}, 33: {(1, silent)},
                                   34: {(1, waiting)}})

    def test_an_attack_a_hundred_times_as_large_changes_no_estimate(self):
        """To the bit, though the signals are rounded: no mode looks at those that may be attacked."""
        def estimates(name, **values):
            run = harness.Run(self.path(name), *sets(steps=40, period_s=0.005, **values),
                              scenario=network_scenario("three_area"))
            self.addCleanup(run.link.close)
            self.assert_succeeds(run.finish())
            found = [holdfast.estimate_t.decode(payload) for channel, payload in harness.read_log(run.log)
                     if channel == "EST_STATIC"]
            self.assertEqual(len(found), 40)
            return [value for estimate in found for value in (*estimate.mean, *estimate.mode_probability)]

        lie = ("[{{name: lie, match: {{messages: [Area1]}}, action: add, signal: {}, "
               "value: {{distribution: waveform, waveform: sine, amplitude: {}, frequency_radps: 1}}}}]")
        plain = estimates("plain", attacks="[]")
        self.assertEqual(plain, estimates("plant", attacks="[]", plant__attack_gain=100))
        self.assertEqual(plain, estimates("bus", attacks=lie.format("OMEGA", 500)))
        # Negative control: a signal that no mode takes for attacked.
        control = estimates("control", attacks=lie.format("POWER", 0.5))
        self.assertGreater(max(abs(a - b) for a, b in zip(plain, control, strict=True)), 1e-3)

    def test_known_inputs_and_attack_locations(self):
        extra = [part for entry in ("plant.mode_changes.1.from_step=20", "plant.inputs.0.window.first_step=5")
                 for part in ("--set", entry)]
        self.check(network_scenario("attack_locations"), ("static", "flat", "dynamic"), extra)

    def test_smoothers_live_by_a_fixed_lag_and_over_the_whole_log(self):
        scenario = network_scenario("turning_target")
        small = sets(steps=40, period_s=0.005, estimators__mixture__smoother__lag_steps=5)
        if IS_SLOW:
            small += ["--set", "estimators=[{name: mixture, method: attack_mixture, assumes: {attack_probability: same}, "
                      "start: {mean: [200, 200, 15, 15], std: 10}, smoother: {lag_steps: 5}}]"]
        run = self.start(*small, scenario=scenario)
        self.assert_succeeds(run.finish())
        self.assert_succeeds(call("campaign", scenario, *small, "--log", self.path("campaign.lcm")))
        self.assert_equal_logs(run.log, self.path("campaign.lcm"))
        live = harness.read_log(run.log)
        self.assertEqual(sum(channel == "SMOOTHED_MIXTURE" for channel, _ in live), 40)
        self.assert_succeeds(call("smoother", run.log, "--out", self.path("smoothed.lcm")))
        for log in ("smoothed.lcm", "replay.lcm"):
            if log == "replay.lcm":
                self.assert_succeeds(call("estimator", "--log", run.log, "--out", self.path(log)))
            channels = "SMOOTHED_.*" if log == "smoothed.lcm" else "SMOOTHED_MIXTURE"
            self.assert_succeeds(call("review", "--compare", self.path(log), self.path("campaign.lcm"),
                                      "--channels", channels))
        # Negative control: a smoother that may look less far ahead says something else.
        self.assert_succeeds(call("smoother", run.log, "--name", "mixture", "--lag", "1",
                                  "--out", self.path("short.lcm")))
        self.assertEqual(call("review", "--compare", self.path("short.lcm"), self.path("campaign.lcm"),
                              "--channels", "SMOOTHED_MIXTURE")[0], 1)

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
