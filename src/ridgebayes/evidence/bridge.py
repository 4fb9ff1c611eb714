"""Evidence by bridge sampling between a posterior's draws and a normal proposal.

The estimate compares posterior draws with draws of a normal of the same mean and covariance, in the
coordinates of a chart. The normal is fitted to one half of the ensembles and bridged to the other,
and then with the halves swapped: ensembles are independent, so no draw is used against itself.
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

# Relative error by rounding of a mean or covariance of up to 100,000 points.
_RELATIVE_ROUNDING = 100 * np.finfo(float).eps


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
        For the proposal's draws.
    n_point : int, optional
        Points of densities that are estimates.
    iterations_max : int, optional
        Steps of the fixed-point iteration after which it counts as not converged.
    draws_max : int, optional
        Draws used of each half; more would cost time that the error does not need.

    Returns
    -------
    LogEvidence
        Value and Monte Carlo standard error. The status is not ok where the draws do not move in
        every direction, the iteration does not converge, or the two halves disagree by more than
        five standard errors.

    Notes
    -----
    *Accuracy.* The standard error adds the relative variances of numerator and denominator, the
    posterior side divided by its effective sample size, and the covariance of the errors of the
    two halves: the product of the errors of their draws enters both.

    References
    ----------
    Meng & Wong (1996); Gronau et al. (2017), doi:10.1016/j.jmp.2017.09.005, eq. 15;
    Micaletto & Vehtari (2025), arXiv:2508.14487, for the Monte Carlo error.
    """
    n_ensemble, n_step, n_walker, n_parameter = walked.coordinates.shape
    half = n_ensemble // 2
    stride = max(math.ceil(half * n_step * n_walker / draws_max), 1)
    z = walked.coordinates[:, ::stride]
    in_z = walked.chains.log_density[:, ::stride] + walked.log_jacobian[:, ::stride]

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
        at_draws = in_z[half:] if k else in_z[:half]
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
    (first, *of_first), (second, *of_second) = results
    apart = abs(first - second) / math.sqrt(of_first[0] + of_second[0])
    se = 0.5 * math.sqrt(of_first[0] + of_second[0] + of_first[1] + of_second[1])
    status = "ok" if apart < 5 else f"halves of the ensembles disagree by {apart:.1f} se"
    return LogEvidence("bridge", 0.5 * (first + second), se, status)


@dataclass(frozen=True, eq=False)
class _Normal:
    mean: FloatArray
    root: FloatArray

    @classmethod
    def fitted(cls, points: FloatArray) -> "_Normal | None":
        """Return the normal of the points' mean and covariance, None where that is singular."""
        covariance = np.atleast_2d(np.cov(points.T)).astype(float)
        # By rounding, the variance of equal points is zero on some machines only.
        rounding = _RELATIVE_ROUNDING * max(1.0, np.abs(points).max())
        spread = np.linalg.eigvalsh(covariance)
        if not spread[0] > max(rounding**2, _RELATIVE_ROUNDING * spread[-1]):
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
    """Return log evidence, its variance, and its covariance with that of the other half.

    Parameters
    ----------
    posterior_ratio, other_ratio : ndarray of float, shape (n_ensemble, n_step, n_walker)
        log(target / proposal) at draws of the posterior, with the proposal fitted to the other half
        and with that fitted to these draws.
    proposal_ratio : ndarray of float, shape (n,)
        The same at draws of the proposal.
    iterations_max : int
        Steps of the fixed-point iteration.
    """
    n_effective = _effective(posterior_ratio)
    log_odds = math.log(n_effective / proposal_ratio.size)  # log s1/s2
    log_z = float(np.median(posterior_ratio))
    for _ in range(iterations_max):
        # Numerator: mean over the proposal of l / (s1 l + s2 r); denominator: mean over the
        # posterior of 1 / (s1 l + s2 r). Both as logistic functions, which cannot overflow.
        numerator = expit(proposal_ratio - log_z + log_odds)
        denominator = expit(log_z - posterior_ratio - log_odds)
        if not (numerator.any() and denominator.any()):
            return None  # posterior and proposal share no draw
        new = log_z - log_odds + math.log(numerator.mean()) - math.log(denominator.mean())
        settled, log_z = abs(new - log_z) < 1e-10, new
        if settled:
            break
    else:
        return None
    scale, n_denominator = denominator.mean() ** 2, _effective(denominator)
    variance = numerator.var() / numerator.mean() ** 2 / numerator.size
    variance += denominator.var() / scale / n_denominator
    # A proposal has the error e of its draws: f = f0 + s e. The other half averages s, with the
    # error of its own draws. The product of both errors enters both halves, and its variance is
    # half that of the difference between proposals.
    apart = denominator - expit(log_z - other_ratio - log_odds)
    return log_z, float(variance), float(0.5 * apart.var() / scale / n_denominator)


def _effective(x: FloatArray) -> float:
    """Return the effective sample size, at most the number: short chains seem to have more."""
    return min(float(effective_sample_size(x)), float(x.size))
