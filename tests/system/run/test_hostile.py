"""Hostile datagrams and frames leave every process alive and every genuine packet in its right set."""
import os
import random
import struct
import threading
import unittest

import can
import harness
import holdfast
from harness import RunTest, call, sets

STEPS = 60


def hostile_payloads(message_type, rng):
    """Payloads that a decoder must survive: the issue's list."""
    fingerprint = message_type._get_packed_fingerprint()
    yield b""
    yield b"\x00" * 7
    yield fingerprint                                            # truncated at once
    yield struct.pack(">q", 0x0123456789ABCDEF) + b"\x00" * 64   # wrong fingerprint
    for length in (-1, -2**31, 2_000_000_000, 536_870_912, 2**31 - 1, 65_536):
        yield fingerprint + struct.pack(">qqq", 0, 0, 1) + struct.pack(">i", length) * 8
    whole = message_type().encode()
    yield whole[:-1]
    yield whole + b"\x00"
    yield fingerprint + bytes(rng.randrange(256) for _ in range(rng.randrange(1, 400)))


class HostileTest(RunTest):
    def open_can(self, url):
        if harness.BUS == "vcan":
            bus = can.Bus(interface="socketcan", channel=url.split(":")[1], fd=True)
        else:
            _, group, port = url.split(":")
            bus = can.Bus(interface="udp_multicast", channel=group, port=int(port), fd=True)
        self.addCleanup(bus.shutdown)
        return bus

    def send_frames(self, monitor, sensor, step, sensor_id=0x105):
        """Everything that a genuine driver must refuse; forged counters are far from any step of the run."""
        forged = [can.Message(arbitration_id=0x101 + i, is_extended_id=False,
                              data=[1] + list(struct.pack("<H", 30000 + step + i))) for i in range(10)]
        frames = forged + [
            can.Message(arbitration_id=sensor_id, is_extended_id=False, data=[1]),                     # wrong DLC
            can.Message(arbitration_id=sensor_id, is_extended_id=False, data=[1] * 8),
            can.Message(arbitration_id=sensor_id, is_extended_id=True, data=[1, 1, 0]),                # unknown id
            can.Message(arbitration_id=0x555, is_extended_id=False, data=[1, 2, 3]),
            can.Message(arbitration_id=sensor_id, is_extended_id=False, is_fd=True, data=[1, 1, 0]),   # FD
            can.Message(arbitration_id=sensor_id, is_extended_id=False, is_remote_frame=True, dlc=3),
            can.Message(arbitration_id=0x7F0, is_extended_id=False, data=struct.pack("<I", 90000)),    # forged tick
            can.Message(arbitration_id=0x7F0, is_extended_id=False, data=[1]),
            can.Message(arbitration_id=0x110, is_extended_id=False, data=struct.pack("<fH", float("nan"), 1)),
            can.Message(arbitration_id=0x110, is_extended_id=False, data=struct.pack("<fH", float("-inf"), 1)),
        ]
        for frame in frames:
            monitor.send(frame)
        # On the sensor side, identifiers of no sensor: those of a sensor would take part in its draws.
        for frame in frames[12:14] + frames[16:18]:
            sensor.send(frame)

    def attack(self, run, stop):
        rng = random.Random(1)
        types = {"MEASUREMENT": holdfast.measurement_set_t, "STATUS_DRIVER": holdfast.status_t,
                 "STATUS_SECURE": holdfast.status_t, "STATUS_PLANT": holdfast.status_t,
                 "EST_SECURE": holdfast.estimate_t, "CAN_RX": holdfast.can_frames_t,
                 "TIMING_SECURE": holdfast.timing_t, "PLANT_TRUTH": holdfast.truth_t}
        monitor, sensor = self.open_can(run.monitor_bus), self.open_can(run.sensor_bus)
        self.rounds = 0
        while not stop.is_set():
            for channel, message_type in types.items():
                for payload in hostile_payloads(message_type, rng):
                    run.link.publish(channel, payload)
            self.send_frames(monitor, sensor, self.rounds)
            if harness.BUS == "udp":
                group, port = run.monitor_bus.split(":")[1:]
                for junk in (b"", b"\xc1", b"\xdf\xff\xff\xff\xff", b"\x81\xa4data\xc6\xff\xff\xff\xff", os.urandom(64)):
                    run.link.sender.sendto(junk, (group, int(port)))
            self.rounds += 1
            stop.wait(0.05 * harness.PATIENCE)

    def scenario_with_a_float(self):
        """The tracking scenario, but the sixteenth sensor sends its bit as a float32."""
        with open(os.path.join(harness.SOURCE, "scenarios", "binary_sensors.dbc"), encoding="utf-8") as stream:
            dbc = stream.read()
        head, message, tail = dbc.partition("BO_ 272 Sensor16: 3")
        self.assertTrue(message)
        tail = tail.replace("DETECT : 0|1@1+", "DETECT : 0|32@1-", 1).replace("STEP : 8|16@1+", "STEP : 32|16@1+", 1)
        with open(self.path("float.dbc"), "w", encoding="utf-8") as stream:
            stream.write(head + "BO_ 272 Sensor16: 6" + tail + "\nSIG_VALTYPE_ 272 DETECT : 1;\n")
        with open(harness.TRACKING, encoding="utf-8") as stream:
            text = stream.read().replace("binary_sensors.dbc", "float.dbc")
        # A float has no lowest bit to flip: its frames stay as they are.
        text = text.replace("Sensor15, Sensor16]}", "Sensor15]}")
        with open(self.path("float.yaml"), "w", encoding="utf-8") as stream:
            stream.write(text)
        return self.path("float.yaml")

    def test_every_genuine_packet_stays_in_its_set(self):
        options = sets(steps=STEPS, period_s=0.03 * harness.PATIENCE)
        scenario = self.scenario_with_a_float()
        run = self.start(*options, scenario=scenario)
        run.wait_for_step(3)
        stop = threading.Event()
        attack = threading.Thread(target=self.attack, args=(run, stop))
        attack.start()
        try:
            result = run.finish()
        finally:
            stop.set()
            attack.join()
        output = self.assert_succeeds(result)
        self.assertGreater(self.rounds, 3)

        self.assert_succeeds(call("campaign", scenario, *options, "--log", self.path("clean.lcm")))
        self.assertEqual(readable_sets(run.log), harness.measurement_sets(self.path("clean.lcm")))
        # Numbers of frames on the bus differ, as they must; what is estimated does not.
        estimates = readable_estimates(run.log)
        self.assertEqual(len(estimates), 2 * STEPS)
        clean = readable_estimates(self.path("clean.lcm"))
        self.assertEqual(estimates, {key: clean[key] for key in estimates})

        counters = {p["name"]: p["counters"] for p in run.review()["processes"]}
        for counter in ("unknown", "wrong_format", "wrong_counter", "odd_ticks", "non_finite"):
            self.assertGreater(counters["driver"][counter], 0, counter)
        self.assertGreaterEqual(counters["driver"]["wrong_counter"], 10 * 3)
        self.assertGreater(counters["attacker"]["odd_ticks"], 0)
        self.assertGreater(counters["secure"]["lcm_refused"], 0)
        self.assertIn("wrong_counter", output)
        if harness.BUS == "udp":
            self.assertGreater(counters["driver"]["bus_refused"], 0)


def readable(log, channels, message_type):
    """Messages of a log that also holds hostile events on the channels."""
    for channel, payload in harness.read_log(log):
        if not channel.startswith(channels):
            continue
        try:
            message = message_type.decode(payload)
            is_ours = message.encode() == payload and message.step >= 1
        except Exception:
            continue
        if is_ours:
            yield channel, message


def readable_sets(log):
    return {message.step: [(p.source, tuple(p.values)) for p in message.packets]
            for _, message in readable(log, "MEASUREMENT", holdfast.measurement_set_t)}


def readable_estimates(log):
    return {(channel, message.step): (message.outcome, message.mean, message.covariance)
            for channel, message in readable(log, "EST_", holdfast.estimate_t)}


if __name__ == "__main__":
    unittest.main(verbosity=2)
