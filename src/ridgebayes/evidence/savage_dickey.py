"""The Bayes factor of Hybrid over Modified from Hybrid's posterior alone.

Modified is Hybrid at c2 = 0, with the same prior of the other coefficient, so the Bayes factor is
the prior density at c2 = 0 over the posterior density there. Zero lies several posterior sds out,
where no draws fall: the density is averaged from conditional marginals, each normalised by
quadrature, not from a kernel estimate.
"""

import math

import numpy as np
from scipy.special import logsumexp

from ridgebayes._types import FloatArray
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import InputError
from ridgebayes.inference.diagnostics import effective_sample_size
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.pareto_smoothing import pareto_k
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.default_priors import default_priors
from ridgebayes.model.forms import Modified

_STEPS = 48  # grid points per integrated coordinate, sixteen sds wide
_STEADY = 0.5  # Pareto shape from which on averages have no variance: their error means nothing
_FAR = 200  # posterior sds of c2 beyond which its value 0 is not reached
_WIDENED = 20  # times that the grid of sigma may be widened
_NEGLIGIBLE = 30.0  # log density relative to the peak at which that grid may end
_N_DRAW = 128  # draws of each ensemble that the error model's parameters are taken from


def savage_dickey(fit: Posterior, nested: Distribution | None = None) -> LogEvidence:
    """Return ln BF of Hybrid over Modified, the log of prior over posterior density at c2 = 0.

    Parameters
    ----------
    fit : Posterior
        Posterior of the Hybrid form.
    nested : Distribution, optional
        Modified's prior of c; the default one if not given.

    Returns
    -------
    LogEvidence
        Method ``savage-dickey``; the value is a log Bayes factor, not an evidence. The status is
        not ok where offsets are sampled beside the parameters, where the prior of c1 is not the one
        that Modified gives c, or that of c2 has no density at 0, where hardly any draw of the other
        parameters would suit c2 = 0, or where that lies more than 200 posterior sds out.

    Raises
    ------
    InputError
        If the form is not Hybrid.

    Notes
    -----
    With u1, u2 the coordinates of c1 and c2 and w = u1 + beta u2, beta chosen so that w and u2 are
    uncorrelated, the density p(c2 = 0 | w) hardly depends on w, and its average over the draws of
    w is the marginal density with little Monte Carlo error. Given w, c2 and sigma are integrated
    on a grid; with more parameters of the error model than sigma, c2 alone, given all of them.

    References
    ----------
    Dickey (1971), doi:10.1214/aoms/1177693507; Chen (1994), doi:10.1080/01621459.1994.10476818,
    for the conditional marginal density.
    """
    model = fit.model
    if model.form.name != "hybrid":
        raise InputError(f"form: expected hybrid, got {model.form.name!r}")
    nested = nested or default_priors(Modified())["c"]
    if model.priors["c1"] != nested:
        return _impossible(f"prior of c1: {model.priors['c1'].words}, of Modified: {nested.words}")
    if not np.isfinite(model.priors["c2"].log_pdf(np.zeros(()))):
        return _impossible("prior of c2: no density at 0")
    if model.is_latent:
        return _impossible("offsets are sampled: no conditional density of c2 alone")
    if not model.is_iid_gaussian:
        return _given_error_model(fit)
    chains = fit.kept_chains
    u = chains.u  # coordinates of c1, c2, sigma
    flat = u.reshape(-1, 3)
    covariance = np.cov(flat.T)
    beta = -covariance[0, 1] / covariance[1, 1]
    w = u[..., 0] + beta * u[..., 1]
    if _far(flat[:, 1], _zero(fit)):
        return _too_far()
    sigma = _sigma_grid(fit, float(np.median(w)), beta)
    density = np.array([_log_density_at_zero(fit, value, beta, sigma) for value in _nodes(w)])
    # log p(c2 = 0 | w) is a smooth function of w: interpolate it to all draws.
    return _averaged(np.interp(w, _nodes(w), density), _zero(fit))


def _averaged(log_density: FloatArray, zero: float) -> LogEvidence:
    """Return the ratio from log p(c2 = 0 | a draw), shape (n_ensemble, n_step, n_walker)."""
    shifted = np.exp(log_density - log_density.max())
    log_posterior = math.log(shifted.mean()) + log_density.max()
    relative = shifted.std() / shifted.mean()
    se = relative / math.sqrt(float(effective_sample_size(shifted))) if relative else 0.0
    # Prior and posterior density are both of the coordinate of c2: its Jacobian cancels.
    log_prior = -0.5 * zero**2 - 0.5 * math.log(2 * math.pi)
    status = _status(log_density.ravel()) if relative else "ok"
    return LogEvidence("savage-dickey", log_prior - log_posterior, max(se, 1e-12), status)


def _far(draws: FloatArray, zero: float) -> bool:
    return bool(abs(zero - draws.mean()) > _FAR * draws.std())


def _too_far() -> LogEvidence:
    return _impossible(f"c2 = 0 lies more than {_FAR} posterior sds out")


def _impossible(reason: str) -> LogEvidence:
    return LogEvidence("savage-dickey", math.nan, math.nan, reason)


def _status(log_density: FloatArray) -> str:
    """Say whether draws come near what suits c2 = 0.

    Without c2 the errors may be wider, and the other parameters lie elsewhere: draws of which
    hardly any comes near say nothing of the density there.
    """
    heavy = pareto_k(log_density)
    if heavy <= _STEADY:
        return "ok"
    return f"densities at c2 = 0: Pareto k {heavy:.2f}, above {_STEADY}"


def _given_error_model(fit: Posterior) -> LogEvidence:
    """Average p(c2 = 0 | w, the error model's parameters) over draws."""
    u = fit.kept_chains.u
    stride = max(u[..., 0].size // _N_DRAW // u.shape[0], 1)
    u = u.reshape(len(u), -1, u.shape[-1])[:, ::stride]
    flat = u.reshape(-1, u.shape[-1])
    covariance = np.cov(flat[:, :2].T)
    beta = -covariance[0, 1] / covariance[1, 1]
    zero = _zero(fit)
    if _far(flat[:, 1], zero):
        return _too_far()
    c2 = np.append(_grid(flat[:, 1], include=zero), zero)
    points = np.repeat(flat[:, None], len(c2), axis=1)
    points[..., 1] = c2
    points[..., 0] = (flat[:, 0] + beta * flat[:, 1])[:, None] - beta * c2
    values = np.concatenate([fit.model.log_density(part) for part in np.array_split(points, 64)])
    log_density = values[:, -1] - logsumexp(values[:, :-1], axis=1) - math.log(c2[1] - c2[0])
    return _averaged(log_density.reshape(len(u), -1, 1), zero)


def _nodes(w: FloatArray) -> FloatArray:
    return np.linspace(w.min(), w.max(), 201)


def _log_density_at_zero(fit: Posterior, w: float, beta: float, sigma: FloatArray) -> float:
    """Return log p(c2 = 0 | w), sigma integrated out."""
    flat = fit.chains.u.reshape(-1, 3)
    zero = _zero(fit)
    c2 = _grid(flat[:, 1], include=zero)
    c2_mesh, sigma_mesh = np.meshgrid(c2, sigma, indexing="ij")
    points = np.stack([w - beta * c2_mesh, c2_mesh, sigma_mesh], axis=-1)
    values = fit.model.log_density(points)
    at_zero = np.empty((len(sigma), 3))
    at_zero[:, 0], at_zero[:, 1], at_zero[:, 2] = w - beta * zero, zero, sigma
    numerator = logsumexp(fit.model.log_density(at_zero))
    return float(numerator - logsumexp(values) - math.log(c2[1] - c2[0]))


def _sigma_grid(fit: Posterior, w: float, beta: float) -> FloatArray:
    """Equal steps over what sigma may be in the posterior, and at c2 = 0, where it is larger."""
    sigma, zero = _grid(fit.chains.u.reshape(-1, 3)[:, 2], include=None), _zero(fit)
    step = sigma[1] - sigma[0]
    for _ in range(_WIDENED):
        points = np.stack([np.full_like(sigma, w - beta * zero), np.full_like(sigma, zero), sigma])
        density = fit.model.log_density(points.T)
        if density[-1] < density.max() - _NEGLIGIBLE:
            break
        sigma = np.append(sigma, sigma[-1] + step * np.arange(1, _STEPS))
    return sigma


def _zero(fit: Posterior) -> float:
    """Return the coordinate of c2 = 0."""
    return float(fit.model.priors["c2"].score(0.0))


def _grid(draws: FloatArray, include: float | None) -> FloatArray:
    """Equal steps over eight sds about the mean, and out to a value that has to be inside."""
    low, high = draws.mean() - 8 * draws.std(), draws.mean() + 8 * draws.std()
    n_step = _STEPS
    if include is not None:
        low, high = min(low, include - draws.std()), max(high, include + draws.std())
        # Steps stay a third of an sd, however far out the value lies.
        n_step = max(math.ceil((high - low) / (16 * draws.std()) * _STEPS), _STEPS)
    return np.linspace(low, high, n_step)
