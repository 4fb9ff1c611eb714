"""Table of load quantiles from which the report's page predicts new textures.

Under every built-in form ``ln(p/E) = 2 ln L - ln((1 - nu^2)/0.75) + g_Q(a/pitch)``, where L is the
pitch over R, and the offsets of a new texture depend on Q and a/pitch alone. One table of quantiles
of g over Q and a/pitch is therefore enough for every texture, body and unit.
"""

import math
from dataclasses import dataclass
from itertools import compress

import numpy as np
from scipy.constants import golden
from scipy.special import ndtr, ndtri

from ridgebayes._types import FloatArray, Json
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.model.forms import PowerLaw
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.predict.posterior_loads import PosteriorLoads
from ridgebayes.predict.predict import Predictive
from ridgebayes.predict.q_distribution import heavy_parts, shares

_PROB = ndtr(ndtri(0.05) * np.linspace(2, -2, 17))  # evenly spaced normal scores
_MIN_RATIO = 0.04  # smallest a/pitch; the largest is 1 minus this value
_N_RATIO = 10  # number of a/pitch below, within and above the calibrated range
_MAX_Q = 40  # largest count, or twice the largest calibrated count if larger
_N_SAMPLE = 2 * N_KEPT  # sampled loads per place
_LN_LOAD_UNIT = 1e-5  # rounding of ln load, far below the Monte Carlo error


@dataclass(frozen=True)
class OwnTexture:
    """Load quantiles from which the page predicts new textures.

    Parameters
    ----------
    table : mapping or None
        ``ratio`` (a/pitch), ``Q`` and ``prob``; ``g``, quantiles of ln(p/E) at pitch R and nu = 0.5
        in units of ``unit``, in the order ratio, Q, prob, and None if too few draws reach Q;
        ``calibrated``, see `CalibratedRange.to_dict`; ``fitted``, textures with rows; ``knows``,
        whether fitted textures have their own offsets or coefficients; ``power_law``, whether a
        heavy part of the average is a power law; ``normal``, weight of the parts with normal
        errors, which alone reach counts beyond the body's width.
    why : str
        Reason if there is no table; else empty.
    """

    table: Json | None
    why: str = ""


def own_texture(comparison: Comparison) -> OwnTexture:
    """Return load quantiles over a/pitch and Q, averaged as in `Comparison.predict_load`.

    Parameters
    ----------
    comparison : Comparison
        Comparison of forms.

    Returns
    -------
    OwnTexture
        The table is None if no form has an evidence, or if a form's loads or the prior of the
        power law's K do not scale with the pitch.

    Notes
    -----
    *Accuracy.* In addition to the Monte Carlo error of `predict_load`, the load has an error of
    0.1 % for quantiles from 5 to 95 %, and of some tenths of a per cent beyond (a few per cent
    under Student errors).
    """
    try:
        posteriors, weights = zip(*comparison.averaged, strict=True)
        for posterior in posteriors:
            PosteriorLoads(posterior).check_scaling(0.5)
    except (ComputationError, InputError) as error:
        return OwnTexture(None, str(error))
    heavy = list(compress(posteriors, heavy_parts(np.array(weights))))
    calibrated = CalibratedRange.of(heavy[0])
    power_law = any(isinstance(posterior.form, PowerLaw) for posterior in heavy)
    ratio, Q = _nodes(calibrated.ratio), np.arange(4, max(_MAX_Q, 2 * calibrated.Q_max) + 1, 2)
    prob = _PROB.round(12)
    g = np.round(_log_quantiles(comparison, ratio, Q, prob).ravel() / _LN_LOAD_UNIT)
    reached = {key: value for key, value in calibrated.to_dict().items() if key != "textures"}
    return OwnTexture(
        {
            "ratio": ratio.round(12).tolist(),
            "Q": Q.tolist(),
            "prob": prob.tolist(),
            "unit": _LN_LOAD_UNIT,
            "g": [int(value) if math.isfinite(value) else None for value in g],
            "calibrated": reached,
            "fitted": [list(texture) for texture in posteriors[0].model.data.textures],
            "knows": power_law or any("texture" in posterior.noise.factors for posterior in heavy),
            "power_law": power_law,
            "normal": float(shares(weights)[[p.noise.tail == "normal" for p in posteriors]].sum()),
        }
    )


def _nodes(calibrated: tuple[float, float]) -> FloatArray:
    """Return values of a/pitch below, within and above the calibrated range, with both ends."""
    low, high = (min(max(end, 2 * _MIN_RATIO), 1 - 2 * _MIN_RATIO) for end in calibrated)
    below = np.geomspace(_MIN_RATIO, low, _N_RATIO)
    above = 1 - np.geomspace(_MIN_RATIO, 1 - high, _N_RATIO)
    within = np.linspace(low, high, _N_RATIO if high > low else 1)
    return np.unique(np.concatenate([below, within, above]).round(12))


def _log_quantiles(
    model: Predictive, ratio: FloatArray, Q: np.ndarray, prob: FloatArray
) -> FloatArray:
    """Return quantiles of ln(p/E) at a pitch of R, shape (n_ratio n_Q, n_prob).

    Each draw gets several error scores. Steps of the golden ratio over the draws, sorted by load,
    spread the scores evenly.
    """
    load = model.predict_load(ratio[:, None], 1 - ratio[:, None], Q)
    n = -(-_N_SAMPLE // len(load.weight)), len(load.weight)
    score = ndtri((np.arange(math.prod(n)) + 0.5) / golden % 1).reshape(n)
    value = np.empty((load.place.size, len(prob)))
    columns = load.columns(load.place.ravel())  # one call, which takes most of the time
    for i, (mean, sd) in enumerate(zip(*map(np.transpose, columns), strict=True)):
        order = np.argsort(mean)
        y = (mean[order] + sd[order] * score).ravel()
        rising = np.argsort(y)
        share = np.cumsum(np.tile(load.weight[order], n[0])[rising])
        value[i] = y[rising[np.searchsorted(share, prob * share[-1])]]
    return value
