#!/usr/bin/env python3
"""A plant from outside: a target on a straight line and noise-free binary sensors, sent with python-can.

usage: straight_plant.py LCM_URL SENSOR_BUS SCENARIO      (a scenario's `plant.command` fills in the three)

Sends the frame of each sensor and then the tick, once per period, and publishes PLANT_TRUTH. PYTHONPATH must name the
folder of the message types, as for kalman_filter.py.
"""
import struct
import sys
import time

import can
import numpy
import yaml

from holdfast import truth_t
from lcm_socket import LcmSocket

SENSOR_IDENTIFIER, TICK_IDENTIFIER = 0x101, 0x7F0   # as binary_sensors.dbc has them


def open_bus(url):
    kind, _, rest = url.partition(":")
    if kind == "socketcan":
        return can.Bus(interface="socketcan", channel=rest)
    group, _, port = rest.rpartition(":")
    return can.Bus(interface="udp_multicast", channel=group, port=int(port))


def main():
    if len(sys.argv) != 4:
        print(__doc__, file=sys.stderr)
        return 2
    url, bus_url, scenario_file = sys.argv[1:]
    with open(scenario_file, encoding="utf-8") as stream:
        scenario = yaml.safe_load(stream)
    plant, model = scenario["plant"], scenario["plant"]["model"]
    sensors = numpy.array(model["sensor_positions_m"], dtype=float)
    state = numpy.array(plant["start_state"], dtype=float)
    link = LcmSocket(url)
    truth = truth_t()
    next_time = time.monotonic()
    with open_bus(bus_url) as bus:
        for step in range(1, scenario["steps"] + 1):
            next_time += scenario["period_s"]
            time.sleep(max(0.0, next_time - time.monotonic()))
            state[[0, 2]] += model["step_s"] * state[[1, 3]]
            distance = numpy.hypot(sensors[:, 0] - state[0], sensors[:, 1] - state[2])
            energy = model["source_power"] * (distance / model["reference_distance_m"]) ** -model["decay_exponent"]
            truth.utime, truth.seq, truth.step = round(step * model["step_s"] * 1e6), step - 1, step
            truth.num_states, truth.state = 4, state.tolist()
            link.publish("PLANT_TRUTH", truth.encode())
            for sensor, is_seen in enumerate(energy > model["threshold"]):
                bus.send(can.Message(arbitration_id=SENSOR_IDENTIFIER + sensor, is_extended_id=False,
                                     data=struct.pack("<BH", int(is_seen), step & 0xFFFF)))
            bus.send(can.Message(arbitration_id=TICK_IDENTIFIER, is_extended_id=False, data=struct.pack("<I", step)))
    return 0


sys.exit(main())
