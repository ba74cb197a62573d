"""J1939 and NMEA 2000 against the kernel's own stack: what it sends the driver reads, and what twins send it reads."""
import os
import socket
import struct
import subprocess
import time
import unittest

import harness
from harness import RunTest

LCM_URL = "udpm://239.255.76.67:17995?ttl=0"
SWITCH_BANK, AUXILIARY = 127501, 65241  # parameter groups
BANK, ECU = 0x21, 0x42                  # addresses
SOL_CAN_J1939 = socket.SOL_CAN_BASE + socket.CAN_J1939  # has no name in Python
STEPS = 8
DBC = """VERSION ""

BU_: Vendor

BO_ 2032 StepTick: 2 Vendor
 SG_ STEP : 0|16@1+ (1,0) [0|65535] "" Vendor
"""
SCENARIO = f"""holdfast: 1
name: kernel_j1939
steps: {STEPS}
period_s: 0.02
plant:
  kind: binary_target
  model: {{sensor_positions_m: [[10, 10], [10, 30], [30, 10], [30, 30]]}}
network:
  dbc: tick.dbc
  tick: {{message: StepTick, signal: STEP}}
  sensors:
    - {{j1939: {{pgn: {SWITCH_BANK}, source: {BANK}, instance: 0, item: 2}}}}
    - {{j1939: {{pgn: {SWITCH_BANK}, source: {BANK}, instance: 0, item: 28}}}}
    - {{j1939: {{pgn: {AUXILIARY}, source: {ECU}, start_bit: 6}}}}
    - {{j1939: {{pgn: {AUXILIARY}, source: {ECU}, start_bit: 33}}}}
  sensor_options: {{timeout_steps: 2}}
"""


class KernelJ1939Test(RunTest):
    def setUp(self):
        super().setUp()
        for name, text in (("tick.dbc", DBC), ("scenario.yaml", SCENARIO)):
            with open(self.path(name), "w", encoding="ascii") as stream:
                stream.write(text)
        self.link = harness.LcmSocket(LCM_URL)
        self.addCleanup(self.link.close)

    def j1939_socket(self, address):
        """Of the node with this address on vcan0."""
        try:
            node = socket.socket(socket.PF_CAN, socket.SOCK_DGRAM, socket.CAN_J1939)
        except OSError as problem:
            self.skipTest(f"this kernel has no J1939: {problem}")
        self.addCleanup(node.close)
        node.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        node.bind(("vcan0", socket.J1939_NO_NAME, socket.J1939_NO_PGN, address))
        return node

    def send(self, node, group, data):
        """Returns when the frame is on the bus: the kernel sends it some time after the call."""
        node.sendto(data, ("vcan0", socket.J1939_NO_NAME, group, socket.J1939_NO_ADDR))
        while self.raw.recv(16)[8:] != data:
            pass

    def spawn(self, name, *arguments):
        child = subprocess.Popen([harness.program(name), self.path("scenario.yaml"), "--lcm-url", LCM_URL, *arguments])

        def end():
            if child.poll() is None:
                child.kill()
            child.wait()
        self.addCleanup(end)
        return child

    def next_on(self, channel, condition=lambda payload: True):
        deadline = time.monotonic() + 20 * harness.PATIENCE
        while time.monotonic() < deadline:
            message = self.link.receive(timeout_s=1.0)
            if message is not None and message[0] == channel and condition(message[1]):
                return message[1]
        return self.fail(f"nothing came on {channel}")

    def test_the_driver_reads_what_the_kernel_sends(self):
        bank, ecu = self.j1939_socket(BANK), self.j1939_socket(ECU)
        self.raw = socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.addCleanup(self.raw.close)
        self.raw.bind(("vcan0",))
        self.raw.settimeout(20 * harness.PATIENCE)
        driver = self.spawn("can-driver", "--bus", "socketcan:vcan0")
        self.next_on("STATUS_DRIVER", lambda payload: harness.holdfast.status_t.decode(payload).state == 1)

        def told(step):
            self.raw.send(struct.pack("=IB3x8s", 0x7F0, 2, struct.pack("<H", step)))
            measured = harness.holdfast.measurement_set_t.decode(self.next_on("MEASUREMENT"))
            self.assertEqual(measured.step, step)
            states = [None] * 4
            for packet in measured.packets:
                states[packet.source] = int(packet.values[0])
            self.assertEqual(len(measured.invalid), states.count(None))
            return states

        def bank_says(second, last):
            items = (1 << 56) - 1 ^ (3 << 2 | 3 << 54) | second << 2 | last << 54
            self.send(bank, SWITCH_BANK, b"\0" + items.to_bytes(7, "little"))

        def ecu_says(first, second):
            states = (1 << 64) - 1 ^ (3 << 6 | 3 << 33) | first << 6 | second << 33
            self.send(ecu, AUXILIARY, states.to_bytes(8, "little"))

        bank_says(1, 0)
        ecu_says(0, 1)
        self.assertEqual(told(1), [1, 0, 0, 1])
        bank_says(0, 3)
        ecu_says(1, 2)
        self.assertEqual(told(2), [0, None, 1, None])
        ecu_says(1, 0)
        self.assertEqual(told(3), [0, None, 1, 0])
        ecu_says(0, 0)
        self.assertEqual(told(4), [None, None, 0, 0])  # the bank is unplugged
        bank_says(1, 1)
        self.assertEqual(told(5), [1, 1, 0, 0])  # and back, the other gone
        self.assertEqual(told(6), [1, 1, None, None])
        # Another address, and another instance.
        self.send(self.j1939_socket(0x55), AUXILIARY, bytes(8))
        self.send(bank, SWITCH_BANK, b"\1" + bytes(7))
        self.assertEqual(told(7), [None] * 4)
        bank_says(0, 0)
        self.assertEqual(told(8), [0, 0, None, None])
        self.assertEqual(driver.wait(timeout=20 * harness.PATIENCE), 0)

    def test_the_kernel_reads_what_simulated_sensors_send(self):
        listener = self.j1939_socket(socket.J1939_NO_ADDR)
        listener.setsockopt(SOL_CAN_J1939, socket.SO_J1939_PROMISC, 1)
        listener.settimeout(20 * harness.PATIENCE)
        plant = self.spawn("plant", "--bus", "socketcan:vcan0")
        heard = [listener.recvfrom(64) for _ in range(2 * STEPS)]
        self.assertEqual(plant.wait(timeout=20 * harness.PATIENCE), 0)
        self.assertEqual([(origin[2], origin[3], len(data)) for data, origin in heard],
                         [(SWITCH_BANK, BANK, 8), (AUXILIARY, ECU, 8)] * STEPS)
        for data, origin in heard:
            bits = int.from_bytes(data, "little")
            own = 3 << 10 | 3 << 62 if origin[2] == SWITCH_BANK else 3 << 6 | 3 << 33
            self.assertEqual(bits & ~own, (1 << 64) - 1 & ~own & ~(0xFF if origin[2] == SWITCH_BANK else 0))
            for place in (10, 62) if origin[2] == SWITCH_BANK else (6, 33):
                self.assertIn(bits >> place & 3, (0, 1))


if __name__ == "__main__":
    unittest.main(verbosity=2)
