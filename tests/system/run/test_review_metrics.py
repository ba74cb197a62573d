"""The metrics of holdfast-review, computed a second time by numpy from the CSVs that it exports."""
import collections
import csv
import json
import os
import struct
import unittest

import numpy

import harness
from harness import RunTest, call, holdfast, read_log, sets

RUNS, STEPS, LAST_TENTH = 4, 60, 6
THRESHOLD, LOST_ABOVE = 0.4, 5.0
GROUPS = {"position": [0, 2], "velocity": [1, 3]}
# Both sides add up some hundred numbers in another order, and solve 4 x 4 systems by other methods.
RELATIVE = 1e-9
# Beyond this condition of a covariance the rounding of two methods differs by more. A particle filter that has lost
# its target ends with particles in one place: its NEES has no digits to compare.
CONDITION_MAX = 1e6


def event(channel, payload, utime):
    name = channel.encode()
    return b"\xed\xa1\xda\x01" + struct.pack(">qqII", 0, utime, len(name), len(payload)) + name + payload


def with_detector(log, seed):
    """Appends EST_DETECTOR, which gives what the particle filters do not: attack and mode probabilities, innovations."""
    generator = numpy.random.default_rng(seed)
    signals = collections.defaultdict(list)
    for channel, payload in read_log(log):
        if channel == "ATTACK_SIGNAL":
            signal = holdfast.attack_signal_t.decode(payload)
            signals[signal.step] += signal.value
    truths = [holdfast.truth_t.decode(payload) for channel, payload in read_log(log) if channel == "PLANT_TRUTH"]
    with open(log, "ab") as stream:
        for truth in truths:
            message = holdfast.estimate_t()
            message.utime, message.step, message.seq, message.input_step = truth.utime, truth.step, truth.step - 1, -1
            if truth.step % 13 == 0:
                message.attack_probability = -1.0  # no word on this step
            else:
                message.attack_probability = round(float(generator.random()), 2)  # has ties
            if truth.step > 1:  # says of each step's signals what they were, one step later
                message.input_step = truth.step - 1
                message.input_mean = generator.normal(signals[truth.step - 1]).tolist()
                message.num_inputs = len(message.input_mean)
                covariance = numpy.eye(message.num_inputs).flatten().tolist()
                message.num_input_covariance, message.input_covariance = len(covariance), covariance
            message.num_modes, message.mode_probability = 2, generator.dirichlet([1, 1]).tolist()
            covariance = numpy.cov(generator.normal(size=(4, 50)))
            message.num_states = 4
            message.mean = (numpy.array(truth.state) + generator.multivariate_normal(numpy.zeros(4), covariance)).tolist()
            message.num_covariance, message.covariance = 16, covariance.flatten().tolist()
            if truth.step % 7:
                S = numpy.cov(generator.normal(size=(3, 20)))
                message.num_innovation, message.innovation = 3, generator.normal(size=3).tolist()
                message.num_innovation_covariance, message.innovation_covariance = 9, S.flatten().tolist()
            stream.write(event("EST_DETECTOR", message.encode(), truth.utime))


class Table:
    """A CSV of the export, by column; arrays are gathered from name[0], name[1], ..."""

    def __init__(self, path):
        with open(path, newline="", encoding="utf-8") as stream:
            self.rows = list(csv.DictReader(stream))

    def numbers(self, column):
        return numpy.array([float(row[column]) for row in self.rows])

    def array(self, row, name):
        values = []
        while (cell := row.get(f"{name}[{len(values)}]")):
            values.append(float(cell))
        return numpy.array(values)


def area(positive, negative):
    """Share of pairs in order, ties one half, by comparing every pair."""
    difference = numpy.subtract.outer(positive, negative)
    return (numpy.count_nonzero(difference > 0) + 0.5 * numpy.count_nonzero(difference == 0)) / difference.size


class Run:
    """What one log says, read from its CSVs."""

    def __init__(self, folder):
        self.folder = folder
        truth = Table(os.path.join(folder, "PLANT_TRUTH.csv"))
        self.truth = {int(row["step"]): truth.array(row, "state") for row in truth.rows}
        self.mode = {int(row["step"]): int(row["mode"]) for row in truth.rows}
        attacks = Table(os.path.join(folder, "ATTACK_FRAME.csv"))
        signals = Table(os.path.join(folder, "ATTACK_SIGNAL.csv"))
        self.signals = collections.defaultdict(list)
        for row in signals.rows:
            self.signals[int(row["step"])].extend(signals.array(row, "value"))
        attacked = {int(row["step"]) for row in attacks.rows}
        attacked |= {int(row["step"]) for row in signals.rows if signals.array(row, "value").any()}
        self.is_attacked = numpy.array([step in attacked for step in range(1, STEPS + 1)])
        # The loop loses nothing: the nth frame that was sent is the nth that was read.
        self.attacked_frames = {int(row["tx_index"]) for row in attacks.rows if row["disposition"] != "1"}

    def estimates(self, name):
        table = Table(os.path.join(self.folder, f"EST_{name.upper()}.csv"))
        return table, {int(row["step"]): row for row in table.rows}


class Estimator:
    """Curves of one estimator over runs and steps, NaN where there is none."""

    def __init__(self, name, runs):
        shape = (len(runs), STEPS)
        self.runs = runs
        self.squares = {group: numpy.full(shape, numpy.nan) for group in GROUPS}
        self.nees, self.nis, self.attack, self.mode, self.signal = (numpy.full(shape, numpy.nan) for _ in range(5))
        self.scores = collections.defaultdict(list)
        self.has_nees = True
        for r, run in enumerate(runs):
            table, rows = run.estimates(name)
            for step, row in rows.items():
                self.add(r, step - 1, table, row, run)

    def add(self, r, k, table, row, run):
        error = table.array(row, "mean") - run.truth[k + 1]
        for group, states in GROUPS.items():
            self.squares[group][r, k] = numpy.sum(error[states] ** 2)
        covariance = table.array(row, "covariance")
        if covariance.size and numpy.linalg.cond(covariance.reshape(4, 4)) > CONDITION_MAX:
            self.has_nees = False
        elif covariance.size:
            self.nees[r, k] = error @ numpy.linalg.solve(covariance.reshape(4, 4), error)
        innovation = table.array(row, "innovation")
        if innovation.size:
            S = table.array(row, "innovation_covariance").reshape(innovation.size, -1)
            self.nis[r, k] = innovation @ numpy.linalg.solve(S, innovation)
        if float(row["attack_probability"]) >= 0:
            self.attack[r, k] = float(row["attack_probability"])
        modes = table.array(row, "mode_probability")
        if modes.size:
            self.mode[r, k] = numpy.argmax(modes) == run.mode[k + 1]
        if int(row["input_step"]) > 0:
            of_step = int(row["input_step"])
            self.signal[r, of_step - 1] = numpy.sum((table.array(row, "input_mean") - run.signals[of_step]) ** 2)
        for index, authentic in zip(table.array(row, "packet_rx_index"), table.array(row, "packet_probability")):
            self.scores[index in run.attacked_frames].append(1.0 - authentic)

    def metrics(self):
        """{(name, group): value} of everything that docs/metrics.md defines and these curves allow."""
        found = {}
        for group, squares in self.squares.items():
            over_time = numpy.sqrt(numpy.nanmean(squares, axis=1))
            over_runs = numpy.sqrt(numpy.nanmean(squares, axis=0))
            found["rmse_over_time", group] = over_time.mean()
            found["rmse_over_time_median", group] = numpy.median(over_time)
            found["rmse_step_mean", group] = over_runs.mean()
            found["rmse_step_median", group] = numpy.median(over_runs)
        last = numpy.sqrt(numpy.mean(self.squares["position"][:, -LAST_TENTH:], axis=1))
        found["lost_share", "position"] = numpy.mean(last > LOST_ABOVE)
        for name, curve in (("nees_mean", self.nees), ("nis_mean", self.nis), ("mode_accuracy", self.mode)):
            if not numpy.isnan(curve).all() and (self.has_nees or name != "nees_mean"):
                found[name, ""] = numpy.nanmean(curve, axis=1).mean()
        if not numpy.isnan(self.signal).all():
            found["attack_signal_rmse", ""] = numpy.sqrt(numpy.nanmean(self.signal, axis=1)).mean()
        if not numpy.isnan(self.attack).all():
            found.update(self.detection())
        if self.scores[True] and self.scores[False]:
            binned = [numpy.minimum(numpy.floor(numpy.array(self.scores[kind]) * 1000), 999) for kind in (True, False)]
            found["auc_packets", ""] = area(*binned)
        return found

    def detection(self):
        attacked = numpy.array([run.is_attacked for run in self.runs])
        known, alarm = ~numpy.isnan(self.attack), self.attack >= THRESHOLD
        attacks, delays = 0, []
        for r in range(len(self.runs)):
            edges = numpy.flatnonzero(numpy.diff(numpy.concatenate(([0], attacked[r].astype(int), [0]))))
            for first, end in edges.reshape(-1, 2):
                attacks += 1
                alarms = numpy.flatnonzero(alarm[r, first:end])
                delays += alarms[:1].tolist()
        return {("false_alarm_rate", ""): alarm[known & ~attacked].mean(),
                ("missed_detection_rate", ""): (~alarm[known & attacked]).mean(),
                ("attacks_detected", ""): len(delays) / attacks,
                ("detection_delay", ""): numpy.mean(delays),
                ("detection_delay_median", ""): numpy.median(delays),
                ("auc_steps", ""): area(self.attack[known & attacked], self.attack[known & ~attacked])}


class ReviewMetricsTest(RunTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        temporary = harness.tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.logs = [os.path.join(temporary.name, f"run{r}.lcm") for r in range(RUNS)]
        # Rare attacks, so that there are steps with and without.
        settings = sets(steps=STEPS, plant__attack__dos=0.01, plant__attack__deception=0.01,
                        attacks__flip__probability=0.02, campaign__detection_threshold=THRESHOLD,
                        state_groups__position__lost_above=LOST_ABOVE)
        for r, log in enumerate(cls.logs):
            status, _, errors = call("campaign", harness.TRACKING, *settings, "--log", log, "--run", str(r))
            assert status == 0, errors
            with_detector(log, seed=r + 1)
        cls.csv, cls.json = os.path.join(temporary.name, "csv"), os.path.join(temporary.name, "out.json")
        status, _, errors = call("review", *cls.logs, "--csv", cls.csv, "--json", cls.json)
        assert status == 0, errors
        with open(cls.json, encoding="utf-8") as stream:
            cls.review = json.load(stream)
        cls.runs = [Run(os.path.join(cls.csv, str(r + 1))) for r in range(RUNS)]
        cls.names = ("secure", "neglect", "uncorrupted", "DETECTOR")

    def told(self, estimators, name):
        """{(metric, group): value} of the JSON."""
        estimator = next(e for e in estimators if e["name"] == name)
        return {(m["name"], m.get("group", "")): m["value"] for m in estimator["metrics"]}

    def compare(self, told, ours):
        for key, value in ours.items():
            with self.subTest(metric=key):
                self.assertIn(key, told)
                self.assertLessEqual(abs(told[key] - value), RELATIVE * abs(value), (told[key], value))

    def test_there_is_something_to_compare(self):
        attacked = numpy.array([run.is_attacked for run in self.runs])
        self.assertTrue(0.1 < attacked.mean() < 0.9, attacked.mean())
        ours = Estimator("DETECTOR", self.runs).metrics()
        self.assertEqual(set(ours), {(name, group) for group in GROUPS for name in (
            "rmse_over_time", "rmse_over_time_median", "rmse_step_mean", "rmse_step_median")} | {
                ("lost_share", "position")} | {(name, "") for name in (
                    "nees_mean", "nis_mean", "mode_accuracy", "false_alarm_rate", "missed_detection_rate",
                    "attacks_detected", "detection_delay", "detection_delay_median", "auc_steps",
                    "attack_signal_rmse")})
        for name in ("false_alarm_rate", "missed_detection_rate", "attacks_detected", "auc_steps"):
            self.assertTrue(0.0 < ours[name, ""] < 1.0, name)
        self.assertTrue(0.5 < Estimator("secure", self.runs).metrics()["auc_packets", ""] < 1.0)
        for name in ("secure", "DETECTOR"):
            self.assertTrue(Estimator(name, self.runs).has_nees, name)
        self.assertTrue(0.0 < Estimator("neglect", self.runs).metrics()["lost_share", "position"])

    def test_several_runs(self):
        for name in self.names:
            with self.subTest(estimator=name):
                self.compare(self.told(self.review["combined"][0]["estimators"], name),
                             Estimator(name, self.runs).metrics())

    def test_each_run(self):
        for r in range(RUNS):
            log = self.review["logs"][r]
            self.assertEqual(log["attacked_steps"], int(self.runs[r].is_attacked.sum()))
            for name in self.names:
                with self.subTest(run=r, estimator=name):
                    ours = Estimator(name, [self.runs[r]]).metrics()
                    self.compare(self.told(log["estimators"], name), ours)
                    estimator = next(e for e in log["estimators"] if e["name"] == name)
                    for group in GROUPS:
                        told, value = estimator["rmse"][group]["value"], ours["rmse_over_time", group]
                        self.assertLessEqual(abs(told - value), RELATIVE * value)

    def test_standard_errors_and_differences(self):
        combined = self.review["combined"][0]
        secure, neglect = (Estimator(name, self.runs) for name in ("secure", "neglect"))
        told = {(m["name"], m.get("group", "")): m for m in combined["estimators"][0]["metrics"]}
        over_time = numpy.sqrt(secure.squares["position"].mean(axis=1))
        expected = over_time.std(ddof=1) / numpy.sqrt(RUNS)
        self.assertLessEqual(abs(told["rmse_over_time", "position"]["standard_error"] - expected), RELATIVE * expected)
        difference = next(d for d in combined["differences"]
                          if (d["estimator"], d["group"]) == ("neglect", "position"))
        self.assertEqual((difference["reference"], difference["name"]), ("secure", "rmse_step_mean"))
        expected = (neglect.metrics()["rmse_step_mean", "position"] - secure.metrics()["rmse_step_mean", "position"])
        self.assertLessEqual(abs(difference["value"] - expected), RELATIVE * abs(expected))
        self.assertGreater(difference["standard_error"], 0.0)

    def test_one_digit_less_would_be_seen(self):
        """Negative control: the same numbers from truths rounded to single precision do not agree."""
        run = Run(os.path.join(self.csv, "1"))
        run.truth = {step: numpy.float32(state).astype(float) for step, state in run.truth.items()}
        told = self.told(self.review["logs"][0]["estimators"], "secure")["rmse_over_time", "position"]
        value = Estimator("secure", [run]).metrics()["rmse_over_time", "position"]
        self.assertGreater(abs(told - value), RELATIVE * value)


if __name__ == "__main__":
    unittest.main(verbosity=2)
