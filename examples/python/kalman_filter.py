#!/usr/bin/env python3
"""An estimator from outside: a Kalman filter on the centroid of the sensors that saw the target.

usage: kalman_filter.py LCM_URL NAME SCENARIO      (a scenario's `command:` fills in the three)

It reads MEASUREMENT and publishes EST_<NAME>; STATUS_<NAME> tells the launcher when it is ready. The message types
are those that the build makes (lcmtypes/generated/python) or `make install` puts into share/holdfast/python;
PYTHONPATH must name that folder.
"""
import sys
import time

import numpy
import yaml

from holdfast import estimate_t, measurement_set_t, status_t
from lcm_socket import LcmSocket


class CentroidKalmanFilter:
    """Constant velocity; a step's measurement is the mean position of the sensors whose bit is 1."""

    def __init__(self, model):
        t, intensity = model["step_s"], model["process_noise_intensity"]
        self.sensors = numpy.array(model["sensor_positions_m"], dtype=float)
        self.F = numpy.kron(numpy.eye(2), [[1, t], [0, 1]])
        self.Q = intensity * numpy.kron(numpy.eye(2), [[t**3 / 3, t**2 / 2], [t**2 / 2, t]])
        self.H = numpy.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
        prior = model["prior"]
        speed, heading = prior["speed_mean_mps"], prior["heading_mean_rad"]
        x, y = prior["position_mean_m"]
        self.mean = numpy.array([x, speed * numpy.cos(heading), y, speed * numpy.sin(heading)])
        position, velocity = prior["position_std_m"] ** 2, prior["speed_std_mps"] ** 2
        self.covariance = numpy.diag([position, velocity, position, velocity])
        self.innovation, self.innovation_covariance = numpy.zeros(0), numpy.zeros((0, 0))

    def step(self, packets):
        """packets: (sensor index, value) of every packet of the step."""
        self.mean = self.F @ self.mean
        self.covariance = self.F @ self.covariance @ self.F.T + self.Q
        seen = [s for s, value in packets if value > 0.25 and 0 <= s < len(self.sensors)]
        if not seen:
            self.innovation, self.innovation_covariance = numpy.zeros(0), numpy.zeros((0, 0))
            return
        # A sensor reaches about 30 m, so one that saw the target is off by some 20 m in each axis.
        R = numpy.eye(2) * 20.0**2 / len(seen)
        innovation = self.sensors[seen].mean(axis=0) - self.H @ self.mean
        S = self.H @ self.covariance @ self.H.T + R
        gain = numpy.linalg.solve(S, self.H @ self.covariance).T
        self.mean = self.mean + gain @ innovation
        self.covariance = self.covariance - gain @ S @ gain.T
        self.innovation, self.innovation_covariance = innovation, S


def make_estimate(measurement, kalman_filter, seq):
    message = estimate_t()
    message.utime, message.seq, message.step = measurement.utime, seq, measurement.step
    message.measurement_seq = measurement.seq
    message.attack_probability, message.input_step = -1.0, -1
    message.num_states, message.mean = 4, kalman_filter.mean.tolist()
    message.num_covariance, message.covariance = 16, kalman_filter.covariance.flatten().tolist()
    message.num_innovation, message.innovation = len(kalman_filter.innovation), kalman_filter.innovation.tolist()
    message.innovation_covariance = kalman_filter.innovation_covariance.flatten().tolist()
    message.num_innovation_covariance = len(message.innovation_covariance)
    return message


def main():
    if len(sys.argv) != 4:
        print(__doc__, file=sys.stderr)
        return 2
    url, name, scenario_file = sys.argv[1:]
    with open(scenario_file, encoding="utf-8") as stream:
        scenario = yaml.safe_load(stream)
    kalman_filter = CentroidKalmanFilter(scenario["plant"]["model"])
    link = LcmSocket(url)
    status = status_t()
    status.name, status.state = name, status_t.READY
    step = 0
    while step < scenario["steps"]:
        status.utime, status.step = int(time.time() * 1e6), step
        link.publish(f"STATUS_{name.upper()}", status.encode())
        status.seq += 1
        next_status = time.monotonic() + 0.25
        while step < scenario["steps"] and time.monotonic() < next_status:
            received = link.receive(timeout_s=0.1)
            if received is None or received[0] != "MEASUREMENT":
                continue
            try:
                measurement = measurement_set_t.decode(received[1])
            except Exception as error:  # whatever a hostile datagram makes the decoder raise
                print(f"refused a MEASUREMENT: {error}", file=sys.stderr)
                continue
            if measurement.step != step + 1:
                continue
            step = measurement.step
            kalman_filter.step([(p.source, p.values[0]) for p in measurement.packets if p.num_values])
            link.publish(f"EST_{name.upper()}", make_estimate(measurement, kalman_filter, step - 1).encode())
    return 0


sys.exit(main())
