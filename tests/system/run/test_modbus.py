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
        for who in self.paths:
            self.plug(who)
        self.num_requests = 0
        self.tamper = lambda unit, number, answer: answer
        self.is_stopped = False
        self.thread = threading.Thread(target=self.carry)
        self.thread.start()

    def plug(self, who):
        controller, device = os.openpty()
        tty.setraw(device)
        with self.lock:
            if os.path.islink(self.paths[who]):
                os.remove(self.paths[who])
            os.symlink(os.ttyname(device), self.paths[who])
            self.descriptors[who] = (controller, device)

    def pull(self, who):
        """Whoever has it open is hung up on."""
        with self.lock:
            for descriptor in self.descriptors.pop(who):
                os.close(descriptor)

    def carry(self):
        pending = b""
        while not self.is_stopped:
            with self.lock:
                pending = self.carry_what_came(pending)

    def carry_what_came(self, pending):
        """Hands on the answers and whole requests that are there; returns what has come of the next request."""
        owners = {pair[0]: who for who, pair in self.descriptors.items()}
        for descriptor in select.select(list(owners), [], [], 0.005)[0]:
            data = os.read(descriptor, 256)
            if owners[descriptor] == "gateway":
                pending += data
            elif "gateway" in self.descriptors:
                answer = self.tamper(owners[descriptor], self.num_requests, data)
                os.write(self.descriptors["gateway"][0], answer)
        while len(pending) >= self.REQUEST_BYTES:
            self.num_requests += 1
            request, pending = pending[:self.REQUEST_BYTES], pending[self.REQUEST_BYTES:]
            if request[0] in self.units:
                os.write(self.descriptors[request[0]][0], request)
        return pending

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
        """Of processes that publish a status; what else comes is kept."""
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
        plant = self.spawn("plant", SCENARIO, *options, "--bus", PLANT_BUS)
        self.wait_until_ready("PLANT")
        gateway = self.spawn("modbus", SCENARIO, *options, "--line", line.paths["gateway"], "--bus", GATEWAY_BUS)
        measured, estimates, counters = {}, {}, {}
        deadline = time.monotonic() + 60 * harness.PATIENCE
        while len(estimates) < self.num_steps or gateway.poll() is None:
            self.assertLess(time.monotonic(), deadline, f"{len(measured)} sets, {len(estimates)} estimates came")
            message = self.link.receive(timeout_s=0.2)
            if message is None:
                continue
            channel, payload = message
            if channel == "MEASUREMENT":
                received = harness.holdfast.measurement_set_t.decode(payload)
                measured[received.step] = received
                on_set(line, received.step)
            elif channel == "EST_SECURE":
                estimate = harness.holdfast.estimate_t.decode(payload)
                estimates[estimate.step] = (estimate.mean, estimate.covariance)
            elif channel == "STATUS_MODBUS":
                status = harness.holdfast.status_t.decode(payload)
                counters = dict(zip(status.counter_name, status.counter_value))
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
        return sets(steps=self.num_steps, attacks="[]", period_s=0.02, network__sensor_options__modbus_timeout_s=1.0, **values)

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
        options += sets(network__sensor_options__modbus_timeout_s=0.3)
        measured, estimates, counters = self.run_over_line(options)
        missing = {step: what[1] for step, what in self.what(measured).items() if what[1]}
        self.assertEqual(missing, {step: [(source, REASON.NOT_AVAILABLE) for source in range(8, 16)] for step in (20, 21, 22)})
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

    def test_broken_answers_exceptions_and_a_line_that_is_gone_are_told_apart(self):
        """Requests come in pairs, for unit 1 and unit 2; the line is pulled and put back between steps."""
        def tamper(unit, number, answer):
            if number in (21, 23):  # unit 1 in steps 11 and 12
                return answer[:-1] + bytes([answer[-1] ^ 0x10])
            if number == 32:  # unit 2 in step 16
                return with_checksum(bytes([2, 0x82, 0x04]))
            return answer

        gone = []

        def on_set(line, step):
            if step == 30:
                line.pull("gateway")
            elif step > 30 and not gone and "gateway" not in line.descriptors:
                gone.append(step)
                line.plug("gateway")

        measured, _, counters = self.run_over_line(self.options(network__sensor_options__outages="[]"), on_set, tamper)
        missing = {step: what[1] for step, what in self.what(measured).items() if what[1]}
        first, second = range(8), range(8, 16)
        self.assertEqual({step: missing[step] for step in missing if step < 30},
                         {11: [(s, REASON.FAULTY) for s in first], 12: [(s, REASON.FAULTY) for s in first],
                          16: [(s, REASON.FAULTY) for s in second]})
        self.assertEqual((counters["broken_answers"], counters["exceptions"]), (2, 1))
        away = [step for step in missing if step > 30]
        self.assertIn(gone[0], away)
        self.assertLess(away[-1], self.num_steps, "the line did not come back")
        self.assertEqual(away, list(range(away[0], away[-1] + 1)))
        self.assertEqual(missing[gone[0]], [(s, REASON.NOT_AVAILABLE) for s in range(16)])

    def test_the_checksum_is_that_of_published_examples(self):
        self.assertEqual(with_checksum(bytes.fromhex("630200010006")).hex(), "630200010006a18a")
        self.assertEqual(with_checksum(bytes.fromhex("018202")).hex(), "018202c161")

    def test_what_cannot_be_is_said(self):
        for arguments, text in (
                (["--serve", "3", "--line", "x"], "its units are: 1, 2"),
                (["--line", "x@17"], "no line of 17 baud"),
                (["--line", "x?parity=mark"], "expected DEVICE"),
                (["--serve", "1", "--line", self.path("none")], "cannot be opened")):
            status, _, errors = harness.call("modbus", SCENARIO, "--bus", PLANT_BUS, *arguments)
            self.assertIn(text, errors)
            self.assertIn(status, (1, 2))
        status, _, errors = harness.call("modbus", harness.TRACKING, "--bus", PLANT_BUS, "--line", "x")
        self.assertIn("no sensor on Modbus", errors)
        self.assertEqual(status, 2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
