"""Records what simulated CANopen and J1939 sensors send, and compares with what tshark makes of the recording.

Exit status 0: all agree; 1: they do not, or the comparison could not have told.
"""
import re
import subprocess
import sys
import tempfile

STATES = {0x00: "Boot-up", 0x05: "Operational"}
LINE = re.compile(r"\(\d+\.\d+\) \S+ ([0-9A-F]+)#([0-9A-F]*)$")


def record(plant, scenario, file, *settings):
    """[(identifier, is_extended, bytes)] of a simulated run."""
    options = [part for setting in settings for part in ("--set", setting)]
    subprocess.run([plant, scenario, "--bus", f"candump-write:{file}", "--set", "period_s=0", *options], check=True)
    with open(file, encoding="ascii") as stream:
        found = [LINE.match(line) for line in stream]
    return [(int(match[1], 16), len(match[1]) == 8, bytes.fromhex(match[2])) for match in found]


def dissect(file, dissector, *fields):
    """The fields of each frame, as text."""
    command = ["tshark", "-r", file, "-d", f"can.subdissector,{dissector}", "-T", "fields", "-E", "separator=\t",
               *(part for field in fields for part in ("-e", field))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [line.split("\t") for line in done.stdout.splitlines()]


def check_canopen(frames, rows):
    problems, seen = [], set()
    for (identifier, is_extended, data), (number, length, info) in zip(frames, rows, strict=True):
        if (int(number), int(length)) != (identifier, len(data)) or is_extended:
            problems.append(f"{identifier:03X}: {number} of {length} bytes")
        node = identifier & 0x7F
        if identifier & 0x780 == 0x700 and identifier != 0x7F0:
            expected = f"NMT Error Control: {STATES[data[0]]} [0x{node:x}]"
        elif identifier & 0x780 == 0x180:
            expected = "PDO1 (tx)"
        else:
            continue
        seen.add(expected)
        if expected not in info:
            problems.append(f"{identifier:03X}#{data.hex()}: {info!r}, not {expected!r}")
    # Two nodes booted, ran and told their inputs, or nothing was compared.
    return problems + ([] if len(seen) == 5 else [f"only {sorted(seen)} were seen"])


def check_j1939(frames, rows):
    problems, groups = [], set()
    for (identifier, is_extended, data), (number, pgn, source, priority, bytes_text) in zip(frames, rows, strict=True):
        if int(number) != identifier:
            problems.append(f"{identifier:X}: {number}")
        if not is_extended:
            continue
        groups.add((int(pgn), int(source), int(priority)))
        if bytes.fromhex(bytes_text.replace(":", "")) != data:
            problems.append(f"{identifier:X}: bytes {bytes_text}")
    expected = {(127501, 33, 3), (65241, 34, 6)}
    return problems + ([] if groups == expected else [f"groups {groups}, not {expected}"])


def main(plant, scenarios):
    sensors = [f"{{j1939: {{pgn: 127501, source: 33, instance: 0, item: {item}}}}}" for item in range(1, 9)]
    sensors += [f"{{j1939: {{pgn: 65241, source: 34, start_bit: {2 * item}}}}}" for item in range(8)]
    network = ("network={sensor_bus: auto, monitor_bus: auto, dbc: binary_sensors.dbc, "
               f"tick: {{message: StepTick, signal: STEP}}, sensors: [{', '.join(sensors)}]}}")
    with tempfile.TemporaryDirectory() as folder:
        canopen, j1939 = f"{folder}/canopen.log", f"{folder}/j1939.log"
        frames = record(plant, f"{scenarios}/binary_canopen.yaml", canopen)
        problems = check_canopen(frames, dissect(canopen, "canopen", "can.id", "can.len", "_ws.col.Info"))
        frames = record(plant, f"{scenarios}/binary_tracking.yaml", j1939, network, "attacks=[]")
        problems += check_j1939(frames, dissect(j1939, "j1939", "can.id", "j1939.pgn", "j1939.src_addr", "j1939.priority",
                                                "j1939.data"))
    for problem in problems[:20]:
        print(problem)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
