"""Posteriors with offsets drawn, not walked over: ``python benchmarks/student_offsets.py``.

Hybrid on the paper's textures, loads of the printed Hybrid with 1 % noise and three outliers,
Student errors; and small tables of brackets and counts. For each case a long run first: for one
shared factor an importance run whose likelihood is a sum over a fine grid of offsets,
which shares only the prior's scores with the package; for others the package's own with six
times the draws and twice the points. Then five seeds of `sample_posterior`: CPU seconds, ln
evidence less the long run's, the largest difference of a mean in posterior sds, the worst Pareto k.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import time

import numpy as np
import pandas as pd
from scipy import stats
from scipy.special import gammaln, logsumexp

import ridgebayes as rb
from ridgebayes.inference import importance_sampling
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.sampling import sample_posterior
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations

C1, C2 = 1.348, 0.01583  # printed Hybrid
FEW = ((0.012, 0.03), (0.022, 0.02), (0.032, 0.01))
OUTLIERS = (0.8, 1.25, 1.3)


def loads(frame: pd.DataFrame, rng: np.random.Generator) -> pd.Series:
    rate = C1 / (frame["a_over_R"] + frame["b_over_R"]) + C2 / frame["a_over_R"]
    noise = np.exp(0.01 * rng.standard_normal(len(frame)))
    return ((frame["Q"] / 2 - 1) / rate) ** 2 * noise


def sweep() -> pd.DataFrame:
    """Return nine textures, 41 rows, three of them outliers."""
    rng = np.random.default_rng(1)
    frame = rb.paper_sweep().calibration.frame[["a_over_R", "b_over_R", "Q"]].copy()
    frame["p_over_E"] = loads(frame, rng)
    hit = rng.choice(len(frame), len(OUTLIERS), replace=False)
    frame.loc[frame.index[hit], "p_over_E"] *= np.array(OUTLIERS)
    # Each row a curve of its own: an outlier may lie below the load of the count before it.
    return frame.assign(solver=[f"row {i}" for i in range(len(frame))])


def few(textures: int, Q: list[int], width: float = 0.0) -> pd.DataFrame:
    """Return some textures at some steps; brackets of a relative width."""
    frame = pd.DataFrame(
        [(*FEW[j], q) for j in range(textures) for q in Q], columns=["a_over_R", "b_over_R", "Q"]
    )
    frame["p_over_E"] = loads(frame, np.random.default_rng(4)) * (1 + width / 2)
    if width:
        frame["p_over_E_lower"] = frame["p_over_E"] / (1 + width)
    return frame


def counts() -> pd.DataFrame:
    """Return counts alone, eight loads of each of three textures."""
    rng, rows = np.random.default_rng(4), []
    for a, b in FEW:
        for p in np.geomspace(5e-4, 0.02, 8):
            reached = np.sqrt(p * np.exp(0.01 * rng.standard_normal())) * (C1 / (a + b) + C2 / a)
            rows.append((a, b, 2 * int(1 + reached), p, "count"))
    return pd.DataFrame(rows, columns=["a_over_R", "b_over_R", "Q", "p_over_E", "kind"])


CASES = {
    "step": (sweep, "step:student"),
    "texture": (sweep, "texture:student"),
    "texture+step": (sweep, "texture+step:student"),
    "step-smooth": (sweep, "step-smooth:student"),
    "24 brackets": (lambda: few(3, [4, 6, 8, 10, 12, 14, 16, 18], 0.02), "texture+step"),
    "counts": (counts, "texture+step"),
    "three rows": (lambda: few(3, [4]), "texture+step:student"),
    "one texture": (lambda: few(1, [4, 6, 8, 10, 12, 14]), "texture+step:student"),
}


def model_of(case: str) -> Model:
    make, noise = CASES[case]
    return Model(Observations.from_table(rb.read_table(make())), rb.Hybrid(), Noise.named(noise))


def log_likelihood_by_grid(model: Model, theta: np.ndarray) -> float:
    """Return the log-likelihood of Student rows that share one factor, with no package code."""
    data, (c1, c2, sigma, tau, df) = model.data, theta
    a, b = data.a_over_R[data.texture], data.b_over_R[data.texture]
    residual = data.log_load - 2 * np.log((data.Q / 2 - 1) / (c1 / (a + b) + c2 / a))
    group = data.texture if "texture" in model.noise.structure else data.Q
    z = np.linspace(-9, 9, 601)
    peak = gammaln(0.5 * (df + 1)) - gammaln(0.5 * df) - 0.5 * np.log(df * np.pi)
    total = 0.0
    for level in np.unique(group):
        off = (residual[group == level][:, None] - tau * z) / sigma
        rows = (peak - np.log(sigma) - 0.5 * (df + 1) * np.log1p(off * off / df)).sum(axis=0)
        total += logsumexp(rows + stats.norm.logpdf(z)) + np.log(z[1] - z[0])
    return total


def by_grid(model: Model, start: Posterior, n: int) -> tuple[float, float, np.ndarray]:
    """Return ln evidence, its standard error, and means: t draws about a posterior's, weighted."""
    u = start.coordinates[:, : model.n_parameter]
    d = u.shape[1]
    proposal = stats.multivariate_t(u.mean(axis=0), 1.3 * np.cov(u.T), df=6, seed=5)
    draws = proposal.rvs(n)
    theta = model.to_theta(draws)
    value = np.array([log_likelihood_by_grid(model, one) for one in theta])
    value += -0.5 * (draws**2).sum(axis=1) - 0.5 * d * np.log(2 * np.pi) - proposal.logpdf(draws)
    value = np.where(np.isnan(value), -np.inf, value)
    weight = np.exp(value - value.max())
    log_z = value.max() + np.log(weight.mean())
    return log_z, weight.std() / weight.mean() / np.sqrt(n), weight @ theta / weight.sum()


def reference(case: str, model: Model) -> tuple[float, float, np.ndarray]:
    if case in ("step", "texture"):
        return by_grid(model, sample_posterior(model, seed=99), 8_000)
    effort = {"n_draw": 16_384, "n_round": 4, "n_per_round": 1_000, "n_point": 256}
    fit, evidence = importance_posterior(model, seed=99, **effort)
    return evidence.value, evidence.se, fit.summary["mean"].to_numpy()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", default=list(CASES))
    worst: list[float] = []
    shape = importance_sampling.pareto_k

    def noted(log_weight: np.ndarray) -> float:
        worst.append(shape(log_weight))
        return worst[-1]

    print("case, ln evidence (se); then of each seed: CPU s, difference (se), sds, Pareto k")
    for case in parser.parse_args().cases:
        model = model_of(case)
        log_z, se, mean = reference(case, model)
        print(f"{case}: {log_z:.4f} ({se:.4f})", flush=True)
        importance_sampling.pareto_k = noted
        for seed in range(1, 6):
            worst.clear()
            begun = time.process_time()
            fit = sample_posterior(model, seed=seed)
            seconds = time.process_time() - begun
            assert fit.evidence is not None
            apart = np.abs(fit.summary["mean"] - mean) / fit.summary["sd"]
            print(
                f"  {seconds:5.1f} {fit.evidence.value - log_z:+.4f} ({fit.evidence.se:.4f}) "
                f"{apart.max():.3f} {max(worst):.2f} {'; '.join(fit.convergence_failures)}",
                flush=True,
            )
        importance_sampling.pareto_k = shape


if __name__ == "__main__":
    main()
