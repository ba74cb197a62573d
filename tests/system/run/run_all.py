"""Runs test files one after the other and fails when one does: run_all.py FILE..."""
import subprocess
import sys

failed = [path for path in sys.argv[1:] if subprocess.run([sys.executable, path]).returncode != 0]
for path in failed:
    print(f"failed: {path}", file=sys.stderr)
sys.exit(1 if failed else 0)
