"""Runs holdfast programs for the system tests, over the bus that HOLDFAST_TEST_BUS names: udp or vcan."""
import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

SOURCE = os.environ["HOLDFAST_SOURCE_DIR"]
BINARY = os.environ["HOLDFAST_BINARY_DIR"]
BUS = os.environ["HOLDFAST_TEST_BUS"]
BIN = os.path.join(BINARY, "bin")
PYTHON_TYPES = os.path.join(BINARY, "lcmtypes", "generated", "python")
EXAMPLES = os.path.join(SOURCE, "examples", "python")
TRACKING = os.path.join(SOURCE, "scenarios", "binary_tracking.yaml")
# In the guest a system call costs as much as a hundred outside.
PATIENCE = 4.0 if BUS == "vcan" else 1.0
sys.path[:0] = [PYTHON_TYPES, EXAMPLES]

import holdfast  # noqa: E402
from lcm_socket import LcmSocket  # noqa: E402


def program(name):
    return os.path.join(BIN, "holdfast-" + name)


def call(name, *arguments):
    """Runs a program to its end; returns (exit status, stdout, stderr)."""
    done = subprocess.run([program(name), *arguments], capture_output=True, text=True, timeout=120 * PATIENCE)
    return done.returncode, done.stdout, done.stderr


def is_running(pid):
    """True while the process is there and not merely waiting to be collected."""
    try:
        with open(f"/proc/{pid}/stat", encoding="utf-8") as stream:
            return stream.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def sets(**values):
    """--set arguments; a double underscore stands for a dot."""
    return [part for key, value in values.items() for part in ("--set", f"{key.replace('__', '.')}={value}")]


def read_log(path):
    """Yields (channel, payload) of an LCM log."""
    with open(path, "rb") as stream:
        while len(header := stream.read(28)) == 28:
            assert header[:4] == b"\xed\xa1\xda\x01", "sync word"
            channel_bytes, data_bytes = int.from_bytes(header[20:24], "big"), int.from_bytes(header[24:28], "big")
            yield stream.read(channel_bytes).decode(), stream.read(data_bytes)


def write_log(path, messages):
    """Writes (channel, payload) pairs as an LCM log, a microsecond apart."""
    with open(path, "wb") as stream:
        for number, (channel, payload) in enumerate(messages):
            name = channel.encode()
            stream.write(struct.pack(">IqqII", 0xEDA1DA01, number, number, len(name), len(payload)) + name + payload)


def measurement_sets(path):
    """{step: [(source, values)]} of a log."""
    result = {}
    for channel, payload in read_log(path):
        if channel == "MEASUREMENT":
            message = holdfast.measurement_set_t.decode(payload)
            result[message.step] = [(p.source, tuple(p.values)) for p in message.packets]
    return result


class Run:
    """One holdfast-run: started, watched through its output and LCM, and ended."""

    def __init__(self, folder, *arguments, scenario=TRACKING):
        command = [program("run"), scenario, "--runs", folder, *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        head = ""
        while "LCM_DEFAULT_URL=" not in head:
            line = self.process.stdout.readline()
            if not line:
                raise AssertionError("holdfast-run ended at once: " + head + self.process.stderr.read())
            head += line
        self.head = head
        self.folder = re.search(r"^run +(\S+)$", head, re.M).group(1)
        self.lcm_url = re.search(r"LCM_DEFAULT_URL='([^']+)'", head).group(1)
        self.sensor_bus, self.monitor_bus = re.search(r"sensors (\S+), monitor (\S+)", head).groups()
        self.log = os.path.join(self.folder, "log.lcm")
        self.link = LcmSocket(self.lcm_url)

    def wait_for(self, condition, what, timeout_s=40.0):
        """Waits for a message for which condition(channel, payload) holds."""
        deadline = time.monotonic() + timeout_s * PATIENCE
        while time.monotonic() < deadline:
            message = self.link.receive(timeout_s=0.1)
            if message is not None and condition(*message):
                return message
            if self.process.poll() is not None:
                raise AssertionError(f"the run ended while waiting for {what}: {self.process.stderr.read()}")
        raise AssertionError(f"no {what} came in time")

    def wait_for_step(self, step):
        def reached(channel, payload):
            return channel == "MEASUREMENT" and holdfast.measurement_set_t.decode(payload).step >= step
        return self.wait_for(reached, f"step {step}")

    def pid_of(self, pattern):
        """Pid of the run's process whose command line matches."""
        for entry in os.listdir("/proc"):
            if not entry.isdigit():
                continue
            try:
                with open(f"/proc/{entry}/status", encoding="utf-8") as stream:
                    parent = int(re.search(r"^PPid:\s+(\d+)", stream.read(), re.M).group(1))
                with open(f"/proc/{entry}/cmdline", "rb") as stream:
                    command = stream.read().replace(b"\0", b" ").decode(errors="replace")
            except (OSError, AttributeError):
                continue
            if parent == self.process.pid and re.search(pattern, command):
                return int(entry)
        raise AssertionError(f"no process of the run matches {pattern}")

    def finish(self, timeout_s=60.0):
        """Waits for the end; returns (exit status, stdout, stderr)."""
        output, errors = self.process.communicate(timeout=timeout_s * PATIENCE)
        return self.process.returncode, self.head + output, errors

    def review(self):
        with open(os.path.join(self.folder, "review.json"), encoding="utf-8") as stream:
            return json.load(stream)


class RunTest(unittest.TestCase):
    """A test case with a folder of its own, and runs that do not outlive it."""

    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = temporary.name

    def start(self, *arguments, **options):
        run = Run(os.path.join(self.folder, "runs"), *arguments, **options)

        def end():
            if run.process.poll() is None:
                run.process.send_signal(signal.SIGTERM)
                run.process.communicate(timeout=30 * PATIENCE)
            run.process.stdout.close()
            run.process.stderr.close()
            run.link.close()
        self.addCleanup(end)
        self.assertIn("socketcan:vcan" if BUS == "vcan" else "udp:", run.sensor_bus)
        return run

    def path(self, name):
        return os.path.join(self.folder, name)

    def assert_succeeds(self, result):
        status, output, errors = result
        self.assertEqual(status, 0, f"exit status {status}\n{output}\n{errors}")
        return output

    def assert_equal_logs(self, a, b, channels="EST_.*"):
        self.assert_succeeds(call("review", "--compare", a, b, "--channels", channels))

    def assert_equal_runs(self, a, b):
        """Estimates, what they were made from, the truth and what came back: all to the bit."""
        self.assert_equal_logs(a, b, "EST_.*|MEASUREMENT|PLANT_TRUTH|KNOWN_INPUT|ATTACK_.*|CAN_COMMAND")
