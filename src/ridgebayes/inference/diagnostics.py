"""Convergence diagnostics of ensembles, leave-one-out scores, and the arviz view of a fit.

The walkers of an ensemble depend on each other and do not count as separate chains: their
autocorrelation functions are averaged, which gives one autocorrelation time per ensemble.

arviz has two incompatible release lines: 0.x (Python 3.11) uses `InferenceData`, 1.x (Python 3.12
and later) uses xarray's `DataTree`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import fft
from scipy.special import logsumexp, ndtri

from ridgebayes._types import FloatArray
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.pareto_smoothing import (
    MAX_FINITE_VARIANCE_K,
    MAX_PARETO_K,
    pareto_smoothed,
)
from ridgebayes.runtime.quiet import import_arviz

if TYPE_CHECKING:
    import xarray as xr

SUMMARY_COLUMNS = [
    "parameter",
    "mean",
    "sd",
    "eti_lower",
    "eti_upper",
    "prob",
    "ess_bulk",
    "ess_tail",
    "r_hat",
    "mcse_mean",
]
MAX_R_HAT = 1.01
MIN_ESS = 400.0
_WINDOW_PER_TAU = 5.0  # Sokal (1997)
MAX_REFITTED_ROWS = 20  # each refitted row needs a posterior without it


def arviz_object(groups: Mapping[str, "xr.Dataset"]) -> Any:
    """Return named datasets in the container of the installed arviz.

    Parameters
    ----------
    groups : mapping of str to xarray.Dataset
        Groups, for example posterior, log_likelihood and observed_data.

    Returns
    -------
    arviz.InferenceData or xarray.DataTree
        InferenceData on the 0.x line, DataTree on the 1.x line.
    """
    arviz = import_arviz()
    if arviz.__version__.startswith("0."):  # in 1.x InferenceData is another name of DataTree
        return arviz.InferenceData(**groups)
    from xarray import DataTree  # loads slowly

    return DataTree.from_dict(dict(groups))


def summarise(
    draws: FloatArray, names: tuple[str, ...], *, share: float = 1.0, prob: float = 0.9
) -> pd.DataFrame:
    """Summarise the draws of several ensembles, one row per parameter, without rounding.

    Parameters
    ----------
    draws : ndarray of float, shape (n_ensemble, n_step, n_walker, n_parameter)
        Parameters.
    names : tuple of str
        Their names.
    share : float, optional
        Effective over actual number of draws, for draws that were resampled by weight: a draw of
        large weight is repeated, at places that show no autocorrelation.
    prob : float, optional
        Probability inside the equal-tailed interval.

    Returns
    -------
    pandas.DataFrame
        Columns parameter, mean, sd, eti_lower, eti_upper, prob, ess_bulk, ess_tail, r_hat,
        mcse_mean. An ensemble is one chain.

    Notes
    -----
    *Accuracy.* Bulk effective sample size from rank-normalised draws, tail from the indicators of
    the 5 and 95 % quantiles, with autocorrelation times averaged over an ensemble's walkers.

    References
    ----------
    Vehtari et al. (2021), doi:10.1214/20-BA1221.
    """
    rows = []
    tails = (0.5 - prob / 2, 0.5 + prob / 2)
    columns = zip(names, np.moveaxis(draws, -1, 0), rank_r_hat(draws).tolist(), strict=True)
    for name, x, r_hat in columns:
        lower, upper, q05, q95 = np.quantile(x, [*tails, 0.05, 0.95])
        tail = min(float(effective_sample_size((x <= q).astype(float))) for q in (q05, q95))
        sd = float(x.std(ddof=1))
        rows.append(
            {
                "parameter": name,
                "mean": float(x.mean()),
                "sd": sd,
                "eti_lower": float(lower),
                "eti_upper": float(upper),
                "prob": prob,
                "ess_bulk": share * float(effective_sample_size(_rank_normalised(x))),
                "ess_tail": share * tail,
                "r_hat": r_hat,
                "mcse_mean": sd / float(np.sqrt(share * effective_sample_size(x))),
            }
        )
    return pd.DataFrame(rows, columns=SUMMARY_COLUMNS)


def rank_r_hat(draws: FloatArray) -> FloatArray:
    """Return rank-normalised split R-hat with one chain per ensemble.

    Parameters
    ----------
    draws : ndarray of float, shape (n_ensemble, n_step, n_walker, n_parameter)
        Parameters. Each ensemble is one chain, ordered by step, then by walker. Long chains are
        thinned to at most about `N_KEPT` draws each; more do not change R-hat noticeably.

    Returns
    -------
    ndarray of float, shape (n_parameter,)
        R-hat; 1 where the ensembles agree.
    """
    n_step, n_walker = draws.shape[1:3]
    draws = draws[:, :: -(-n_step * n_walker // N_KEPT)]
    n_ensemble, n_step, n_walker, n_parameter = draws.shape
    chains = draws.reshape(n_ensemble, n_step * n_walker, n_parameter)
    from arviz_stats.base import array_stats  # loads scipy.signal

    return np.asarray(array_stats.rhat(chains, chain_axis=0, draw_axis=1))


def _rank_normalised(x: FloatArray) -> FloatArray:
    from scipy.stats import rankdata  # imported here because it takes a third of a second

    ranks = rankdata(x, axis=None).reshape(x.shape)
    return np.asarray(ndtri((ranks - 0.375) / (x.size + 0.25)))


def failed_diagnostics(summary: pd.DataFrame) -> tuple[str, ...]:
    """Return the convergence rules that a summary does not meet, as texts.

    Parameters
    ----------
    summary : pandas.DataFrame
        As `summarise` returns it.

    Returns
    -------
    tuple of str
        One text per parameter and unmet rule; empty if all are met. The rules are R-hat under 1.01,
        and bulk and tail effective sample sizes of at least 400.
    """
    failed = []
    for row in summary.to_dict("records"):
        if not row["r_hat"] < MAX_R_HAT:
            failed.append(f"{row['parameter']}: R-hat {row['r_hat']:.4f}, not under {MAX_R_HAT}")
        for name in ("ess_bulk", "ess_tail"):
            if not row[name] >= MIN_ESS:
                failed.append(f"{row['parameter']}: {name} {row[name]:.0f}, under {MIN_ESS:.0f}")
    return tuple(failed)


@dataclass(frozen=True, eq=False)
class Loo:
    """Leave-one-row-out expected log predictive density, by Pareto-smoothed importance sampling.

    Parameters
    ----------
    elpd, se, p : float
        Sum over the rows, its standard error, and the effective number of parameters.
    pointwise : ndarray of float, shape (n_obs,)
        Each row's log predictive density.
    pareto_k : ndarray of float, shape (n_obs,)
        Pareto shape of each row's importance weights; 0 for rows that were refitted. The value of a
        row with a shape above 0.7 is not reliable.
    """

    elpd: float
    se: float
    p: float
    pointwise: FloatArray
    pareto_k: FloatArray

    @property
    def n_bad_k(self) -> int:
        """Number of rows whose Pareto k is above 0.7."""
        return int(np.sum(~(self.pareto_k <= MAX_PARETO_K)))

    @property
    def status(self) -> str:
        """``ok``, or the number of rows whose values are not reliable."""
        if not self.n_bad_k:
            return "ok"
        return f"{self.n_bad_k} of {len(self.pareto_k)} rows have a Pareto k above {MAX_PARETO_K}"


def leave_one_out(
    log_likelihood: FloatArray, reff: float, refitted: Callable[[int], float] | None = None
) -> Loo:
    """Score a fit by leaving out one row at a time.

    Parameters
    ----------
    log_likelihood : ndarray of float, shape (..., n_obs)
        Log-likelihood of each row at each draw.
    reff : float
        Effective over actual number of draws.
    refitted : callable, optional
        Takes a row number; returns the row's log predictive density under a posterior fitted
        without it, or NaN if the fit fails. Called for the rows with the largest Pareto k above
        0.5, at most 20, unless more than 20 rows have a k above 0.7. Between 0.5 and 0.7 weights
        have infinite variance: seven tables gave scores 0.1 too high on average, by 0.6 at most.

    Returns
    -------
    Loo
        Score of each row, and their sum with its standard error.

    References
    ----------
    Vehtari, Gelman & Gabry (2017), doi:10.1007/s11222-016-9696-4.
    """
    rows = log_likelihood.reshape(-1, log_likelihood.shape[-1]).T
    smoothed = [pareto_smoothed(-row, min(reff, 1.0)) for row in rows]
    log_weights, shapes = map(np.array, zip(*smoothed, strict=True))
    pointwise = logsumexp(log_weights + rows, axis=1)
    worst = np.argsort(-shapes, kind="stable")[:MAX_REFITTED_ROWS]
    if refitted is not None and np.sum(shapes > MAX_PARETO_K) <= MAX_REFITTED_ROWS:
        for i in worst[shapes[worst] > MAX_FINITE_VARIANCE_K].tolist():
            value = refitted(i)
            if math.isfinite(value):
                pointwise[i], shapes[i] = value, 0.0
    elpd, n = float(pointwise.sum()), len(rows)
    p = float((logsumexp(rows, axis=1) - math.log(rows.shape[1])).sum()) - elpd
    se = math.sqrt(n * pointwise.var(ddof=1)) if n > 1 else math.nan
    return Loo(elpd, se, p, pointwise, shapes)


def stacking_weights(pointwise: FloatArray) -> FloatArray:
    """Return the weights that maximise the summed log score of the mixture of predictions.

    Parameters
    ----------
    pointwise : ndarray of float, shape (n_model, n_obs)
        Leave-one-out log predictive densities.

    Returns
    -------
    ndarray of float, shape (n_model,)
        Non-negative weights with sum 1.

    Notes
    -----
    *Accuracy.* The problem is convex. Expectation maximisation of the mixture weights takes 2,000
    steps, none of which lowers the score.

    References
    ----------
    Yao et al. (2018), doi:10.1214/17-BA1091.

    Examples
    --------
    >>> stacking_weights(np.array([[0.0, 0.0], [-50.0, -50.0]])).round(6).tolist()
    [1.0, 0.0]
    """
    density = np.exp(pointwise - pointwise.max(axis=0))
    weights = np.full(len(pointwise), 1 / len(pointwise))
    for _ in range(2000):
        share = weights[:, None] * density
        weights = (share / share.sum(axis=0)).mean(axis=1)
    return weights


def values_text(summary: pd.DataFrame) -> str:
    """Return one line of text with the mean and standard deviation of each parameter."""
    rows = summary.itertuples()
    return ", ".join(f"{row.parameter} = {row.mean:.4g} ± {row.sd:.2g}" for row in rows)


def autocorrelation_time(x: FloatArray) -> FloatArray:
    """Return the integrated autocorrelation time in steps.

    tau = 1 + 2 sum_{t=1}^{M} rho(t), with M the smallest window of at least five tau.

    Parameters
    ----------
    x : ndarray of float, shape (n_step, n_walker, ...), any unit
        Values along the steps.

    Returns
    -------
    ndarray of float, shape (...), steps
        At least 1/n_step; about 1 for independent steps; NaN if the values do not vary.

    References
    ----------
    Goodman & Weare (2010), doi:10.2140/camcos.2010.5.65; Sokal (1997), section 3.

    Examples
    --------
    >>> x = np.random.default_rng(1).standard_normal((4000, 8))
    >>> bool(abs(autocorrelation_time(x) - 1) < 0.1)
    True
    """
    n_step = len(x)
    # Means of single walkers would take up part of the correlation of short chains.
    columns = (x - x.mean(axis=(0, 1))).reshape(*x.shape[:2], -1).T
    tau = [_sokal(np.ascontiguousarray(column)) for column in columns]
    return np.asarray(np.maximum(np.array(tau).reshape(x.shape[2:]), 1 / n_step))


def _sokal(x: FloatArray) -> float:
    """Return tau of centred values, shape (n_walker, n_step)."""
    n_step = x.shape[1]
    if not x.any():
        return np.nan
    length = fft.next_fast_len(2 * n_step, real=True)
    power = np.abs(fft.rfft(x, length)) ** 2
    covariance = fft.irfft(power.sum(axis=0), length)[:n_step]
    taus = 2 * np.cumsum(covariance) / covariance[0] - 1
    wide_enough = np.arange(n_step) >= _WINDOW_PER_TAU * taus
    return float(taus[np.argmax(wide_enough) if wide_enough.any() else -1])


def effective_sample_size(x: FloatArray) -> FloatArray:
    """Return the effective sample size of several ensembles for the mean of `x`.

    Steps times walkers over tau, summed over the ensembles.

    Parameters
    ----------
    x : ndarray of float, shape (n_ensemble, n_step, n_walker, ...), any unit
        Values.

    Returns
    -------
    ndarray of float, shape (...), dimensionless
        Effective number of independent draws.

    Examples
    --------
    >>> x = np.random.default_rng(1).standard_normal((4, 1000, 8))
    >>> bool(abs(effective_sample_size(x) / x.size - 1) < 0.1)
    True
    """
    n = x.shape[1] * x.shape[2]
    return np.asarray(np.sum([n / autocorrelation_time(ensemble) for ensemble in x], axis=0))
