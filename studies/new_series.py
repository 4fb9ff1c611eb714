"""What bands for a new series can hold, in closed form: ``python -m studies.new_series``.

Loads of two series that differ by a constant alone, or by nothing, are averaged over as the package
does: with and without an offset per series, of the same prior probability and the default priors.
Nothing of the package is used. Given sigma and tau all is normal; both are summed over a grid.
"""

import argparse

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

SIGMA, TAU, MEAN = 0.05, 0.1, 0.2  # prior sds: half-normal, half-normal, normal of 2 ln c
PROB = 0.9
_HALF_NORMAL = norm.ppf(0.5 + (np.arange(40) + 0.5) / 80)  # of equal probability
_GRID = np.meshgrid(SIGMA * _HALF_NORMAL, np.append(0.0, TAU * _HALF_NORMAL), indexing="ij")
_SIGMA, _TAU = (x.ravel() for x in _GRID)
_LOG_PRIOR = np.log(np.where(_TAU == 0, 0.5, 0.5 / 40) / 40)


def covered(rng: np.random.Generator, n_row: int, share_of_series: float) -> tuple[float, float]:
    """Return the probability that a new load of a new series lies in a table's bands.

    By the average, and by offsets per series alone; the truth has them with `share_of_series`.
    """
    sigma = SIGMA * abs(rng.standard_normal())
    tau = TAU * abs(rng.standard_normal()) * (rng.random() < share_of_series)
    mean = MEAN * rng.standard_normal()
    n = np.array([n_row // 2, n_row - n_row // 2])
    offset = mean + tau * rng.standard_normal(2)
    at = offset + sigma / np.sqrt(n) * rng.standard_normal(2)  # the mean of each series
    squares = sigma**2 * rng.chisquare(n_row - 2)
    variance = _TAU**2 + _SIGMA**2 / n[:, None]
    precision = 1 / MEAN**2 + (1 / variance).sum(axis=0)
    centre = (at[:, None] / variance).sum(axis=0) / precision
    log_weight = (
        _LOG_PRIOR
        - 0.5 * np.log(variance.prod(axis=0) * precision)
        - 0.5 * ((at[:, None] ** 2 / variance).sum(axis=0) - centre**2 * precision)
        - (n_row - 2) * np.log(_SIGMA)
        - 0.5 * squares / _SIGMA**2
    )
    sd = np.sqrt(1 / precision + _TAU**2 + _SIGMA**2)
    true_sd = np.hypot(sigma, tau)
    found = []
    for counts in (np.full(_TAU.shape, True), _TAU > 0):
        weight = np.where(counts, np.exp(log_weight - logsumexp(log_weight[counts])), 0.0)
        ends = (_quantile(p, weight, centre, sd) for p in (0.5 - PROB / 2, 0.5 + PROB / 2))
        low, high = norm.cdf([(end - mean) / true_sd for end in ends])
        found.append(float(high - low))
    return found[0], found[1]


def _quantile(p: float, weight: np.ndarray, centre: np.ndarray, sd: np.ndarray) -> float:
    """Return a quantile of a mixture of normals, by bisection."""
    kept = weight > 1e-8
    weight, centre, sd = weight[kept], centre[kept], sd[kept]
    low, high = (centre - 9 * sd).min(), (centre + 9 * sd).max()
    for _ in range(40):
        middle = 0.5 * (low + high)
        below = weight @ norm.cdf((middle - centre) / sd) < p
        low, high = (middle, high) if below else (low, middle)
    return float(low)


def main() -> None:
    """Print shares, with standard errors by table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=1_000)
    n_table = parser.parse_args().tables
    for n_row in (20, 41, 200):
        for truth, share in (("series", 1.0), ("no series", 0.0), ("either", 0.5)):
            rng = np.random.default_rng([n_row, round(2 * share)])
            held = np.array([covered(rng, n_row, share) for _ in range(n_table)])
            mean, se = held.mean(axis=0), held.std(axis=0, ddof=1) / np.sqrt(n_table)
            print(
                f"{n_row} rows, truth {truth}: average {mean[0]:.3f} ({se[0]:.3f}), "
                f"series alone {mean[1]:.3f} ({se[1]:.3f})",
                flush=True,
            )


if __name__ == "__main__":
    main()
