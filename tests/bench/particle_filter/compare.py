#!/usr/bin/python3
"""compare.py BUILD_DIR [ROUNDS]: step time of the particle filter beside a vectorised numpy step.

M = 600 particles, 16 sensors, double precision, one thread, everything included: draws, likelihood,
estimate and resampling. Processor time, so that other programs' turns do not count. Ours and numpy's
are timed by turns in the same run, since a loaded machine slows both; each row is the median over
the rounds, with the least in brackets.
"""
import json
import os
import subprocess
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
import numpy as np  # noqa: E402  (the variables must be set first)

try:
    from scipy.special import erfc
    ERFC = "scipy.special.erfc"
except ImportError:
    def erfc(z):
        """Abramowitz and Stegun 7.1.26, error 1.5e-7: cheaper than a full one, which favours numpy."""
        a = np.abs(z)
        t = 1.0 / (1.0 + 0.3275911 * a)
        poly = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (
            -1.453152027 + t * 1.061405429))))
        value = poly * np.exp(-a * a)
        return np.where(z < 0.0, 2.0 - value, value)
    ERFC = "an approximation of 1.5e-7, python3-scipy is not there"

PARTICLES = 600
PAPER_US = 58400.0  # Table of the paper, M = 600, a 2.5 GHz PC
GOAL_US = {"exact": 117.0, "table": 45.0}


class NumpyFilter:
    """Algorithm 1 of paper 002 with the affine likelihood, all particles and sensors at once."""

    def __init__(self, size, seed=1):
        self.random = np.random.Generator(np.random.Philox(seed))
        self.size = size
        self.sensors = np.array([(x, y) for x in (10., 30., 50., 70.) for y in (10., 30., 50., 70.)])
        speed = 0.5 + 0.25 * self.random.standard_normal(size)
        heading = np.arctan2(3.0, 4.0) + np.pi / 6 * self.random.standard_normal(size)
        position = np.array([[15.0], [20.0]]) + 10.0 * self.random.standard_normal((2, size))
        self.state = np.vstack([position[0], speed * np.cos(heading),
                                position[1], speed * np.sin(heading)])
        xi = 0.045 ** 2
        lower = np.linalg.cholesky(xi * np.array([[1 / 3, 1 / 2], [1 / 2, 1]]))
        zero = np.zeros((2, 2))
        self.noise = np.block([[lower, zero], [zero, lower]])
        axis = np.array([[1.0, 1.0], [0.0, 1.0]])
        self.motion = np.block([[axis, zero], [zero, axis]])

    def step(self, y):
        phi = varphi = alpha = 0.1
        threshold, gain, noise_std = 0.3, 0.5, 0.1
        lie = (3.0 - threshold) / 6.0
        self.state = self.motion @ self.state + self.noise @ self.random.standard_normal((4, self.size))
        dx = self.state[0] - self.sensors[:, :1]
        dy = self.state[2] - self.sensors[:, 1:]
        excess = threshold - 4000.0 * (dx * dx + dy * dy) ** -1.4
        q = 0.425 * erfc(excess / np.sqrt(2 * 0.01)) + 0.075 * erfc(excess / np.sqrt(2 * 0.25))
        c0 = alpha + (1 - 2 * alpha) * (1 - phi) * varphi * lie
        c1 = c0 + (1 - 2 * alpha) * (1 - phi) * (1 - varphi)
        ratio = gain * (y - gain / 2) / noise_std ** 2
        top = np.maximum(ratio, 0.0)
        one, none = np.exp(ratio - top), np.exp(-top)
        miss, hit = c0 * one + (1 - c0) * none, c1 * one + (1 - c1) * none
        weights = np.prod(miss[:, None] + (hit - miss)[:, None] * q, axis=0)
        weights /= weights.sum()
        mean = self.state @ weights
        error = self.state - mean[:, None]
        covariance = (error * weights) @ error.T
        targets = (self.random.random() + np.arange(self.size)) / self.size
        ancestors = np.minimum(np.searchsorted(np.cumsum(weights), targets), self.size - 1)
        self.state = self.state[:, ancestors]
        return mean, covariance


def numpy_step_us(steps=300):
    random = np.random.default_rng(3)
    pf = NumpyFilter(PARTICLES)
    near = np.hypot(*(pf.sensors - (24.0, 26.0)).T) < 29.7
    used = 0.0
    for _ in range(steps):
        bit = near ^ (random.random(16) < 0.2)
        y = 0.5 * bit + 0.1 * random.standard_normal(16)
        start = time.process_time()
        pf.step(y)
        used += time.process_time() - start
    return used / steps * 1e6


def our_steps_us(program):
    command = [program, f"--benchmark_filter=/{PARTICLES}$", "--benchmark_format=json",
               "--benchmark_min_time=0.1"]
    run = subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    rows = json.loads(run.stdout)["benchmarks"]
    return {row["name"].rsplit("/", 1)[0]: row["cpu_time"] for row in rows}


def main():
    if not 2 <= len(sys.argv) <= 3:
        print(__doc__.splitlines()[0], file=sys.stderr)
        return 2
    program = os.path.join(sys.argv[1], "tests/bench/particle_filter/holdfast_bench_particle_filter")
    if not os.path.exists(program):
        print(f"compare.py: no {program}: build the target holdfast_bench_particle_filter first",
              file=sys.stderr)
        return 2
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else 5
    times = {}
    for _ in range(rounds):
        times.setdefault("numpy, vectorised", []).append(numpy_step_us())
        for name, value in our_steps_us(program).items():
            times.setdefault(name, []).append(value)
    median = {name: float(np.median(values)) for name, values in times.items()}
    numpy_us = median["numpy, vectorised"]
    print(f"M = {PARTICLES}, 16 sensors, one thread, processor time, {rounds} rounds; numpy with {ERFC}")
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors\n")
    print(f"{'step':<34}{'us (least)':>18}{'numpy / it':>12}{'paper / it':>12}   goal")
    print(f"{'paper (2.5 GHz PC)':<34}{PAPER_US:>10.0f}{'':>8}{numpy_us / PAPER_US:>12.4f}{1.0:>12.0f}")
    for name, value in median.items():
        kind = name.split("/")[1] if name.count("/") == 1 else ""
        is_portable = name.startswith("portable")
        goal = "" if kind not in GOAL_US or is_portable else \
            f"   {GOAL_US[kind]:.0f} us: {'met' if value <= GOAL_US[kind] else 'MISSED'}"
        print(f"{name:<34}{value:>10.1f} ({min(times[name]):.1f}){numpy_us / value:>10.1f}"
              f"{PAPER_US / value:>12.0f}{goal}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
