"""One campaign, one aggregate: whatever the threads, processes, shards and interruptions."""
import json
import os
import random
import sqlite3
import subprocess
import sys
import tempfile
import time
import unittest

BIN = os.path.join(os.environ["HOLDFAST_BINARY_DIR"], "bin")
SCENARIO = os.path.join(os.environ["HOLDFAST_SOURCE_DIR"], "scenarios", "binary_tracking.yaml")
CAMPAIGN = os.path.join(BIN, "holdfast-campaign")
RUNS = 60
SWEEP = ["--sweep", "attacks.flip.probability=0,0.2", "--set", "steps=20"]
HAS_MPI = os.environ["HOLDFAST_HAS_MPI"] == "1"


def mpirun(num, *command):
    # One machine, any user, more processes than processors, no network but shared memory.
    return ["mpirun", "--allow-run-as-root", "--oversubscribe", "--mca", "btl", "self,vader", "--mca", "pml", "ob1",
            "--mca", "plm", "isolated", "-n", str(num), *command]


class CampaignTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def read(self, name):
        with open(self.path(name), "rb") as stream:
            return stream.read()

    def call(self, *command, status=0):
        done = subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=self.folder.name)
        self.assertEqual(done.returncode, status, done.stdout + done.stderr)
        return done

    def aggregate(self, name, *arguments, before=()):
        """Runs the campaign into a file of its own; returns the bytes of its aggregate."""
        self.call(*before, CAMPAIGN, SCENARIO, *SWEEP, "--runs", str(RUNS), "--out", self.path(name + ".sqlite"),
                  "--json", self.path(name + ".json"), *arguments)
        return self.read(name + ".json")

    def test_threads_processes_and_shards(self):
        one = self.aggregate("one", "--threads", "1")
        self.assertIn(b'"rmse_step_mean"', one)
        self.assertEqual(one, self.aggregate("two", "--threads", "2"))
        for num in (1, 2, 3) if HAS_MPI else ():
            self.assertEqual(one, self.aggregate(f"mpi{num}", before=mpirun(num)), f"mpirun -n {num}")
        shards = []
        for i in (1, 2):
            self.aggregate(f"shard{i}", "--shard", f"{i}/2")
            shards.append(self.path(f"shard{i}.sqlite"))
        self.call(CAMPAIGN, "--merge", *shards, "--out", self.path("all.sqlite"), "--json", self.path("all.json"))
        self.assertEqual(one, self.read("all.json"))
        # Negative control: half of the runs is another aggregate.
        self.assertNotEqual(one, self.read("shard1.json"))

    def test_killed_ten_times(self):
        # Long enough, on one thread, for several commits between two kills.
        long = [*SWEEP, "--runs", "500", "--threads", "1"]
        started = time.monotonic()
        self.call(CAMPAIGN, SCENARIO, *long, "--out", ":memory:", "--json", self.path("whole.json"))
        duration = time.monotonic() - started
        command = [CAMPAIGN, SCENARIO, *long, "--out", self.path("killed.sqlite"), "--json", self.path("killed.json")]
        moments = random.Random(1)
        counts = []
        for _ in range(10):
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=self.folder.name)
            with self.assertRaises(subprocess.TimeoutExpired, msg="it was done before it could be killed"):
                process.wait(timeout=moments.uniform(0.0, 0.15 * duration))
            process.kill()
            process.wait()
            counts.append(self.num_runs("killed.sqlite"))
        self.assertEqual(counts, sorted(counts), "no run that was stored is lost")
        self.assertGreater(len(set(counts)), 3, "the kills came at different states")
        self.assertLess(counts[-1], 1000)
        self.call(*command)
        self.assertEqual(self.read("whole.json"), self.read("killed.json"))
        self.assertEqual(self.num_runs("killed.sqlite"), 1000)

    def test_stopped_by_a_signal(self):
        command = [CAMPAIGN, SCENARIO, "--runs", "3000", "--out", self.path("stopped.sqlite")]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 60
        while self.num_runs_or_busy("stopped.sqlite") == 0:
            self.assertLess(time.monotonic(), deadline)
            self.assertIsNone(process.poll())
        process.terminate()
        errors = process.communicate(timeout=60)[1]
        self.assertEqual(process.returncode, 1, errors)
        self.assertIn("goes on", errors)
        self.assertGreater(self.num_runs("stopped.sqlite"), 0)

    def num_runs_or_busy(self, name):
        """1 once the writer holds a file with runs in it, which locks it: its empty tables take a quarter of this."""
        return int(os.path.exists(self.path(name)) and os.path.getsize(self.path(name)) > 1_000_000)

    def num_runs(self, name):
        if not os.path.exists(self.path(name)) or os.path.getsize(self.path(name)) == 0:
            return 0
        database = sqlite3.connect(self.path(name))
        try:
            tables = database.execute("SELECT count(*) FROM sqlite_master WHERE name = 'runs'").fetchone()[0]
            return database.execute("SELECT count(*) FROM runs").fetchone()[0] if tables else 0
        finally:
            database.close()

    def test_goes_on_with_more_runs(self):
        file = self.path("grown.sqlite")
        command = [CAMPAIGN, SCENARIO, *SWEEP, "--out", file, "--json", self.path("grown.json")]
        self.call(*command, "--runs", "20")
        self.call(*command, "--runs", str(RUNS))
        grown = self.read("grown.json")
        self.assertEqual(grown, self.aggregate("fresh"))

    @unittest.skipUnless(HAS_MPI, "this build has no MPI")
    def test_a_failing_process_ends_all(self):
        done = self.call(*mpirun(2), CAMPAIGN, SCENARIO, "--set", "steps=-1", status=2)
        self.assertEqual(done.stderr.count("steps: -1"), 1, done.stderr)

    @unittest.skipUnless(HAS_MPI, "this build has no MPI")
    def test_work_for_one_process_is_refused_to_many(self):
        for arguments in (["--merge", "a", "--out", "b"], [SCENARIO, "--log", "c"]):
            done = self.call(*mpirun(2), CAMPAIGN, *arguments, status=2)
            self.assertIn("without mpirun", done.stderr)

    def test_wrong_use(self):
        for arguments, word in ((["--shard", "3/2"], "--shard"), (["--sweep", "steps"], "--sweep"), (["--runs", "0"], "--runs"),
                                (["--sweep", "nowhere=1"], "nowhere"), (["--merge", "a"], "excludes")):
            done = self.call(CAMPAIGN, SCENARIO, *arguments, status=2)
            self.assertIn(word, done.stderr)
        self.call(CAMPAIGN, "--merge", SCENARIO, "--out", self.path("x"), status=2)
        with open(self.path("text"), "w", encoding="utf-8") as stream:
            stream.write("no results file, but long enough to be looked at twice by whoever opens it. " * 20)
        done = self.call(CAMPAIGN, SCENARIO, "--out", self.path("text"), status=2)
        self.assertIn("not SQLite", done.stderr)
        for option in ("--out", "--json", "--csv"):
            done = self.call(CAMPAIGN, SCENARIO, option, self.path("nowhere/x"), status=2)
            self.assertIn("no folder", done.stderr)

    def test_another_programs_database_is_left_alone(self):
        database = sqlite3.connect(self.path("other.sqlite"))
        database.execute("CREATE TABLE meta(x)")
        database.commit()
        database.close()
        before = self.read("other.sqlite")
        done = self.call(CAMPAIGN, SCENARIO, "--runs", "1", "--out", self.path("other.sqlite"), status=2)
        self.assertIn("another program", done.stderr)
        self.assertEqual(before, self.read("other.sqlite"))

    def test_a_shard_without_a_run_is_no_failure(self):
        command = [CAMPAIGN, SCENARIO, "--runs", "2", "--set", "steps=5"]
        for i in (1, 2, 3):
            done = self.call(*command, "--shard", f"{i}/3", "--out", self.path(f"{i}.sqlite"))
            self.assertEqual("no run for this shard" in done.stdout, i == 3)
        self.call(CAMPAIGN, "--merge", *(self.path(f"{i}.sqlite") for i in (1, 2, 3)), "--out", self.path("all.sqlite"))
        self.call(*command, "--out", self.path("whole.sqlite"))
        review = os.path.join(BIN, "holdfast-review")
        self.call(review, "--compare", self.path("all.sqlite"), self.path("whole.sqlite"))
        self.call(*command, "--set", "seed=2", "--out", self.path("seed2.sqlite"))
        self.call(review, "--compare", self.path("all.sqlite"), self.path("seed2.sqlite"), status=1)
        self.assertEqual([name for name in os.listdir(self.folder.name) if "journal" in name or "part" in name], [])

    def test_json_to_standard_output(self):
        done = self.call(CAMPAIGN, SCENARIO, "--runs", "2", "--set", "steps=5", "--out", self.path("x.sqlite"), "--json", "-")
        self.assertEqual(json.loads(done.stdout)["points"][0]["runs"], 2)

    def test_another_campaign_is_refused(self):
        self.aggregate("mine")
        done = self.call(CAMPAIGN, SCENARIO, "--set", "steps=10", "--out", self.path("mine.sqlite"), status=2)
        self.assertIn("another campaign", done.stderr)


if __name__ == "__main__":
    sys.exit(unittest.main(verbosity=2))
