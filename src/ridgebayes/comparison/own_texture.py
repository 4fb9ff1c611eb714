"""Quantiles of the load at textures that were not fitted, as one table for the report's page.

Under every built-in form ``ln(p/E) = 2 ln L - ln((1 - nu^2)/0.75) + g_Q(a/pitch)``, where L is the
pitch over R, and the offsets of a new texture depend on Q and a/pitch alone. So one table of
quantiles of g over Q and a/pitch answers for every texture, body and unit.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.special import ndtri

from ridgebayes._types import FloatArray, Json
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.errors import InputError
from ridgebayes.model.forms import PowerLaw
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.predict.load_distribution import LoadDistribution
from ridgebayes.predict.posterior_loads import PosteriorLoads
from ridgebayes.predict.predict import Predictive
from ridgebayes.predict.q_distribution import heavy_parts

PROB = (0.001, 0.003, 0.01, 0.025, 0.05, 0.1, 0.2, 0.35, 0.5)  # and as many above the median
_LEAST_RATIO = 0.04  # of a/pitch; and as far from 1
_BELOW, _WITHIN, _ABOVE = 8, 13, 7  # numbers of a/pitch below, within and above the calibrated
_MOST_Q = 40  # the last count, unless more were calibrated
_UNIT = 1e-5  # of ln load, far below what Monte Carlo error leaves
_N_PLACE, _STEEPEST = 41, 3.2  # places of a distribution function: sinh of -3.2 to 3.2 scales
_N_ROUGH = 300  # draws that say roughly where a distribution lies


@dataclass(frozen=True)
class OwnTexture:
    """Quantiles from which the page predicts textures that were not fitted.

    Parameters
    ----------
    table : mapping or None
        ``ratio`` (a/pitch), ``Q`` and ``prob``; ``g``, quantiles of ln(p/E) at pitch R and nu = 0.5
        in units of ``unit``, ratio by ratio, Q by Q, None where that share of the draws reaches Q
        at no load; ``calibrated``, see `CalibratedRange.to_dict`; ``fitted``, textures with rows;
        ``knows``, whether fitted textures have offsets or coefficients of their own; ``power_law``,
        whether a form of weight has a coefficient for each texture.
    why : str
        Why there is none; else empty.
    """

    table: Json | None
    why: str = ""


def own_texture(comparison: Comparison) -> OwnTexture:
    """Return quantiles of the load over a/pitch and Q, averaged as `Comparison.predict_load` does.

    Parameters
    ----------
    comparison : Comparison
        Forms with an evidence.

    Returns
    -------
    OwnTexture
        Without a table where no form has an evidence, or the loads of a form or the prior of the
        power law's K do not go with the square of the pitch.

    Notes
    -----
    *Accuracy.* 0.1 % in the load from 2.5 to 97.5 %, beside the Monte Carlo error of
    `predict_load`; a few per cent beyond, where forms of little weight have other loads.
    """
    if not comparison.probabilities:
        return OwnTexture(None, "no form has an evidence that can be used")
    posteriors, weights = zip(*comparison.averaged, strict=True)
    try:
        for posterior in posteriors:
            PosteriorLoads(posterior).check_scaling(0.5)
    except InputError as error:
        return OwnTexture(None, str(error))
    heavy = [p for p, one in zip(posteriors, heavy_parts(np.array(weights)), strict=True) if one]
    calibrated = CalibratedRange.of(heavy[0])
    power_law = any(isinstance(one.form, PowerLaw) for one in heavy)
    ratio, Q = _nodes(calibrated.ratio), np.arange(4, max(_MOST_Q, 2 * calibrated.Q_max) + 1, 2)
    prob = np.array([*PROB, *(1 - np.array(PROB[-2::-1]))])
    found = np.round(_log_quantiles(comparison, ratio, Q, prob).ravel() / _UNIT)
    reached = {key: value for key, value in calibrated.to_dict().items() if key != "textures"}
    return OwnTexture(
        {
            "ratio": ratio.round(12).tolist(),
            "Q": Q.tolist(),
            "prob": prob.round(12).tolist(),
            "unit": _UNIT,
            "g": [int(one) if math.isfinite(one) else None for one in found],
            "calibrated": reached,
            "fitted": [list(one) for one in posteriors[0].model.data.textures],
            "knows": power_law or any("texture" in one.noise.factors for one in heavy),
            "power_law": power_law,
        }
    )


def _nodes(calibrated: tuple[float, float]) -> FloatArray:
    """Return places in a/pitch: both ends of the calibrated range, and more within it."""
    low, high = (min(max(end, 2 * _LEAST_RATIO), 1 - 2 * _LEAST_RATIO) for end in calibrated)
    below = np.geomspace(_LEAST_RATIO, low, _BELOW)
    above = 1 - np.geomspace(_LEAST_RATIO, 1 - high, _ABOVE)
    within = np.linspace(low, high, _WITHIN if high > low else 1)
    return np.unique(np.concatenate([below, within, above]).round(12))


def _log_quantiles(
    model: Predictive, ratio: FloatArray, Q: np.ndarray, prob: FloatArray
) -> FloatArray:
    """Return quantiles of ln(p/E) at a pitch of R, shape (n_ratio, n_Q, n_prob).

    One distribution function is worked out at places about its middle and inverted, since each
    quantile would take several.
    """
    found: LoadDistribution = model.predict_load(ratio[:, None], 1 - ratio[:, None], Q)
    with np.errstate(divide="ignore"):
        rough = np.sort(np.log(found.rvs(_N_ROUGH, rng=0)), axis=0)  # loads that are none last
    n = np.isfinite(rough).sum(axis=0)
    rough = np.where(n > 0, rough, 0.0)
    places = (np.array([[[0.5]], [[0.25]]]) * n).astype(int)
    middle, low = np.take_along_axis(rough, places, axis=0)
    width = np.where(n > 0, middle - low, 1.0) + 1e-6
    steps = np.sinh(np.linspace(-_STEEPEST, _STEEPEST, _N_PLACE))
    y = middle[..., None] + 1.5 * width[..., None] * steps
    share = np.moveaxis(found.cdf(np.exp(np.moveaxis(y, -1, 0))), 0, -1)
    value = np.full((*middle.shape, len(prob)), np.inf)
    for place in np.ndindex(middle.shape):
        value[place] = _inverse(y[place], share[place], prob)
    return value


def _inverse(y: FloatArray, share: FloatArray, prob: FloatArray) -> FloatArray:
    """Return where a distribution function reaches some probabilities; infinite where nowhere."""
    inside = (share > 1e-12) & (share < 1 - 1e-12)
    inside &= np.append(True, np.diff(share) > 0)
    if inside.sum() < 4:
        return np.full(len(prob), np.inf)
    scores = ndtri(share[inside])  # nearly straight over y
    rising = np.append(True, np.diff(scores) > 0)
    value = PchipInterpolator(scores[rising], y[inside][rising])(ndtri(prob))
    return np.where(prob <= share.max(), value, np.inf)
