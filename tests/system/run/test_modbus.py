"""Sensors on a serial line: Modbus RTU units that libmodbus plays, a gateway that asks them, and the driver behind it."""
import os
import select
import subprocess
import threading
import time
import tty
import unittest

import harness
import yaml
from harness import RunTest, sets

SCENARIO = os.path.join(harness.SOURCE, "scenarios", "binary_modbus.yaml")
LCM_URL = "udpm://239.255.76.67:17887?ttl=0"
PLANT_BUS, GATEWAY_BUS = "udp:239.255.76.67:17888", "udp:239.255.76.67:17889"
REASON = harness.holdfast.invalid_reading_t


def with_checksum(message):
    """CRC-16 of Modbus, low byte first."""
    register = 0xFFFF
    for byte in message:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    return message + register.to_bytes(2, "little")


class Line:
    """A line that a gateway and units hang on, each with a pty of its own: hands each request to the unit that it names."""

    REQUEST_BYTES = 8

    def __init__(self, folder, units):
        self.folder = folder
        self.units = units
        self.paths = {who: os.path.join(folder, f"line-{who}") for who in ["gateway", *units]}
        self.descriptors = {}
        self.lock = threading.Lock()
        self.num_requests = 0
        self.pending = b""
        self.tamper = lambda unit, number, answer: answer
        for who in self.paths:
            self.plug(who)
        self.is_stopped = False
        self.thread = threading.Thread(target=self.carry)
        self.thread.start()

    def plug(self, who):
        controller, device = os.openpty()
        tty.setraw(device)
        with self.lock:
            os.symlink(os.ttyname(device), self.paths[who])
            self.descriptors[who] = (controller, device)

    def pull(self, who):
        """Whoever has it open is hung up on, and what was under way is lost."""
        with self.lock:
            os.remove(self.paths[who])
            for descriptor in self.descriptors.pop(who):
                os.close(descriptor)
            self.pending = b""

    def has(self, who):
        with self.lock:
            return who in self.descriptors

    def say(self, data):
        """To the gateway, if it is there."""
        with self.lock:
            if "gateway" in self.descriptors:
                os.write(self.descriptors["gateway"][0], data)

    def carry(self):
        while not self.is_stopped:
            with self.lock:
                owners = {pair[0]: who for who, pair in self.descriptors.items()}
                came = [(owners[fd], os.read(fd, 256)) for fd in select.select(list(owners), [], [], 0.005)[0]]
            for who, data in came:
                if who == "gateway":
                    self.hand_on_requests(data)
                else:
                    self.say(self.tamper(who, self.num_requests, data))

    def hand_on_requests(self, data):
        with self.lock:
            self.pending += data
            while len(self.pending) >= self.REQUEST_BYTES:
                self.num_requests += 1
                request, self.pending = self.pending[:self.REQUEST_BYTES], self.pending[self.REQUEST_BYTES:]
                if request[0] in self.units:
                    os.write(self.descriptors[request[0]][0], request)

    def close(self):
        self.is_stopped = True
        self.thread.join()
        for who in list(self.descriptors):
            self.pull(who)


class ModbusTest(RunTest):
    def spawn(self, name, *arguments):
        child = subprocess.Popen([harness.program(name), *arguments, "--lcm-url", LCM_URL], stderr=subprocess.PIPE, text=True)

        def end():
            if child.poll() is None:
                child.terminate()
            child.communicate(timeout=30)
        self.addCleanup(end)
        return child

    def wait_until_ready(self, *names):
        """Of processes that publish a status."""
        waiting = {"STATUS_" + name for name in names}
        deadline = time.monotonic() + 20 * harness.PATIENCE
        while waiting:
            self.assertLess(time.monotonic(), deadline, f"not ready: {waiting}")
            message = self.link.receive(timeout_s=0.2)
            if message is not None and message[0] in waiting:
                if harness.holdfast.status_t.decode(message[1]).state >= 1:
                    waiting.remove(message[0])

    def run_over_line(self, options, on_set=lambda line, step: None, tamper=None, in_step=True):
        """The plant's sensors over the line; returns ({step: measurement set}, {step: estimate}, gateway's counters)."""
        self.link = harness.LcmSocket(LCM_URL)
        self.addCleanup(self.link.close)
        line = Line(self.folder, [1, 2])
        self.addCleanup(line.close)
        if tamper:
            line.tamper = tamper
        for unit in (1, 2):
            self.spawn("modbus", SCENARIO, *options, "--serve", str(unit), "--line", line.paths[unit], "--bus", PLANT_BUS,
                       *(["--in-step"] if in_step else []))
        driver = self.spawn("can-driver", SCENARIO, *options, "--bus", GATEWAY_BUS)
        estimator = self.spawn("estimator", "--scenario", SCENARIO, *options, "--name", "secure")
        self.wait_until_ready("MODBUS_UNIT_1", "MODBUS_UNIT_2", "DRIVER", "SECURE")
        # Ahead of the gateway, so that no unit has to wait for a step.
        plant = self.spawn("plant", SCENARIO, *options, *sets(period_s=0.005), "--bus", PLANT_BUS)
        self.wait_until_ready("PLANT")
        gateway = self.spawn("modbus", SCENARIO, *options, "--line", line.paths["gateway"], "--bus", GATEWAY_BUS)
        measured, estimates, counters = {}, {}, {}
        self.gone = set()  # steps in which nothing is known
        deadline = time.monotonic() + 60 * harness.PATIENCE
        is_over = False
        while len(estimates) < self.num_steps or not is_over:
            self.assertLess(time.monotonic(), deadline, f"{len(measured)} sets, {len(estimates)} estimates came")
            message = self.link.receive(timeout_s=0.2)
            if message is None:
                continue
            channel, payload = message
            if channel == "MEASUREMENT":
                received = harness.holdfast.measurement_set_t.decode(payload)
                measured[received.step] = received
                if len(received.invalid) == 16:
                    self.gone.add(received.step)
                on_set(line, received.step)
            elif channel == "EST_SECURE":
                estimate = harness.holdfast.estimate_t.decode(payload)
                estimates[estimate.step] = (estimate.mean, estimate.covariance)
            elif channel == "STATUS_MODBUS":
                status = harness.holdfast.status_t.decode(payload)
                counters = dict(zip(status.counter_name, status.counter_value))
                is_over = status.state >= status.FINISHED
        for child in (gateway, driver, estimator, plant):
            self.assertEqual(child.wait(timeout=20 * harness.PATIENCE), 0)
        return measured, estimates, counters

    def simulated(self, options, scenario=SCENARIO):
        """The same without a line: the log's measurement sets and estimates."""
        run = harness.Run(self.path("simulated-" + str(len(os.listdir(self.folder)))), *options, scenario=scenario)
        self.addCleanup(run.link.close)
        self.assert_succeeds(run.finish())
        measured, estimates = {}, {}
        for channel, payload in harness.read_log(run.log):
            if channel == "MEASUREMENT":
                received = harness.holdfast.measurement_set_t.decode(payload)
                measured[received.step] = received
            elif channel == "EST_SECURE":
                estimate = harness.holdfast.estimate_t.decode(payload)
                estimates[estimate.step] = (estimate.mean, estimate.covariance)
        return measured, estimates

    @staticmethod
    def what(measured):
        return {step: ([(p.source, tuple(p.values)) for p in received.packets],
                       [(r.source, r.reason) for r in received.invalid]) for step, received in measured.items()}

    def options(self, **values):
        self.num_steps = 60
        return sets(steps=self.num_steps, attacks="[]", period_s=0.02, network__sensor_options__modbus_timeout_s=2.0, **values)

    def plain_scenario(self):
        """The same plant with a frame for each reading of each step."""
        with open(SCENARIO, encoding="utf-8") as stream:
            scenario = yaml.safe_load(stream)
        with open(harness.TRACKING, encoding="utf-8") as stream:
            scenario["network"] = yaml.safe_load(stream)["network"]
        scenario["network"]["dbc"] = os.path.join(harness.SOURCE, "scenarios", "binary_sensors.dbc")
        scenario["attacks"] = []
        path = self.path("plain.yaml")
        with open(path, "w", encoding="utf-8") as stream:
            yaml.safe_dump(scenario, stream)
        return path

    def test_over_the_line_the_estimate_is_that_of_the_plain_path(self):
        measured, estimates, counters = self.run_over_line(self.options(network__sensor_options__outages="[]"))
        self.assertEqual((counters["answers"], counters["frames_sent"]), (2 * self.num_steps, 3 * self.num_steps))
        plain, plain_estimates = self.simulated(sets(steps=self.num_steps, period_s=0.005), self.plain_scenario())
        self.assertEqual(self.what(measured), self.what(plain))
        self.assertEqual(estimates, plain_estimates)

    def test_a_unit_that_is_unplugged_and_plugged_back_is_missing_meanwhile(self):
        options = self.options(network__sensor_options__outages="[{sensor: unit 2 input 3, first_step: 20, last_step: 22}]")
        measured, estimates, counters = self.run_over_line(options)
        self.assertEqual(self.missing(measured), {step: [(source, REASON.NOT_AVAILABLE) for source in range(8, 16)] for step in (20, 21, 22)})
        self.assertEqual(counters["silent"], 3)
        simulated, simulated_estimates = self.simulated(options)
        self.assertEqual(self.what(measured), self.what(simulated))
        self.assertEqual(estimates, simulated_estimates)
        # An estimator sees no more of it than of frames that were lost.
        drop = "[{name: cut, match: {messages: [Sensor09,Sensor10,Sensor11,Sensor12,Sensor13,Sensor14,Sensor15,Sensor16]}, " \
               "window: {first_step: 20, last_step: 22}, action: drop}]"
        lost, lost_estimates = self.simulated(sets(steps=self.num_steps, period_s=0.005, attacks=drop), self.plain_scenario())
        self.assertEqual([what[0] for what in self.what(measured).values()], [what[0] for what in self.what(lost).values()])
        self.assertEqual(estimates, lost_estimates)

    def missing(self, measured):
        return {step: what[1] for step, what in self.what(measured).items() if what[1]}

    def test_broken_answers_and_exceptions_are_told_apart(self):
        """Requests come in pairs, for unit 1 and unit 2."""
        answers = {21: lambda answer: answer[:-1] + bytes([answer[-1] ^ 0x10]),  # unit 1 in step 11
                   23: lambda answer: b"\x04" + answer[1:],
                   26: lambda answer: with_checksum(answer[:1] + b"\x82\x04"),  # unit 2 in step 13
                   28: lambda answer: with_checksum(answer[:1] + b"\x82\x00"),
                   30: lambda answer: answer[:3]}  # and no more: a time-out
        measured, _, counters = self.run_over_line(self.options(network__sensor_options__outages="[]"), tamper=lambda unit, number, answer:
                                                   answers.get(number, lambda same: same)(answer))
        first, second = ([(s, REASON.FAULTY) for s in range(at, at + 8)] for at in (0, 8))
        self.assertEqual(self.missing(measured), {11: first, 12: first, 13: second, 14: second,
                                                  15: [(s, REASON.NOT_AVAILABLE) for s in range(8, 16)]})
        self.assertEqual([counters[name] for name in ("broken_answers", "exceptions", "silent", "answers")],
                         [2, 2, 1, 2 * self.num_steps - 5])

    def test_answers_that_come_twice_or_too_late_shift_no_others(self):
        late = []

        def tamper(unit, number, answer):
            if number in (4, 7):
                return answer + answer
            if number == 12:  # unit 2 in step 6
                late.append(answer)
                return b""
            return answer

        def on_set(line, step):
            if step == 6:
                line.say(late[0])

        options = self.options(network__sensor_options__outages="[]")
        self.num_steps = 12
        # Between the end of a step and the next request there is time for what is late.
        options += sets(steps=self.num_steps, period_s=0.8, network__sensor_options__modbus_timeout_s=0.4)
        measured, _, _ = self.run_over_line(options, on_set, tamper)
        self.assertEqual(self.missing(measured), {6: [(s, REASON.NOT_AVAILABLE) for s in range(8, 16)]})
        plain, _ = self.simulated(sets(steps=self.num_steps, period_s=0.005), self.plain_scenario())
        expected = self.what(plain)
        self.assertEqual({step: what for step, what in self.what(measured).items() if step != 6},
                         {step: what for step, what in expected.items() if step != 6})

    def test_a_line_that_is_gone_and_back(self):
        """The gateway asks on by the clock, so a busy machine needs many steps to see that the line went and to give it back."""
        steps = {}
        options = self.options(network__sensor_options__outages="[]")
        self.num_steps = 600
        options += sets(steps=self.num_steps)

        def on_set(line, step):
            if step == 20:
                line.pull("gateway")
            elif step > 20 and not line.has("gateway") and step in self.gone:
                steps["back"] = step
                line.plug("gateway")

        measured, _, counters = self.run_over_line(options, on_set)
        self.assertIn("back", steps, "nobody saw that the line was gone")
        self.assertGreater(counters["line_gone"], 0)
        missing = [step for step in self.missing(measured) if step > 20]
        self.assertIn(steps["back"], missing)
        self.assertLess(missing[-1], self.num_steps, "the line did not come back")

    def test_the_checksum_is_that_of_published_examples(self):
        self.assertEqual(with_checksum(bytes.fromhex("630200010006")).hex(), "630200010006a18a")
        self.assertEqual(with_checksum(bytes.fromhex("018202")).hex(), "018202c161")

    def test_what_cannot_be_is_said(self):
        for expected, arguments, text in (
                (2, ["--serve", "3", "--line", "x"], "its units are: 1, 2"),
                (2, ["--line", "x@17"], "is none of: 300"),
                (2, ["--line", "x?parity=mark"], "expected DEVICE"),
                (1, ["--line", self.path("none")], "cannot be opened"),
                (1, ["--serve", "1", "--line", self.path("none")], "cannot be opened")):
            status, _, errors = harness.call("modbus", SCENARIO, "--bus", PLANT_BUS, *arguments)
            self.assertIn(text, errors)
            self.assertEqual(status, expected)
        status, _, errors = harness.call("modbus", harness.TRACKING, "--bus", PLANT_BUS, "--line", "x")
        self.assertIn("no sensor on Modbus", errors)
        self.assertEqual(status, 2)

    def test_no_answer_at_all_is_a_failure(self):
        controller, device = os.openpty()
        self.addCleanup(os.close, controller)
        self.addCleanup(os.close, device)
        arguments = (SCENARIO, *sets(steps=5), "--bus", PLANT_BUS, "--line", os.ttyname(device))
        with subprocess.Popen([harness.program("modbus"), *arguments], stderr=subprocess.PIPE, text=True) as first:
            errors = first.communicate(timeout=20 * harness.PATIENCE)[1]
        self.assertEqual(first.returncode, 1)
        self.assertIn("no unit ever answered", errors)
        self.assertIn("unit 1 does not answer", errors)


if __name__ == "__main__":
    unittest.main(verbosity=2)
