"""Foreign binary sensors, played with python-can on the UDP bus: what the driver makes of them, and what it tells them.

A CANopen node (as CiA 301 has it), an NMEA 2000 switch bank and a vendor's frames, which canmatrix encodes, on one bus. They
are pulled out and plugged in again.
"""
import os
import struct
import subprocess
import sys
import time
import unittest

import can
import canmatrix.formats

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "run"))
import harness  # noqa: E402
from holdfast import invalid_reading_t, measurement_set_t, status_t  # noqa: E402

GROUP, PORT = "239.74.163.2", 43719
LCM_URL = "udpm://239.255.76.67:17993?ttl=0"
NODE, BANK = 5, 0x21
STEPS = 12
DBC = """VERSION ""

BS_:

BU_: Vendor

BO_ 672 Doors: 4 Vendor
 SG_ FRONT : 12|1@1+ (1,0) [0|1] "" Vendor
 SG_ REAR : 6|2@0+ (1,0) [0|3] "" Vendor

BO_ 2032 StepTick: 2 Vendor
 SG_ STEP : 0|16@1+ (1,0) [0|65535] "" Vendor
"""
SCENARIO = f"""holdfast: 1
name: foreign_sensors
steps: {STEPS}
plant:
  kind: binary_target
  model: {{sensor_positions_m: [[10, 10], [10, 30], [10, 50], [30, 10], [30, 30], [30, 50]]}}
network:
  dbc: vendor.dbc
  tick: {{message: StepTick, signal: STEP}}
  sensors:
    - {{canopen: {{node: {NODE}, input: 1}}}}
    - {{canopen: {{node: {NODE}, input: 10}}, invert: true}}
    - {{j1939: {{pgn: 127501, source: {BANK}, instance: 2, item: 1}}}}
    - {{j1939: {{pgn: 127501, source: {BANK}, instance: 2, item: 28}}}}
    - {{dbc: {{message: Doors, signal: FRONT}}}}
    - {{dbc: {{message: Doors, signal: REAR}}}}
  sensor_options: {{timeout_steps: 2}}
"""
NEVER, SILENT, WAITS, FAULTY, UNKNOWN = ("never", "silent", "waits", "faulty", "unknown")
REASONS = {invalid_reading_t.NEVER_HEARD: NEVER, invalid_reading_t.SILENT: SILENT,
           invalid_reading_t.NOT_OPERATIONAL: WAITS, invalid_reading_t.FAULTY: FAULTY,
           invalid_reading_t.NOT_AVAILABLE: UNKNOWN}


class PythonCanTest(harness.RunTest):
    def setUp(self):
        super().setUp()
        for name, text in (("vendor.dbc", DBC), ("scenario.yaml", SCENARIO)):
            with open(self.path(name), "w", encoding="ascii") as stream:
                stream.write(text)
        self.doors = canmatrix.formats.loadp_flat(self.path("vendor.dbc")).frame_by_name("Doors")
        self.link = harness.LcmSocket(LCM_URL)
        self.addCleanup(self.link.close)
        self.bus = can.Bus(interface="udp_multicast", channel=GROUP, port=PORT)
        self.addCleanup(self.bus.shutdown)
        self.step = 0

    def start_driver(self, *arguments):
        driver = subprocess.Popen([harness.program("can-driver"), self.path("scenario.yaml"), "--lcm-url", LCM_URL,
                                   "--bus", f"udp:{GROUP}:{PORT}", *arguments])

        def end():
            if driver.poll() is None:
                driver.kill()
            driver.wait()
        self.addCleanup(end)
        self.status_with(status_t.READY)
        return driver

    def message_on(self, channel, kind, condition=lambda message: True):
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline:
            message = self.link.receive(timeout_s=1.0)
            if message is not None and message[0] == channel and condition(decoded := kind.decode(message[1])):
                return decoded
        return self.fail(f"what was waited for on {channel} did not come")

    def status_with(self, state):
        return self.message_on("STATUS_DRIVER", status_t, lambda status: status.state == state)

    def send(self, identifier, data, is_extended=False):
        self.bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=is_extended))

    def life(self, state):
        """Boot-up (0) or heartbeat."""
        self.send(0x700 + NODE, bytes([state]))

    def inputs(self, bits, node=NODE):
        self.send(0x180 + node, struct.pack("<H", bits))

    def bank(self, first, last, instance=2, source=BANK):
        """A switch bank's states of items 1 and 28; the others are not there."""
        items = first | ((1 << 52) - 1) << 2 | last << 54
        self.send(3 << 26 | 127501 << 8 | source, bytes([instance]) + items.to_bytes(7, "little"), True)

    def vendor(self, front, rear):
        self.send(0x2A0, self.doors.encode({"FRONT": front, "REAR": rear}))

    def measured(self, measurement):
        """What is said of each sensor: its state, or why there is none."""
        told = [None] * 6
        for packet in measurement.packets:
            told[packet.source] = int(packet.values[0])
        for reading in measurement.invalid:
            self.assertIsNone(told[reading.source], "both known and not")
            told[reading.source] = REASONS[reading.reason]
        return told

    def close_step(self):
        self.step += 1
        self.send(0x7F0, struct.pack("<H", self.step))
        measurement = self.message_on("MEASUREMENT", measurement_set_t)
        self.assertEqual(measurement.step, self.step)
        return self.measured(measurement)

    def wait_for_start(self):
        """The next NMT command that the driver sends; the bus brings back what we send, too."""
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline:
            message = self.bus.recv(1.0)
            if message is None or message.arbitration_id != 0 or message.is_extended_id:
                continue
            self.assertEqual((bytes(message.data), message.is_remote_frame), (bytes([1, NODE]), False))
            return
        self.fail("nobody started the node")

    def test_each_step_has_what_sensors_said_or_why_nothing_is_known(self):
        driver = self.start_driver()
        # Others of the same kinds are none of ours.
        self.inputs(0xFFFF, node=6)
        self.bank(1, 1, source=BANK + 1)
        self.bank(1, 1, instance=3)
        self.assertEqual(self.close_step(), [NEVER] * 6)
        self.life(0x00)
        self.bank(1, 0)
        self.vendor(1, 0)
        self.assertEqual(self.close_step(), [WAITS, WAITS, 1, 0, 1, 0])
        self.wait_for_start()
        self.life(0x05)
        self.inputs(0x0001)
        self.bank(0, 1)
        self.vendor(0, 1)
        self.assertEqual(self.close_step(), [1, 1, 0, 1, 0, 1])
        # A node tells its inputs when they change.
        self.life(0x05)
        self.bank(2, 3)
        self.vendor(1, 2)
        self.assertEqual(self.close_step(), [1, 1, FAULTY, UNKNOWN, 1, FAULTY])
        self.life(0x05)
        self.inputs(0x0201)
        self.send(0x080 + NODE, struct.pack("<HB5x", 0x5030, 0x01))  # emergency: hardware of the sensor
        self.bank(0, 0)
        self.vendor(1, 3)
        self.assertEqual(self.close_step(), [FAULTY, FAULTY, 0, 0, 1, UNKNOWN])
        self.life(0x05)
        self.send(0x080 + NODE, bytes(8))  # over
        self.bank(1, 1)
        self.vendor(1, 1)
        self.assertEqual(self.close_step(), [1, 0, 1, 1, 1, 1])
        # All are pulled out: what was said holds until a sign of life is missed.
        self.assertEqual(self.close_step(), [1, 0, 1, 1, 1, 1])
        self.assertEqual(self.close_step(), [SILENT] * 6)
        self.assertEqual(self.close_step(), [SILENT] * 6)
        self.life(0x00)
        self.bank(0, 1)
        self.assertEqual(self.close_step(), [WAITS, WAITS, 0, 1, SILENT, SILENT])
        self.wait_for_start()
        self.life(0x05)
        self.vendor(0, 0)
        self.assertEqual(self.close_step(), [UNKNOWN, UNKNOWN, 0, 1, 0, 0])
        self.life(0x05)
        self.inputs(0x0200)
        self.bank(1, 0)
        self.assertEqual(self.close_step(), [0, 0, 1, 0, 0, 0])
        status = self.status_with(status_t.FINISHED)
        counters = dict(zip(status.counter_name, status.counter_value, strict=True))
        self.assertEqual((counters["sensor_requests"], counters["wrong_format"]), (2, 0))
        self.assertEqual(driver.wait(timeout=20), 0)

    def play_until(self, expected, *senders):
        """Sends, as often as a step closes, until the driver says what is expected."""
        deadline = time.monotonic() + 20
        told = None
        while time.monotonic() < deadline:
            for send, *values in senders:
                send(*values)
            told = self.measured(self.message_on("MEASUREMENT", measurement_set_t))
            if told == expected:
                return
        self.fail(f"{told}, not {expected}")

    def test_without_ticks_the_drivers_clock_closes_steps(self):
        self.start_driver("--set", "network.close_step=clock", "--set", "period_s=0.1", "--set", "steps=1000",
                          "--set", "network.sensor_options.timeout_steps=3")
        self.life(0x00)
        self.wait_for_start()
        others = (self.bank, 1, 0), (self.vendor, 0, 1)
        self.play_until([1, 0, 1, 0, 0, 1], (self.life, 0x05), (self.inputs, 0x0201), *others)
        self.play_until([SILENT, SILENT, 1, 0, 0, 1], *others)
        self.play_until([SILENT] * 6)
        self.play_until([WAITS, WAITS, 1, 0, 0, 1], (self.life, 0x00), *others)
        self.play_until([0, 1, 1, 0, 0, 1], (self.life, 0x05), (self.inputs, 0x0000), *others)


if __name__ == "__main__":
    unittest.main(verbosity=2)
