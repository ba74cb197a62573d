"""How holdfast-dbc ends: with its output on a device that is always full, and with a file that is no DBC file.

Exit status 0: each command ends with status 1 for the device, 2 for the file, and says why, and with 0 where all is well;
1 otherwise.
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
            wrong = subprocess.run([program, command[0], log, *command[2:]], capture_output=True, text=True, check=False)
            if wrong.returncode != 2 or "not one message was read" not in wrong.stderr or wrong.stdout:
                problems += 1
                print(f"{command[0]} of a log: status {wrong.returncode}: {wrong.stdout!r} {wrong.stderr!r}")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
