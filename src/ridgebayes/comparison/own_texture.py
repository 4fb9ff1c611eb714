"""Quantiles of the load at textures that were not fitted, as one table for the report's page.

Under every built-in form ``ln(p/E) = 2 ln L - ln((1 - nu^2)/0.75) + g_Q(a/pitch)``, where L is the
pitch over R, and the offsets of a new texture depend on Q and a/pitch alone. So one table of
quantiles of g over Q and a/pitch answers for every texture, body and unit.
"""

import math
from dataclasses import dataclass
from itertools import compress

import numpy as np
from scipy.constants import golden
from scipy.special import ndtr, ndtri

from ridgebayes._types import FloatArray, Json
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.errors import InputError
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.model.forms import PowerLaw
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.predict.posterior_loads import PosteriorLoads
from ridgebayes.predict.predict import Predictive
from ridgebayes.predict.q_distribution import heavy_parts

_PROB = ndtr(ndtri(0.05) * np.linspace(2, -2, 17))  # at even steps of the normal score
_LEAST_RATIO = 0.04  # of a/pitch; and as far from 1
_N_RATIO = 10  # numbers of a/pitch below, within and above the calibrated
_MOST_Q = 40  # the last count, unless more were calibrated
_N_SAMPLE = 2 * N_KEPT  # loads of each place
_UNIT = 1e-5  # of ln load, far below what Monte Carlo error leaves


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
    *Accuracy.* 0.1 % in the load from 5 to 95 %, beside the Monte Carlo error of `predict_load`;
    beyond some tenths of a per cent, of Student errors a few per cent.
    """
    if not comparison.probabilities:
        return OwnTexture(None, "no form has an evidence that can be used")
    posteriors, weights = zip(*comparison.averaged, strict=True)
    try:
        for posterior in posteriors:
            PosteriorLoads(posterior).check_scaling(0.5)
    except InputError as error:
        return OwnTexture(None, str(error))
    heavy = list(compress(posteriors, heavy_parts(np.array(weights))))
    calibrated = CalibratedRange.of(heavy[0])
    power_law = any(isinstance(posterior.form, PowerLaw) for posterior in heavy)
    ratio, Q = _nodes(calibrated.ratio), np.arange(4, max(_MOST_Q, 2 * calibrated.Q_max) + 1, 2)
    prob = _PROB.round(12)
    g = np.round(_log_quantiles(comparison, ratio, Q, prob).ravel() / _UNIT)
    reached = {key: value for key, value in calibrated.to_dict().items() if key != "textures"}
    return OwnTexture(
        {
            "ratio": ratio.round(12).tolist(),
            "Q": Q.tolist(),
            "prob": prob.tolist(),
            "unit": _UNIT,
            "g": [int(value) if math.isfinite(value) else None for value in g],
            "calibrated": reached,
            "fitted": [list(texture) for texture in posteriors[0].model.data.textures],
            "knows": power_law or any("texture" in posterior.noise.factors for posterior in heavy),
            "power_law": power_law,
        }
    )


def _nodes(calibrated: tuple[float, float]) -> FloatArray:
    """Return places in a/pitch: both ends of the calibrated range, and more within it."""
    low, high = (min(max(end, 2 * _LEAST_RATIO), 1 - 2 * _LEAST_RATIO) for end in calibrated)
    below = np.geomspace(_LEAST_RATIO, low, _N_RATIO)
    above = 1 - np.geomspace(_LEAST_RATIO, 1 - high, _N_RATIO)
    within = np.linspace(low, high, _N_RATIO if high > low else 1)
    return np.unique(np.concatenate([below, within, above]).round(12))


def _log_quantiles(
    model: Predictive, ratio: FloatArray, Q: np.ndarray, prob: FloatArray
) -> FloatArray:
    """Return quantiles of ln(p/E) at a pitch of R, shape (n_ratio, n_Q, n_prob).

    Each draw has some errors: steps of the golden ratio, over draws in the order of their loads,
    leave no gap in probability.
    """
    load = model.predict_load(ratio[:, None], 1 - ratio[:, None], Q)
    n = -(-_N_SAMPLE // len(load.weight)), len(load.weight), 1
    score = ndtri((np.arange(math.prod(n)) + 0.5) / golden % 1).reshape(n)
    value = np.empty((*load.shape, len(prob)))
    columns = load.draws.columns(load.place.ravel())  # both at once: they take most of the time
    log_mean, log_sd = (np.reshape(x, (len(load.weight), *load.shape)) for x in columns)
    for i in range(len(ratio)):
        order = np.argsort(log_mean[:, i], axis=0)
        mean, sd = (np.take_along_axis(x[:, i], order, axis=0) for x in (log_mean, log_sd))
        weights = np.tile(load.weight[order], (n[0], 1))
        y = (mean + sd * score).reshape(-1, len(Q))
        value[i] = np.quantile(y, prob, axis=0, weights=weights, method="inverted_cdf").T
    return value
