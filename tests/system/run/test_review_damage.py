"""holdfast-review reads what is left of a run's log, says what is gone, and never takes much memory."""
import json
import os
import re
import resource
import struct
import subprocess
import unittest

import harness
from harness import RunTest, call, holdfast, sets

SYNC = b"\xed\xa1\xda\x01"
STEPS = 40
# Of the file's size, beyond what a small log takes. Measured: 2.3 of a run's log (2.9 with a report), 6 of hostile
# ones; a third above that for other libraries.
RUN_FACTOR, HOSTILE_FACTOR, BASE_BYTES = 4, 8, 32 << 20
# What the values of a scenario take at most, however small the log; half as much was measured.
SCENARIO_BYTES = 100 << 20


def event(channel, payload, utime=0, number=0):
    name = channel.encode()
    return SYNC + struct.pack(">qqII", number, utime, len(name), len(payload)) + name + payload


def events(data):
    """[(start, channel)] of a whole log."""
    found, at = [], 0
    while at < len(data):
        channel_bytes, data_bytes = struct.unpack_from(">II", data, at + 20)
        found.append((at, data[at + 28:at + 28 + channel_bytes].decode()))
        at += 28 + channel_bytes + data_bytes
    return found


def is_sanitised():
    """True for a build whose memory is the sanitiser's more than the program's."""
    with open(harness.program("review"), "rb") as stream:
        program = stream.read()
    return b"__asan_init" in program or b"__tsan_init" in program


class ReviewDamageTest(RunTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.log_folder = harness.tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.log_folder.cleanup)
        whole = os.path.join(cls.log_folder.name, "whole.lcm")
        status, _, errors = call("campaign", harness.TRACKING, *sets(steps=STEPS), "--log", whole)
        assert status == 0, errors
        with open(whole, "rb") as stream:
            cls.data = stream.read()
        cls.places = events(cls.data)

    def write(self, name, data):
        with open(self.path(name), "wb") as stream:
            stream.write(data)
        return self.path(name)

    def review(self, name, data):
        """(JSON, table) of a log with these bytes; every output is asked for and must come."""
        log = self.write(name, data)
        table = self.assert_succeeds(call("review", log, "--json", self.path("out.json"), "--csv", self.path("csv"),
                                          "--report", self.path("out.html")))
        with open(self.path("out.json"), encoding="utf-8") as stream:
            review = json.load(stream)
        self.assertTrue(os.path.exists(self.path("csv/PLANT_TRUTH.csv")))
        self.assertTrue(os.path.exists(self.path("out.html")))
        return review, table

    def start_of(self, channel, nth):
        return [at for at, name in self.places if name == channel][nth]

    def secure(self, review):
        return next(e for e in review["estimators"] if e["name"] == "secure")

    def test_a_whole_log_is_not_called_damaged(self):
        review, table = self.review("whole.lcm", self.data)
        self.assertEqual((review["log"]["damaged_bytes"], review["log"]["tail_is_torn"]), (0, False))
        self.assertEqual(review["log"]["backward_log_times"], 0)
        self.assertEqual(self.secure(review)["steps"], STEPS)
        self.assertEqual(review["warnings"], [])
        self.assertNotIn("WARNING", table)

    def test_torn_tail(self):
        for missing in (1, 27, len(self.data) - self.start_of("PLANT_TRUTH", STEPS - 1) - 5):
            review, table = self.review("torn.lcm", self.data[:-missing])
            self.assertTrue(review["log"]["tail_is_torn"])
            self.assertGreaterEqual(self.secure(review)["steps"], STEPS - 1)
            self.assertIn("ends in the middle of an event", table)

    def test_flipped_bytes_in_the_middle(self):
        start = self.start_of("EST_SECURE", STEPS // 2)
        # Sync word, channel length, data length (low and high byte), name, fingerprint, a length inside.
        for offset in (0, 23, 26, 25, 30, 40, 28 + 10 + 8 + 32 + 4 + 8 + 1):
            data = bytearray(self.data)
            data[start + offset] ^= 0x10
            review, table = self.review("flipped.lcm", bytes(data))
            with self.subTest(offset=offset):
                self.assertEqual(self.secure(review)["steps"], STEPS - 1)
                self.assertEqual(review["truth_steps"], STEPS)
                told = (review["log"]["damaged_bytes"] > 0 or review["log"]["refused_in_log"] > 0
                        or list(review["log"]["foreign_channels"].values()) == [1])
                self.assertTrue(told)
                self.assertIn("secure: 1 steps without an estimate", table)

    def test_garbage_between_events_is_counted_to_the_byte(self):
        start = self.start_of("PLANT_TRUTH", 5)
        garbage = b"\xed" * 7 + SYNC + b"\xff" * 50
        review, table = self.review("garbage.lcm", self.data[:start] + garbage + self.data[start:])
        self.assertEqual(review["log"]["damaged_bytes"], len(garbage))
        self.assertEqual(self.secure(review)["steps"], STEPS)
        self.assertIn("bytes of the log are damaged", table)

    def test_foreign_channels(self):
        start = self.start_of("PLANT_TRUTH", 3)
        foreign = b"".join(event(channel, payload, utime=3_000_000) for channel, payload in (
            ("LCM_SELF_TEST", b"lcm self test"), ("../../outside", b"\0\1"), ("\x1b[31m", b"")))
        review, table = self.review("foreign.lcm", self.data[:start] + foreign + self.data[start:])
        self.assertEqual(review["log"]["damaged_bytes"], 0)
        self.assertEqual(review["warnings"], [])
        self.assertEqual(review["log"]["foreign_channels"], {"LCM_SELF_TEST": 1, "../../outside": 1, "\x1b[31m": 1})
        self.assertIn("3 events on 3 channels that are none of ours", table)
        self.assertNotIn("\x1b", table)
        with open(self.path("csv/LCM_SELF_TEST.csv"), encoding="ascii") as stream:
            self.assertIn("0x" + b"lcm self test".hex(), stream.read())
        self.assertIn("%2E%2E%2F%2E%2E%2Foutside.csv", os.listdir(self.path("csv")))
        self.assertFalse(os.path.exists(self.path("outside.csv")))

    def test_time_that_goes_back(self):
        start = self.start_of("PLANT_TRUTH", 10)
        data = bytearray(self.data)
        struct.pack_into(">q", data, start + 12, -5)
        review, table = self.review("backward.lcm", bytes(data))
        self.assertEqual(review["log"]["backward_log_times"], 1)
        self.assertEqual(self.secure(review)["steps"], STEPS)
        self.assertIn("WARNING the log's time goes back 1 times", table)

    def test_everything_at_once(self):
        data = bytearray(self.data)
        data[self.start_of("EST_NEGLECT", 7)] ^= 1
        struct.pack_into(">q", data, self.start_of("PLANT_TRUTH", 20) + 12, 0)
        data += event("LCM_SELF_TEST", b"x", utime=10**15) + event("EST_SECURE", b"\xff" * 500, utime=10**15)
        review, _ = self.review("all.lcm", bytes(data[:-3]))
        self.assertTrue(review["log"]["tail_is_torn"])
        self.assertGreater(review["log"]["damaged_bytes"], 0)
        self.assertEqual(review["log"]["backward_log_times"], 1)
        self.assertEqual(self.secure(review)["steps"], STEPS)

    def test_a_log_without_a_scenario_is_wrong_use(self):
        status, _, errors = call("review", self.write("none.lcm", self.data[self.places[1][0]:]))
        self.assertEqual(status, 2)
        self.assertIn("RUN_META", errors)

    def test_a_folder_stands_for_the_log_in_it(self):
        by_log = self.assert_succeeds(call("review", self.write("log.lcm", self.data)))
        self.assertEqual(self.assert_succeeds(call("review", self.folder)).splitlines()[1:], by_log.splitlines()[1:])
        os.remove(self.path("log.lcm"))
        status, _, errors = call("review", self.folder)
        self.assertEqual(status, 2)
        self.assertIn("a folder without log.lcm", errors)

    # Memory.

    def peak_bytes_and_status(self, *arguments):
        """Largest resident size of a review, and its exit status."""
        with open(os.devnull, "w", encoding="ascii") as sink:
            process = subprocess.Popen([harness.program("review"), *arguments], stdout=sink, stderr=sink)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        return usage.ru_maxrss * 1024, process.returncode

    def peak_bytes(self, log, *arguments):
        """Largest resident size of a review, which must succeed."""
        peak, status = self.peak_bytes_and_status(log, *arguments)
        self.assertEqual(status, 0)
        return peak

    def check_memory(self, log, factor):
        allowed = factor * os.path.getsize(log) + BASE_BYTES
        for arguments in ((), ("--csv", self.path("csv")), ("--report", self.path("out.html")),
                          ("--json", self.path("out.json"))):
            with self.subTest(log=os.path.basename(log), arguments=arguments[:1]):
                self.assertLess(self.peak_bytes(log, *arguments), allowed)

    @unittest.skipIf(is_sanitised(), "a sanitiser takes memory of its own")
    def test_memory_of_a_long_run(self):
        log = self.path("long.lcm")
        few = [part for name in ("secure", "neglect", "uncorrupted")
               for part in ("--set", f"estimators.{name}.particles=10")]
        self.assert_succeeds(call("campaign", harness.TRACKING, *sets(steps=12000), *few, "--log", log))
        self.assertGreater(os.path.getsize(log), 50_000_000)
        self.check_memory(log, RUN_FACTOR)
        # The bound means something: half the file's size would not do.
        self.assertGreater(self.peak_bytes(log), os.path.getsize(log) // 2)

    @unittest.skipIf(is_sanitised(), "a sanitiser takes memory of its own")
    def test_memory_of_hostile_logs(self):
        size = 4_000_000
        meta = holdfast.run_meta_t()
        meta.name = "hostile"
        meta.scenario = ("steps: 1000000000000\nstate_groups: [{name: position, states: [0, 1]}]\n"
                         "estimators: [{name: secure}]\n")
        truth, estimate, status = holdfast.truth_t(), holdfast.estimate_t(), holdfast.status_t()
        truth.num_states, truth.state = 2, [0.0, 0.0]
        hypothesis = holdfast.hypothesis_t()

        def truth_at(step):
            truth.step = step
            return truth.encode()

        def estimate_at(step, num_states=2, num_hypotheses=0):
            estimate.step, estimate.num_states, estimate.mean = step, num_states, [0.0] * num_states
            estimate.num_hypotheses, estimate.hypotheses = num_hypotheses, [hypothesis] * num_hypotheses
            return estimate.encode()

        makers = {
            "estimators": lambda i: event(f"EST_{i}", estimate_at(i)),
            "refused": lambda i: event(f"EST_{i}", b"x"),
            "processes": lambda i: event(f"STATUS_{i}", status.encode()),
            "steps": lambda i: event("PLANT_TRUTH", truth_at(i * 1000003)),
            "both": lambda i: event("PLANT_TRUTH", truth_at(i)) + event(f"EST_{i % 2000}", estimate_at(i)),
            "one_state_vector": lambda i: event("EST_A", estimate_at(i, num_states=size // 16)),
            "hypotheses": lambda i: event("EST_A", estimate_at(i, num_hypotheses=size // 50)),
            "raw": lambda i: event(f"CHANNEL_{i}", b""),
            "lengths": lambda i: SYNC + struct.pack(">qqII", i, 0, 5, (i * 7919) % size) + b"EST_A",
            "sync": lambda i: SYNC * 250,
        }
        for name, make in makers.items():
            parts, length = [event("RUN_META", meta.encode()), event("PLANT_TRUTH", truth_at(1))], 0
            while length < size:
                parts.append(make(len(parts)))
                length += len(parts[-1])
            self.check_memory(self.write(name + ".lcm", b"".join(parts)), HOSTILE_FACTOR)

    @unittest.skipIf(is_sanitised(), "a sanitiser takes memory of its own")
    def test_memory_of_hostile_scenarios(self):
        # Lists of maps once took from 200 MB to 10 GB, in a log of 50 kB; a million values half a gigabyte.
        log = self.write("own.lcm", self.data)
        payload = next(payload for channel, payload in harness.read_log(log) if channel == "RUN_META")
        own = holdfast.run_meta_t.decode(payload).scenario
        hostile = {"estimators": "{}," * 16000, "state_groups": "{}," * 16000, "attacks": "{}," * 16000,
                   "state_names": "a," * 45000, "unknown": "[]," * 45000, "too_many": "a," * 1000000,
                   "nested": "[" + "a," * 1000000 + "]", "aliased": "&a " + "b" * 100000 + ",*a" * 20000}
        refused = ("too_many", "nested", "aliased")
        for key, items in hostile.items():
            meta = holdfast.run_meta_t()
            meta.name = "hostile"
            kept = [part for part in re.split(r"(?m)^(?=[a-z])", own) if not part.startswith(key + ":")]
            meta.scenario = "".join(kept) + f"{key}: [{items}]\n"
            self.assertNotEqual(meta.scenario, own)
            log = self.write(key + ".lcm", event("RUN_META", meta.encode()) + self.data)
            allowed = HOSTILE_FACTOR * os.path.getsize(log) + BASE_BYTES + SCENARIO_BYTES
            review_status = 2 if key in refused else 0
            for arguments, expected in (((log,), review_status), (("--compare", log, log), 0)):
                with self.subTest(key=key, arguments=arguments[0]):
                    peak, status = self.peak_bytes_and_status(*arguments)
                    self.assertEqual(status, expected)
                    self.assertLess(peak, allowed)

    @unittest.skipIf(is_sanitised(), "a sanitiser takes memory of its own")
    def test_a_limit_on_the_address_space_is_enough(self):
        log = self.write("limited.lcm", self.data)
        limit = 256 << 20
        done = subprocess.run([harness.program("review"), log], capture_output=True, timeout=60 * harness.PATIENCE,
                              preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)), check=False)
        self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
