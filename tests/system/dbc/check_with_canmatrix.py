"""Decodes random payloads of every message of DBC files with canmatrix and with dbc_dump, and compares.

Exit status 0: all agree; 1: they do not, or the comparison could not have told.
"""
import argparse
import json
import math
import random
import subprocess
import sys

import canmatrix.formats

# raw * scale + offset: canmatrix in decimal and rounded once, ours in binary and rounded twice.
# Both roundings are relative to the larger of product and result, hence the offset in the bound.
RELATIVE_TOLERANCE = 4 * sys.float_info.epsilon


def file_identifier(frame):
    return frame.arbitration_id.id | (0x80000000 if frame.arbitration_id.extended else 0)


def with_canmatrix(frame, payload):
    decoded = frame.decode(payload)
    return {name: (float(value.phys_value), float(value.signal.offset)) for name, value in decoded.items()}


def payloads(frame, count, generator):
    yield bytes(frame.size)
    yield b"\xff" * frame.size
    for _ in range(count):
        yield bytes(generator.randrange(256) for _ in range(frame.size))


def difference(ours, theirs):
    """Text of the first difference; None when both agree."""
    if set(ours) != set(theirs):
        return f"signals {sorted(ours)} against {sorted(theirs)}"
    for name, (expected, offset) in theirs.items():
        value = ours[name]
        if math.isnan(expected) and math.isnan(value) or value == expected:
            continue
        if not abs(value - expected) <= RELATIVE_TOLERANCE * (abs(expected) + abs(offset)):
            return f"{name}: {value!r} against {expected!r}"
    return None


def check(dump, file, count, generator):
    """Number of problems."""
    matrix = canmatrix.formats.loadp_flat(file)
    cases = [(frame, payload) for frame in matrix.frames for payload in payloads(frame, count, generator)]
    lines = "".join(f"{file_identifier(frame)} {payload.hex()}\n" for frame, payload in cases)
    output = subprocess.run([dump, file], input=lines, capture_output=True, text=True, check=False)
    if output.returncode != 0:
        print(f"{file}: dbc_dump failed\n{output.stderr}")
        return 1
    answers = [json.loads(line) for line in output.stdout.splitlines()]
    if not cases or len(answers) != len(cases):
        print(f"{file}: {len(answers)} answers to {len(cases)} payloads")
        return 1
    problems = 0
    told_apart = set()
    for (frame, payload), ours in zip(cases, answers):
        found = difference(ours, with_canmatrix(frame, payload))
        if found:
            problems += 1
            print(f"{file}: {frame.name} {payload.hex()}: {found}")
        # Negative control: the inverted payload must not pass for the same.
        inverted = bytes(255 - byte for byte in payload)
        if difference(ours, with_canmatrix(frame, inverted)):
            told_apart.add(frame.name)
    blind = {frame.name for frame in matrix.frames} - told_apart
    if blind:
        problems += 1
        print(f"{file}: the comparison tells nothing about {sorted(blind)}")
    print(f"{file}: {len(matrix.frames)} messages, {len(cases)} payloads, {problems} problems")
    return problems


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dump", required=True, help="the program dbc_dump")
    parser.add_argument("--count", type=int, default=200, help="random payloads per message")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("files", nargs="+")
    options = parser.parse_args()
    generator = random.Random(options.seed)
    problems = sum(check(options.dump, file, options.count, generator) for file in options.files)
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
