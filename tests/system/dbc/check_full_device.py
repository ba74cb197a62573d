"""Runs holdfast-dbc with its output on a device that is always full.

Exit status 0: each command then ends with status 1 and says why, and with 0 where the output goes somewhere; 1 otherwise.
"""
import os
import subprocess
import sys
import tempfile

DBC = 'BO_ 5 X: 1 A\n SG_ S : 0|8@1+ (1,0) [0|255] "" A\n'
EXPECTED = "holdfast-dbc: the output cannot be written\n"


def main():
    program = sys.argv[1]
    problems = 0
    with tempfile.TemporaryDirectory() as folder:
        dbc, log = os.path.join(folder, "x.dbc"), os.path.join(folder, "x.log")
        for name, text in ((dbc, DBC), (log, "(1.000000) can0 005#01\n")):
            with open(name, "w", encoding="utf-8") as file:
                file.write(text)
        for command in (["list", dbc], ["encode", dbc, "X", "S=1"], ["decode", dbc, log]):
            with open("/dev/full", "wb") as full:
                lost = subprocess.run([program, *command], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
            kept = subprocess.run([program, *command], capture_output=True, text=True, check=False)
            if lost.returncode != 1 or not lost.stderr.endswith(EXPECTED):
                problems += 1
                print(f"{command[0]}: status {lost.returncode} on a full device: {lost.stderr!r}")
            if kept.returncode != 0 or not kept.stdout:
                problems += 1
                print(f"{command[0]}: status {kept.returncode}: {kept.stdout!r} {kept.stderr!r}")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
