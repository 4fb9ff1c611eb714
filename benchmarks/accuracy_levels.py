"""Measure what the three accuracies keep: ``python benchmarks/accuracy_levels.py``.

Hybrid on the 41 rows, independent errors; the largest error over seeds of a mean, sd, 5 or 95 %
quantile (in posterior sds, against a million importance draws) and of the log evidence
(against theirs); the largest relative error of a half-plane load of three textures; medians of the
CPU seconds of `compare` with one form.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time

import numpy as np

import ridgebayes as rb
from ridgebayes.inference.importance import Effort, importance_sample
from ridgebayes.inference.posterior import posterior_of
from ridgebayes.inference.presets import PRESETS
from ridgebayes.inference.target import ModelTarget
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.simulate.generation import LOAD_PRESETS

SEEDS = {"quick": 20, "standard": 20, "reference": 8}


def moments(theta: np.ndarray) -> np.ndarray:
    low, high = np.quantile(theta, [0.05, 0.95], axis=0)
    return np.stack([theta.mean(axis=0), theta.std(axis=0), low, high])


def all_draws(fit: rb.Fit) -> np.ndarray:
    return fit.model.to_theta(fit.chains.u.reshape(-1, fit.model.n_parameter))


def main() -> None:
    table = rb.paper_sweep()
    model = Model(Observations.from_table(table), rb.Hybrid())
    drawn = importance_sample(ModelTarget(model, 99), Effort(n_draw=65_536), 99)
    exact, log_evidence = all_draws(posterior_of(model, drawn, 99)), drawn.evidence.value
    expected, sd = moments(exact), exact.std(axis=0)
    scene = rb.Scene.of([(0.022, 0.02), (0.012, 0.09), (0.04, 0.004)], p_over_E=0.02)
    loads = rb.generate(scene, rel_tol=1e-12).column("p_over_E")
    print(f"{'accuracy':<10} {'CPU s':>6} {'moments':>8} {'ln Z':>8} {'loads':>8}  promised")
    for name, wanted in PRESETS.items():
        seconds, off, apart = [], [], []
        for seed in range(SEEDS[name]):
            start = time.process_time()
            found = rb.compare(table, [rb.Hybrid()], rng=seed, accuracy=wanted, noise="iid")
            seconds.append(time.process_time() - start)
            off.append(np.abs((moments(all_draws(found.fits["hybrid"])) - expected) / sd).max())
            used = found.evidence[found.evidence["used"]]["log_evidence"].iloc[0]
            apart.append(abs(used - log_evidence))
        error = np.abs(rb.generate(scene, accuracy=name).column("p_over_E") / loads - 1).max()
        print(
            f"{name:<10} {np.median(seconds[1:]):>6.2f} {max(off):>8.2g} {max(apart):>8.2g} "
            f"{error:>8.1g}  {wanted.moment_error:g}, {wanted.evidence_error:g}, "
            f"{LOAD_PRESETS[name].load_error:g}"
        )


if __name__ == "__main__":
    main()
