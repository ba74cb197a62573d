"""Serial adapters: can-utils' slcanpty, which answers, and the kernel's slcan, which does not, stand for them."""
import os
import re
import select
import socket
import struct
import subprocess
import threading
import time
import unittest

import harness
from harness import RunTest

LCM_URL = "udpm://239.255.76.67:17997?ttl=0"
LINK_CHANGES = 1  # RTMGRP_LINK
# Identifiers and lengths from end to end, 11 and 29 bits.
FRAMES = ("000#", "001#00", "7FF#0102030405060708", "00000000#", "000007FF#0A07", "1FFFFFFF#FFFFFFFFFFFFFFFF",
          "12345678#0D0D0D", "123#R", "00000123#R")
LONG_REMOTE_FRAMES = ("7FF#R8", "1ABCDEF0#R3")
LAST_TICK = "7F0#01000000"


def end(child):
    if child.poll() is None:
        child.kill()
    child.wait()
    if child.stdout:
        child.stdout.close()


class Slcanpty:
    """can-utils' slcanpty between a new pty and vcan0. It knows no listen-only."""

    interface = "vcan0"

    def __init__(self):
        self.process = subprocess.Popen(["stdbuf", "-oL", "slcanpty", "/dev/ptmx", self.interface], text=True,
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        self.device = None
        while self.device is None:
            line = self.process.stdout.readline()
            assert line, "slcanpty ended"
            found = re.search(r"/dev/pts/\d+", line)
            self.device = found and found.group(0)

    @staticmethod
    def is_open(status):
        """What is only read is asked to listen, which is refused; then it is opened like others."""
        return "listen-only" in status.remark

    def end(self):
        end(self.process)


class KernelSlcan:
    """The kernel's slcan, attached by can-utils' slcand, behind a cable of two ptys. It takes frames and answers nothing."""

    interface = "slcan0"

    def __init__(self):
        self.near, self.near_plug = os.openpty()
        self.far, far_plug = os.openpty()
        self.device = os.ttyname(self.near_plug)
        self.cable = threading.Thread(target=self.carry, daemon=True)
        with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as news:
            news.bind((0, LINK_CHANGES))
            news.settimeout(20 * harness.PATIENCE)
            self.process = subprocess.Popen(["slcand", "-F", os.ttyname(far_plug), self.interface],
                                            stdout=subprocess.DEVNULL)
            try:
                while self.interface.encode() + b"\0" not in news.recv(65536):
                    pass
                # With room for a burst: canplayer gives up on a full queue.
                subprocess.run(["ip", "link", "set", self.interface, "txqueuelen", "1000", "up"], check=True)
            except Exception:
                end(self.process)
                raise
        os.close(far_plug)
        self.cable.start()

    def carry(self):
        """Carries bytes both ways until slcand lets go of the far end; then the near end is gone, too."""
        ways = {self.near: self.far, self.far: self.near}
        try:
            while True:
                for source in select.select(list(ways), [], [])[0]:
                    os.write(ways[source], os.read(source, 4096))
        except OSError:
            for descriptor in (self.near, self.near_plug, self.far):
                os.close(descriptor)

    @staticmethod
    def is_open(status):
        return status.state in (status.READY, status.RUNNING)

    def end(self):
        if self.process.poll() is None:
            self.process.terminate()
        self.process.wait(timeout=20 * harness.PATIENCE)
        self.cable.join(timeout=20 * harness.PATIENCE)
        assert not self.cable.is_alive(), "slcand ended, and its end of the cable is still there"


class Vcan:
    """No adapter: kernel CAN."""

    interface = "vcan1"
    url = "socketcan:vcan1"


class FrameReceiver:
    """What candump would print of an interface, from now on."""

    def __init__(self, interface):
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.bind((interface,))
        self.socket.settimeout(20 * harness.PATIENCE)

    def receive(self, count):
        """So many frames, or as many as come."""
        received = []
        try:
            while len(received) < count:
                received.append(self.text(*struct.unpack("=IB3x8s", self.socket.recv(16))))
        except TimeoutError:
            pass
        return received

    @staticmethod
    def text(identifier, length, data):
        name = f"{identifier & socket.CAN_EFF_MASK:08X}" if identifier & socket.CAN_EFF_FLAG else f"{identifier & 0x7FF:03X}"
        if identifier & socket.CAN_RTR_FLAG:
            return f"{name}#R{length or ''}"
        return f"{name}#{data[:length].hex().upper()}"


class SlcanTest(RunTest):
    def setUp(self):
        super().setUp()
        self.link = harness.LcmSocket(LCM_URL)
        self.addCleanup(self.link.close)

    def plug_in(self, kind):
        """A new adapter of the kind, which a name of its own leads to."""
        adapter = kind()
        self.addCleanup(adapter.end)
        name = self.path(kind.__name__)
        if os.path.islink(name):
            os.remove(name)
        os.symlink(adapter.device, name)
        adapter.url = "slcan:" + name
        return adapter

    def start_program(self, name, *arguments):
        process = subprocess.Popen([harness.program(name), harness.TRACKING, "--lcm-url", LCM_URL, *arguments])
        self.addCleanup(end, process)
        return process

    @staticmethod
    def play(interface, frames):
        lines = "".join(f"(0.000000) {interface} {frame}\n" for frame in frames)
        subprocess.run(["canplayer", "-t", f"{interface}={interface}"], input=lines, text=True, check=True)

    def wait_for_status(self, of, condition, what):
        deadline = time.monotonic() + 20 * harness.PATIENCE
        while time.monotonic() < deadline:
            message = self.link.receive(timeout_s=0.5)
            if message is not None and message[0] == f"STATUS_{of}":
                if condition(harness.holdfast.status_t.decode(message[1])):
                    return
        self.fail(what)

    def plug_in_again(self, of, adapter):
        adapter.end()
        self.wait_for_status(of, lambda status: "is gone" in status.remark, "nobody saw that the adapter was gone")
        again = self.plug_in(type(adapter))
        self.wait_for_status(of, lambda status: "is back" in status.remark, "nobody saw that the adapter was back")
        self.wait_for_status(of, again.is_open, "the adapter was not opened again")
        return again

    def measure(self, interface, steps):
        """Sends frames of all sixteen sensors in each step, and the tick; returns what the driver makes of them."""
        frames, sets = [], {}
        for step in steps:
            frames += [f"{0x101 + s:03X}#{struct.pack('<BH', (s + step) % 2, step).hex().upper()}" for s in range(16)]
            frames.append(f"7F0#{struct.pack('<I', step).hex().upper()}")
        self.play(interface, frames)
        while len(sets) < len(steps):
            message = self.link.receive(timeout_s=20 * harness.PATIENCE)
            self.assertIsNotNone(message, f"only {sorted(sets)} of {steps} came")
            if message[0] == "MEASUREMENT":
                measured = harness.holdfast.measurement_set_t.decode(message[1])
                sets[measured.step] = [(p.source, p.values[0]) for p in measured.packets]
        return sets

    def check_driver(self, kind):
        adapter = self.plug_in(kind)
        driver = self.start_program("can-driver", "--bus", adapter.url, "--set", "steps=6")
        self.wait_for_status("DRIVER", kind.is_open, "the driver did not open the adapter")
        sets = self.measure(kind.interface, range(1, 4))
        self.plug_in_again("DRIVER", adapter)
        sets.update(self.measure(kind.interface, range(4, 7)))
        self.assertEqual(sets, {k: [(s, float((s + k) % 2)) for s in range(16)] for k in range(1, 7)})
        self.assertEqual(driver.wait(timeout=20 * harness.PATIENCE), 0)

    def test_the_driver_reads_slcanpty_that_is_pulled_out_and_put_back(self):
        self.check_driver(Slcanpty)

    def test_the_driver_reads_the_kernels_slcan_that_is_pulled_out_and_put_back(self):
        self.check_driver(KernelSlcan)

    def start_attacker(self, source, target):
        """One that forwards what comes from the adapter, until the tick of step 1."""
        attacker = self.start_program("attacker", "--from", source.url, "--to", target.url, "--i-own-this-bus", target.url,
                                      "--set", "attacks=[]", "--set", "steps=1")
        self.wait_for_status("ATTACKER", source.is_open, "the attacker did not open the adapter")
        return attacker

    def check_frames(self, source, target, frames):
        receiver = FrameReceiver(target.interface)
        with receiver.socket:
            self.play(source.interface, frames)
            self.assertEqual(receiver.receive(len(frames)), list(frames))

    def test_frames_of_all_kinds_come_from_the_kernels_slcan(self):
        source, target = self.plug_in(KernelSlcan), Vcan
        attacker = self.start_attacker(source, target)
        self.check_frames(source, target, [*FRAMES, *LONG_REMOTE_FRAMES, LAST_TICK])
        self.assertEqual(attacker.wait(timeout=20 * harness.PATIENCE), 0)

    def test_frames_go_from_the_kernels_slcan_to_slcanpty(self):
        """But for remote frames with a length, which slcanpty refuses in part."""
        source, target = self.plug_in(KernelSlcan), self.plug_in(Slcanpty)
        attacker = self.start_attacker(source, target)
        self.check_frames(source, target, [*FRAMES, LAST_TICK])
        self.assertEqual(attacker.wait(timeout=20 * harness.PATIENCE), 0)

    def test_frames_of_all_kinds_go_from_slcanpty_to_the_kernels_slcan_which_is_pulled_out_and_put_back(self):
        source, target = self.plug_in(Slcanpty), self.plug_in(KernelSlcan)
        attacker = self.start_attacker(source, target)
        self.check_frames(source, target, [*FRAMES, *LONG_REMOTE_FRAMES])
        target = self.plug_in_again("ATTACKER", target)
        self.check_frames(source, target, [*FRAMES, *LONG_REMOTE_FRAMES, LAST_TICK])
        self.assertEqual(attacker.wait(timeout=20 * harness.PATIENCE), 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
