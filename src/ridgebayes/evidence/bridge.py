"""Evidence by bridge sampling between a posterior's draws and a normal proposal.

The estimate compares posterior draws with draws of a normal proposal with the same mean and
covariance, in the coordinates of a chart. The proposal is fitted to one half of the ensembles and
compared with the other half, and then with the halves swapped. Since ensembles are independent, no
draw is compared with a proposal that was fitted to it.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from ridgebayes._types import LOG_2PI, FloatArray
from ridgebayes.inference.diagnostics import effective_sample_size
from ridgebayes.inference.emcee_sampling import Walked
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.target import Target


def bridge_evidence(
    target: Target,
    walked: Walked,
    *,
    rng: np.random.Generator,
    n_point: int = 32,
    iterations_max: int = 1000,
    draws_max: int = 5_000,
) -> LogEvidence:
    """Estimate the log evidence from the draws of several ensembles.

    Parameters
    ----------
    target : Target
        Posterior density; the coordinates of its first chart are used.
    walked : Walked
        Draws of an even number of independent ensembles.
    rng : numpy.random.Generator
        Source of the proposal's draws.
    n_point : int, optional
        Number of points for densities that are estimates.
    iterations_max : int, optional
        Maximum number of steps of the fixed-point iteration.
    draws_max : int, optional
        Number of draws used from each half; more draws hardly reduce the error.

    Returns
    -------
    LogEvidence
        Value and Monte Carlo standard error. The status is not ok if the draws do not vary in every
        direction, if the iteration does not converge, or if the two halves disagree by more than
        five standard errors.

    Notes
    -----
    *Accuracy.* The standard error combines the relative variances of numerator and denominator (the
    latter with the effective sample size of the posterior's draws) and the covariance of the two
    halves' errors.

    References
    ----------
    Meng & Wong (1996); Gronau et al. (2017), doi:10.1016/j.jmp.2017.09.005, eq. 15;
    Micaletto & Vehtari (2025), arXiv:2508.14487, for the Monte Carlo error.
    """
    n_ensemble, n_step, n_walker, n_parameter = walked.coordinates.shape
    half = n_ensemble // 2
    stride = max(math.ceil(half * n_step * n_walker / draws_max), 1)
    z = walked.coordinates[:, ::stride]
    log_density_z = walked.chains.log_density[:, ::stride] + walked.log_jacobian[:, ::stride]

    def log_target(q: FloatArray) -> FloatArray:
        draws = target.evaluate(np.zeros(len(q), np.int64), q, rng, n_point)
        with np.errstate(invalid="ignore"):
            value = draws.log_density + draws.log_jacobian[0]
        return np.where(np.isnan(value), -np.inf, value)

    halves = z[:half], z[half:]
    proposals = [_Normal.fitted(part.reshape(-1, n_parameter)) for part in halves]
    results = []
    for k, draws in enumerate(halves):
        proposal, draws_proposal = proposals[1 - k], proposals[k]
        if proposal is None or draws_proposal is None:
            reason = "the draws of half of the ensembles do not move in every direction"
            return LogEvidence("bridge", math.nan, math.nan, reason)
        candidates = proposal.rvs(rng, draws[..., 0].size)
        at_candidates = log_target(candidates)
        at_draws = log_density_z[half:] if k else log_density_z[:half]
        result = _bridge(
            at_draws - proposal.log_pdf(draws),
            at_draws - draws_proposal.log_pdf(draws),
            at_candidates - proposal.log_pdf(candidates),
            iterations_max,
        )
        if result is None:
            reason = (
                f"bridge iteration not settled after {iterations_max} steps, or draws and "
                "proposal do not overlap"
            )
            return LogEvidence("bridge", math.nan, math.nan, reason)
        results.append(result)
    values, variances, covariances = zip(*results, strict=True)
    distance = abs(values[0] - values[1]) / math.sqrt(sum(variances))
    se = 0.5 * math.sqrt(sum(variances + covariances))
    status = "ok" if distance < 5 else f"halves of the ensembles disagree by {distance:.1f} se"
    return LogEvidence("bridge", 0.5 * sum(values), se, status)


@dataclass(frozen=True, eq=False)
class _Normal:
    """A multivariate normal distribution, by its mean and the Cholesky factor of its covariance."""

    mean: FloatArray
    root: FloatArray

    @classmethod
    def fitted(cls, points: FloatArray) -> "_Normal | None":
        """Return the normal with the points' mean and covariance, or None if it is singular."""
        covariance = np.atleast_2d(np.cov(points.T)).astype(float)
        # Because of rounding, the variance of equal points is exactly zero on some machines only.
        relative = np.sqrt(len(points)) * np.finfo(float).eps
        rounding = relative * max(1.0, np.abs(points).max())
        spread = np.linalg.eigvalsh(covariance)
        if not spread[0] > max(rounding**2, relative * spread[-1]):
            return None
        return cls(points.mean(axis=0), np.linalg.cholesky(covariance))

    def rvs(self, rng: np.random.Generator, n: int) -> FloatArray:
        return self.mean + rng.standard_normal((n, len(self.mean))) @ self.root.T

    def log_pdf(self, points: FloatArray) -> FloatArray:
        scaled = (points - self.mean) @ np.linalg.inv(self.root).T
        log_norm = np.log(np.diag(self.root)).sum() + 0.5 * len(self.mean) * LOG_2PI
        value: FloatArray = -0.5 * (scaled * scaled).sum(axis=-1) - log_norm
        return value


def _bridge(
    posterior_ratio: FloatArray,
    other_ratio: FloatArray,
    proposal_ratio: FloatArray,
    iterations_max: int,
) -> tuple[float, float, float] | None:
    """Return the log evidence, its variance, and its covariance with the other half's.

    Parameters
    ----------
    posterior_ratio, other_ratio : ndarray of float, shape (n_ensemble, n_step, n_walker)
        log(target / proposal) at draws of the posterior, for the proposal fitted to the other half
        and for the proposal fitted to these draws.
    proposal_ratio : ndarray of float, shape (n,)
        log(target / proposal) at draws of the proposal.
    iterations_max : int
        Maximum number of steps of the fixed-point iteration.

    Returns
    -------
    tuple of float, or None
        None if the iteration does not converge.
    """
    n_effective = _effective(posterior_ratio)
    log_odds = math.log(n_effective / proposal_ratio.size)  # log s1/s2
    log_z = float(np.median(posterior_ratio))
    for _ in range(iterations_max):
        # With l = exp(ratio) and r the evidence, the numerator is the mean over the proposal of
        # l / (s1 l + s2 r), the denominator the mean over the posterior of 1 / (s1 l + s2 r). Both
        # are written as logistic functions, which cannot overflow.
        numerator = expit(proposal_ratio - log_z + log_odds)
        denominator = expit(log_z - posterior_ratio - log_odds)
        if not (numerator.any() and denominator.any()):
            return None  # posterior and proposal share no draw
        new = log_z - log_odds + math.log(numerator.mean()) - math.log(denominator.mean())
        converged, log_z = abs(new - log_z) < 1e-10, new
        if converged:
            break
    else:
        return None
    scale, n_denominator = denominator.mean() ** 2, _effective(denominator)
    variance = numerator.var() / numerator.mean() ** 2 / numerator.size
    variance += denominator.var() / scale / n_denominator
    # The error of a proposal comes from the half to which it is fitted, and is averaged over draws
    # of the other half, which have an error too. The product of both errors enters the estimates of
    # both halves. Its variance is half the variance of the difference between the two proposals.
    difference = denominator - expit(log_z - other_ratio - log_odds)
    return log_z, float(variance), float(0.5 * difference.var() / scale / n_denominator)


def _effective(x: FloatArray) -> float:
    """Return the effective sample size, limited to the number of draws.

    Estimates from short chains can exceed this number.
    """
    return min(float(effective_sample_size(x)), float(x.size))
