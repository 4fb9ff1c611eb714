"""The Bayes factor of Hybrid over Modified from Hybrid's posterior alone.

Modified is Hybrid at c2 = 0, with the same prior of the other coefficient, so the Bayes factor is
the prior density at c2 = 0 over the posterior density there. Zero lies several posterior sds out,
where no draws fall: the density is averaged from conditional densities, each normalised by
quadrature, not from a kernel estimate.
"""

import math

import numpy as np
from scipy.special import logsumexp, softmax

from ridgebayes._types import FloatArray
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import InputError
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.inference.pareto_smoothing import pareto_k
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.default_priors import default_priors
from ridgebayes.model.forms import Modified
from ridgebayes.model.model import Model

_STEADY = 0.5  # Pareto shape from which on averages have no variance: their error means nothing
_EVEN = 1e-3  # relative sd of densities below which the error of their integrals is their shape
_FAR = 200  # posterior sds of c2 beyond which its value 0 is not reached
_NARROWEST = 1e-8  # posterior sds of c2 down to which steps from a draw shrink
_WIDEST = 16.0  # prior sds of c2 up to which they grow
_STEP = 1 / 3  # of the steps' logarithm
_N_DRAW = 128  # least draws of each ensemble that densities are averaged over
_AT_ONCE = 8  # least draws whose lines are worked out together


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
    With u2 the coordinate of c2 and v all others, the density p(c2 = 0 | w), w = v - slope u2, is
    averaged over draws. Given w, all lie on a line, along which c2 is integrated in steps that grow
    with the distance from the draw: these suit a conditional density of any width. The first slope
    makes w and u2 uncorrelated for c1, and is 0 for the error model. The second leads to where v
    lie at c2 = 0: then the density hardly depends on w, and its average has little Monte Carlo
    error. It is tried where rows are independent and the first will do.

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
    c2 = fit.kept_chains.u[..., 1]
    zero = float(model.priors["c2"].score(0.0))
    if abs(zero - c2.mean()) > _FAR * c2.std():
        return _impossible(f"c2 = 0 lies more than {_FAR} posterior sds out")
    # As many draws as cost little: the dearer a density is, the fewer.
    u = _draws(fit, max(model.n_at_once // len(c2), _N_DRAW))
    slope = _regression(u)
    log_density = _log_density_at_zero(model, u, slope, zero)
    found = _averaged(log_density, zero)
    if not found.ok or model.offsets is not None:
        return found
    slope = _turned(slope, u, log_density, zero)
    again = _averaged(_log_density_at_zero(model, u, slope, zero), zero)
    return again if again.ok and again.se < found.se else found


def _draws(fit: Posterior, n: int) -> FloatArray:
    """Return about n draws of each ensemble, shape (n_ensemble, n_step, n_walker, n_coordinate)."""
    u = fit.kept_chains.u
    n_ensemble, n_step, n_walker, n_coordinate = u.shape
    stride = n_step * n_walker // n
    return u if stride < 2 else u.reshape(n_ensemble, -1, 1, n_coordinate)[:, ::stride]


def _regression(u: FloatArray) -> FloatArray:
    """Return how c1's coordinate moves with that of c2 in the posterior.

    The error model stays: one factor of a covariance then serves a whole line.
    """
    covariance = np.cov(u[..., :2].reshape(-1, 2).T)[1]
    slope = np.zeros(u.shape[-1])
    slope[:2] = covariance / covariance[1]
    return slope


def _turned(slope: FloatArray, u: FloatArray, log_density: FloatArray, zero: float) -> FloatArray:
    """Return the slope of lines that lead to where other parameters lie at c2 = 0.

    Weighted by the density at c2 = 0, the points there that lines of the old slope lead to tell.
    """
    flat = u.reshape(-1, u.shape[-1])
    at_zero = flat + (zero - flat[:, 1:2]) * slope
    moved = softmax(log_density.ravel()) @ at_zero - at_zero.mean(axis=0)
    apart = zero - flat[:, 1].mean()
    # Inside the posterior of c2 there is nowhere to lead: then hardly turn.
    turn: FloatArray = moved * apart / (apart**2 + flat[:, 1].var())
    return slope + turn


def _log_density_at_zero(model: Model, u: FloatArray, slope: FloatArray, zero: float) -> FloatArray:
    """Return log p(c2 = 0 | the line of each draw), shape ``u.shape[:-1]``."""
    flat = u.reshape(-1, u.shape[-1])
    least = _NARROWEST * flat[:, 1].std()
    n = math.ceil(math.asinh(_WIDEST / least) / _STEP)
    x = _STEP * np.arange(-n, n + 1)
    log_width = np.log(_STEP * least * np.cosh(x))
    values = []
    n_at_once = max(model.n_at_once // len(x), _AT_ONCE)
    for part in np.split(flat, range(n_at_once, len(flat), n_at_once)):
        step = np.tile(np.append(least * np.sinh(x), 0.0), (len(part), 1))
        step[:, -1] = zero - part[:, 1]
        points = part[:, None] + step[..., None] * slope
        value = model.log_density(points)
        values.append(value[:, -1] - logsumexp(value[:, :-1] + log_width, axis=1))
    return np.concatenate(values).reshape(u.shape[:-1])


def _averaged(log_density: FloatArray, zero: float) -> LogEvidence:
    """Return the ratio from log p(c2 = 0 | a draw), shape (n_ensemble, n_step, n_walker)."""
    top = log_density.max()
    with np.errstate(invalid="ignore"):  # of no density at all, which the status tells
        density = np.exp(log_density - top)
        mean = density.mean()
        within = density.std() / math.sqrt(density.size)
        # Draws of a slow walk are alike: the scatter of its ensembles tells.
        between = density.mean(axis=(1, 2)).std() / math.sqrt(max(len(density) - 1, 1))
        se = max(within, between) / mean
    # Prior and posterior density are both of the coordinate of c2: its Jacobian cancels.
    log_prior = -0.5 * zero**2 - 0.5 * math.log(2 * math.pi)
    value = log_prior - top - float(np.log(mean))
    is_even = bool(density.std() < _EVEN * mean)
    return LogEvidence("savage-dickey", value, se, _status(log_density.ravel(), se, is_even))


def _impossible(reason: str) -> LogEvidence:
    return LogEvidence("savage-dickey", math.nan, math.nan, reason)


def _status(log_density: FloatArray, se: float, is_even: bool) -> str:
    """Say whether draws come near what suits c2 = 0.

    Without c2 the errors may be wider, and the other parameters lie elsewhere: draws of which
    hardly any comes near say nothing of the density there.
    """
    if not math.isfinite(se):
        return "densities at c2 = 0: no finite standard error"
    heavy = pareto_k(log_density)
    if is_even or heavy <= _STEADY:
        return "ok"
    return f"densities at c2 = 0: Pareto k {heavy:.2f}, above {_STEADY}"
