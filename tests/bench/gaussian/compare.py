#!/usr/bin/python3
"""compare.py BUILD_DIR [ROUNDS]: step time of the filters with one Gaussian beside the same steps in numpy.

One thread, double precision, log-likelihood included. Processor time, by turns in one run; each row is the median over the
rounds, with the least in brackets.
"""
import json
import os
import subprocess
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
import numpy as np  # noqa: E402  (the variables must be set first)

STEPS = 400
LANE_RUNS = 128
# benchmark, unit, goal, what the goal is
ROWS = [
    ("step/kalman/4x2", "ns", 70.0, "Kalman step, n = 4, l = 2"),
    ("step/gslr/4x2", "ns", None, "gslr step (at most 3 Kalman steps)"),
    ("step/attack_mixture/4x2", "ns", None, "attack_mixture step (at most 8)"),
    ("step/kalman/12x12", "ns", 1000.0, "Kalman step, n = 12, l = 12"),
    ("lanes/kalman/4x2", "ns", 10.0, "Kalman step, n = 4, l = 2, one of 128 in lanes"),
    ("lanes/kalman/12x12", "ns", None, "Kalman step, n = 12, l = 12, one of 128 in lanes"),
    ("run/kalman_rts/4x2", "us", 60.0, "400 Kalman steps and smoother, n = 4"),
    ("run/attack_mixture_rts/4x2", "us", None, "400 attack_mixture steps and smoother"),
    ("run/attack_mixture_ep3/4x2", "us", None, "the same, expectation propagation, 3 passes"),
]


def numpy_model(n, l):
    random = np.random.Generator(np.random.Philox(1))
    A = 0.9 * np.eye(n) + 0.02 * random.standard_normal((n, n))
    H = np.eye(l, n) + 0.1 * random.standard_normal((l, n))
    return A, H, 0.01 * np.eye(n), 0.1 * np.eye(l), 20.0 + random.standard_normal((STEPS, l))


def numpy_kalman(n, l):
    """Seconds of processor time per step, Joseph form, log-likelihood included."""
    A, H, Q, R, y = numpy_model(n, l)
    m, P, total = np.zeros(n), np.eye(n), 0.0
    started = time.process_time()
    for k in range(STEPS):
        m, P = A @ m, A @ P @ A.T + Q
        S = H @ P @ H.T + R
        L = np.linalg.cholesky(S)
        nu = y[k] - H @ m
        K = np.linalg.solve(S, H @ P).T
        keep = np.eye(n) - K @ H
        m, P = m + K @ nu, keep @ P @ keep.T + K @ R @ K.T
        white = np.linalg.solve(L, nu)
        total -= 0.5 * (white @ white + l * np.log(2 * np.pi)) + np.log(np.diag(L)).sum()
    return (time.process_time() - started) / STEPS


def ours(build, rounds):
    program = os.path.join(build, "tests", "bench", "gaussian", "holdfast_bench_gaussian")
    times = {}
    for _ in range(rounds):
        output = subprocess.run([program, "--benchmark_format=json", "--benchmark_min_time=0.2"], check=True,
                                capture_output=True, text=True).stdout
        for entry in json.loads(output)["benchmarks"]:
            per = {"step": STEPS, "lanes": STEPS * LANE_RUNS, "run": 1}[entry["name"].split("/")[0]]
            scale = 1.0 if per == 1 else 1000.0  # us to ns
            times.setdefault(entry["name"], []).append(entry["cpu_time"] * scale / per)
    return times


def main():
    if len(sys.argv) < 2:
        print(__doc__)
        return 2
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    times = ours(sys.argv[1], rounds)
    kalman = np.median(times["step/kalman/4x2"])
    print(f"{'':48} {'median':>9} {'least':>9} {'goal':>7} {'Kalman steps':>13}")
    for name, unit, goal, text in ROWS:
        median, least = np.median(times[name]), min(times[name])
        steps = f"{median / kalman:13.2f}" if unit == "ns" else " " * 13
        print(f"{text:48} {median:6.1f} {unit} {least:6.1f} {unit} {goal if goal else '':>7} {steps}")
    for n, l in ((4, 2), (12, 12)):
        best = sorted(numpy_kalman(n, l) for _ in range(rounds))[rounds // 2]
        print(f"{f'numpy Kalman step, n = {n}, l = {l}':48} {1e9 * best:6.0f} ns")
    return 0


if __name__ == "__main__":
    sys.exit(main())
