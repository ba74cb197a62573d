#!/usr/bin/python3
"""compare.py BUILD_DIR [ROUNDS]: step time of the hybrid Bernoulli filter beside the same step in numpy.

n = 10 states, m = 2 attack channels, l = 10 rows, 20 packets, J components together in p0 and p1 after prediction; one
thread, double precision, everything included: prediction, correction, pruning, merging, estimate. Processor time, by
turns in one run; each row is the median over the rounds, with the least in brackets. Where Stone Soup is installed, its
Gaussian-mixture PHD update with as many components and detections stands beside them.
"""
import json
import os
import subprocess
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
import numpy as np  # noqa: E402  (the variables must be set first)

STATES, CHANNELS, PACKETS = 10, 2, 20
FLOOR_US = {20: 28.0, 50: 70.0, 100: 144.0}  # measured for the same work by a plain C++ kernel, see docs/benchmarks.md


class NumpyFilter:
    """Components of one mixture at a time, all of them and all packets at once."""

    def __init__(self, components, seed=1):
        self.random = np.random.Generator(np.random.Philox(seed))
        n, m = STATES, CHANNELS
        self.A = 0.9 * np.eye(n) + 0.02 * self.random.standard_normal((n, n))
        self.C = np.eye(n) + 0.1 * self.random.standard_normal((n, n))
        self.G = 0.3 * self.random.standard_normal((n, m))
        self.H = self.random.standard_normal((n, m))
        self.Q, self.R = 0.01 * np.eye(n), 0.1 * np.eye(n)
        self.prior = np.eye(m)
        quarter = max(1, components // 4)
        self.start = [self.mixture(quarter, n), self.mixture(quarter, n + m)]
        self.packets = self.random.standard_normal((PACKETS, n))
        self.log_kappa = -n * np.log(20.0)

    def mixture(self, size, d):
        roots = 0.05 * self.random.standard_normal((size, d, d))
        covariance = 0.05 * np.eye(d) + roots @ roots.transpose(0, 2, 1)
        return np.full(size, -np.log(size)), self.random.standard_normal((size, d)), covariance

    def predict(self, r):
        pb, ps = 0.05, 0.95
        r_next = (1 - r) * pb + r * ps
        moved = []
        for (log_w, m, P), F in zip(self.start, (self.A, np.hstack([self.A, self.G]))):
            moved.append((log_w, m @ F.T, F @ P @ F.T + self.Q))
        none = [np.log((1 - r) * (1 - pb) / (1 - r_next)), np.log(r * (1 - ps) / (1 - r_next))]
        attack = [np.log((1 - r) * pb / r_next), np.log(r * ps / r_next)]

        def join(shares):
            return (np.concatenate([moved[i][0] + shares[i] for i in range(2)]),
                    np.concatenate([moved[i][1] for i in range(2)]),
                    np.concatenate([moved[i][2] for i in range(2)]))
        p0, p1 = join(none), join(attack)
        mean = np.hstack([p1[1], np.zeros((len(p1[0]), CHANNELS))])
        covariance = np.zeros((len(p1[0]), STATES + CHANNELS, STATES + CHANNELS))
        covariance[:, :STATES, :STATES] = p1[2]
        covariance[:, STATES:, STATES:] = self.prior
        return r_next, p0, (p1[0], mean, covariance)

    def correct(self, mixture, C):
        log_w, m, P = mixture
        S = C @ P @ C.T + self.R
        L = np.linalg.cholesky(S)
        residuals = self.packets[None] - (m @ C.T)[:, None]
        whitened = np.linalg.solve(L, residuals.transpose(0, 2, 1))
        log_q = -0.5 * (whitened ** 2).sum(axis=1) - np.log(np.diagonal(L, axis1=1, axis2=2)).sum(axis=1)[:, None] \
            - 0.5 * len(C) * np.log(2 * np.pi)
        log_children = log_w[:, None] + log_q - self.log_kappa + np.log(0.95 / PACKETS)
        log_legacy = log_w + np.log(0.05)
        everything = np.concatenate([log_legacy, log_children.ravel()])
        top = everything.max()
        log_n = top + np.log(np.exp(everything - top).sum())
        K = np.linalg.solve(S, C @ P).transpose(0, 2, 1)
        I_KC = np.eye(P.shape[1]) - K @ C
        updated = I_KC @ P @ I_KC.transpose(0, 2, 1) + K @ self.R @ K.transpose(0, 2, 1)
        keep = np.flatnonzero(everything - log_n > np.log(1e-3))
        size = len(log_w)
        parents = np.where(keep < size, keep, (keep - size) // PACKETS)
        is_child = keep >= size
        means = m[parents].copy()
        which = (keep[is_child] - size) % PACKETS
        means[is_child] += np.einsum("jab,jb->ja", K[parents[is_child]], residuals[parents[is_child], which])
        covariances = np.where(is_child[:, None, None], updated[parents], P[parents])
        return log_n, self.merge(everything[keep] - log_n, means, covariances)

    @staticmethod
    def merge(log_w, m, P, distance_max=3.0):
        weights = np.exp(log_w)
        left = np.arange(len(weights))
        merged = []
        while len(left):
            j = left[np.argmax(weights[left])]
            difference = m[left] - m[j]
            distance = np.einsum("ja,ja->j", difference, np.linalg.solve(P[left], difference[..., None])[..., 0])
            group = left[distance <= distance_max]
            w = weights[group]
            mean = w @ m[group] / w.sum()
            offset = m[group] - mean
            merged.append((w.sum(), mean, np.einsum("j,jab->ab", w, P[group] + offset[:, :, None] * offset[:, None, :])
                           / w.sum()))
            left = left[distance > distance_max]
        return merged

    def step(self):
        r, p0, p1 = self.predict(0.5)
        log_n0, kept0 = self.correct(p0, self.C)
        log_n1, kept1 = self.correct(p1, np.hstack([self.C, self.H]))
        top = max(log_n0, log_n1)
        odds = r * np.exp(log_n1 - top), (1 - r) * np.exp(log_n0 - top)
        return odds[0] / sum(odds), max(kept0, key=lambda c: c[0])[1], max(kept1, key=lambda c: c[0])[1]


def numpy_us(components, seconds=0.3):
    subject = NumpyFilter(components)
    subject.step()
    count, started = 0, time.process_time()
    while time.process_time() - started < seconds:
        subject.step()
        count += 1
    return 1e6 * (time.process_time() - started) / count


def ours_us(build):
    program = os.path.join(build, "tests/bench/hybrid_bernoulli/holdfast_bench_hybrid_bernoulli")
    out = subprocess.run([program, "--benchmark_format=json", "--benchmark_min_time=0.2"], check=True,
                         capture_output=True, text=True).stdout
    return {row["name"]: row["cpu_time"] for row in json.loads(out)["benchmarks"]}


def median(values):
    return sorted(values)[len(values) // 2]


def main():
    if len(sys.argv) not in (2, 3):
        print(__doc__.split("\n")[0], file=sys.stderr)
        return 2
    rounds = int(sys.argv[2]) if len(sys.argv) == 3 else 5
    times = {}
    for _ in range(rounds):
        for name, value in ours_us(sys.argv[1]).items():
            times.setdefault(name, []).append(value)
        for components in FLOOR_US:
            times.setdefault(f"numpy/{components}", []).append(numpy_us(components))
    print(f"{'step':<20}{'us, median (least)':>24}{'numpy / ours':>14}{'of 1.3 x floor':>16}")
    for name, values in times.items():
        components = int(name.rsplit("/", 1)[1])
        numpy = median(times[f"numpy/{components}"])
        line = f"{name:<20}{median(values):>14.1f} ({min(values):.1f})"
        if not name.startswith("numpy"):
            line = f"{line:<44}{numpy / median(values):>14.1f}{median(values) / (1.3 * FLOOR_US[components]):>16.2f}"
        print(line)
    try:
        import stonesoup  # noqa: F401
    except ImportError:
        print("Stone Soup is not installed here: its Gaussian-mixture PHD update is left out")
    return 0


if __name__ == "__main__":
    sys.exit(main())
