"""A frame that somebody sends into the monitor bus in mid-run is labelled foreign and shifts no other label."""
import csv
import os
import struct
import subprocess
import unittest

import can
import harness
import holdfast
from harness import RunTest, call, sets

STEPS = 60


class ForeignTest(RunTest):
    def send(self, run, identifier, payloads):
        """All of them at once: a process for each would fall behind the run on a slow machine."""
        if harness.BUS == "vcan":
            bus = run.monitor_bus.split(":")[1]
            subprocess.run(["cansend", bus, f"{identifier:03X}#{payloads[0].hex()}"], check=True)
            lines = "".join(f"(0.000000) {bus} {identifier:03X}#{data.hex()}\n" for data in payloads[1:])
            subprocess.run(["canplayer", "-t", f"{bus}={bus}"], input=lines, text=True, check=True)
            return
        _, group, port = run.monitor_bus.split(":")
        with can.Bus(interface="udp_multicast", channel=group, port=int(port)) as bus:
            for data in payloads:
                bus.send(can.Message(arbitration_id=identifier, is_extended_id=False, data=data))

    def labels(self, log):
        """[(step, source, value, label)] of every packet."""
        path = self.path("labels.csv")
        self.assert_succeeds(call("review", log, "--labels", path))
        with open(path, encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        return [(row["step"], row["source"], row["label"]) for row in rows]

    def test_foreign_frames_shift_no_label(self):
        options = sets(steps=STEPS, period_s=0.03 * harness.PATIENCE)
        run = self.start(*options)
        # Counters of many steps to come, so that one of them is right when the frame arrives.
        run.wait_for_step(10)
        self.send(run, 0x105, [bytes([1]) + struct.pack("<H", step) for step in range(11, STEPS)])
        self.assert_succeeds(run.finish())
        foreign = [label for label in self.labels(run.log) if label[2] == "foreign"]
        self.assertGreaterEqual(len(foreign), 1)
        self.assertTrue(all(label[1] == "4" for label in foreign))

        calm = harness.Run(self.path("calm"), *options)
        self.addCleanup(calm.link.close)
        self.assert_succeeds(calm.finish())
        self.assertEqual([label for label in self.labels(run.log) if label[2] != "foreign"], self.labels(calm.log))

    def test_the_plant_obeys_commands_from_outside_and_counts_what_it_cannot_do(self):
        scenario = os.path.join(harness.SOURCE, "scenarios", "three_area.yaml")
        run = self.start(*sets(steps=STEPS, period_s=0.03 * harness.PATIENCE, attacks="[]"), scenario=scenario)
        run.wait_for_step(10)
        orders = [struct.pack("<BI", 3, 40), struct.pack("<BI", 2, 3), struct.pack("<BI", 200, 45), b"\x01"]
        self.send(run, 0x040, orders)
        self.assert_succeeds(run.finish())
        modes = {truth.step: truth.mode for truth in (
            holdfast.truth_t.decode(payload) for channel, payload in harness.read_log(run.log) if channel == "PLANT_TRUTH")}
        changes = [step for step in range(2, STEPS + 1) if modes[step] != modes[step - 1]]
        self.assertEqual([modes[step] for step in changes], [2, 3])
        self.assertEqual(changes[1], 40)
        self.assertGreater(changes[0], 10)  # too late for step 3, so at the next step
        plant = next(process for process in run.review()["processes"] if process["name"] == "plant")
        counters = plant["counters"]
        self.assertEqual([counters[name] for name in ("commands", "late_commands", "refused_commands")], [4, 1, 2])
        warnings = " ".join(run.review()["warnings"])
        self.assertIn("refused 2 commands", warnings)
        self.assertIn("1 commands came after the step", warnings)


if __name__ == "__main__":
    unittest.main(verbosity=2)
