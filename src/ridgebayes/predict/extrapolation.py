"""Flags of quantities beyond the calibrated range, one bit for each quantity.

>>> import numpy as np
>>> names_of(np.array([0, LOAD, Q | RIDGE])).tolist()
['', 'load', 'Q,a/R']
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import BoolArray, FloatArray, Json
from ridgebayes.contact.axes import ROUNDING
from ridgebayes.contact.scaling import Texture, reduced_load
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import PowerLaw

NAMES = ("Q", "load", "a/pitch", "a/R", "b/R", "texture", "offset")
_BITS = Q, LOAD, RATIO, RIDGE, GROOVE, TEXTURE, OFFSET = [2**bit for bit in range(len(NAMES))]
_MAX_WIDTH_FACTOR = 1.5  # widths beyond their calibrated range by more than this are flagged
# Predictions omit error models with a smaller weight for their form. A mixture is flagged as
# extrapolated if a part, or a share of draws, above this share is.
MIN_SHARE = 0.01

Flags = np.ndarray[tuple[int, ...], np.dtype[np.uint8]]


@dataclass(frozen=True)
class CalibratedRange:
    """Range of the rows to which a posterior was fitted.

    Parameters
    ----------
    ratio, ridge, groove : (float, float)
        Lowest and highest a/pitch, a/R and b/R.
    Q_max : int
        Highest count.
    load_max : float
        Highest load p/E, reduced to nu = 0.5.
    places : frozenset of (a/R, b/R, Q)
        Textures and counts of the rows.
    textures : frozenset of (a/R, b/R), or None
        Textures with a fitted coefficient, or None if the form needs no coefficient per texture.
    """

    ratio: tuple[float, float]
    ridge: tuple[float, float]
    groove: tuple[float, float]
    Q_max: int
    load_max: float
    places: frozenset[tuple[float, float, int]]
    textures: frozenset[Texture] | None

    @classmethod
    def of(cls, fit: Posterior) -> "CalibratedRange":
        """Return the range of a posterior's rows."""
        data = fit.model.data
        a, b = data.a_over_R, data.b_over_R
        rows = zip(data.texture.tolist(), data.Q.tolist(), strict=True)
        return cls(
            _ends(a / (a + b)),
            _ends(a),
            _ends(b),
            int(data.Q.max()),
            math.exp(data.log_load.max()),
            frozenset((*data.textures[j], count) for j, count in rows),
            frozenset(fit.form.textures) if isinstance(fit.form, PowerLaw) else None,
        )

    def to_dict(self) -> Json:
        """Return the range as JSON values; the load is reduced to nu = 0.5."""
        ends: Json = {
            "a_over_R": list(self.ridge),
            "b_over_R": list(self.groove),
            "a_over_pitch": list(self.ratio),
            "Q_max": self.Q_max,
            "p_over_E_max": self.load_max,
        }
        if self.textures is not None:
            ends["textures"] = [list(texture) for texture in sorted(self.textures)]
        return ends

    @property
    def limit(self) -> float:
        """Load p/E at nu = 0.5 above which predictions are flagged."""
        return self.load_max * (1 + ROUNDING)

    def texture_flags(
        self, a_over_R: FloatArray, b_over_R: FloatArray, offset: ArrayLike = 0.0
    ) -> Flags:
        """Return the flags of textures.

        Parameters
        ----------
        a_over_R, b_over_R : ndarray of float, shape (...), dimensionless
            Textures.
        offset : array_like of float, broadcastable, optional
            Offset of the body from the groove's centre.

        Returns
        -------
        ndarray of uint8, shape (...)
            Set where a/pitch is beyond its calibrated range, a/R or b/R is below the lowest
            calibrated value / 1.5 or above the highest x 1.5, the form has no coefficient for the
            texture, or the body is off centre.
        """
        a, b = np.asarray(a_over_R, dtype=float), np.asarray(b_over_R, dtype=float)
        flags = _flag(_beyond(a / (a + b), self.ratio, 1), RATIO)
        flags |= _flag(_beyond(a, self.ridge, _MAX_WIDTH_FACTOR), RIDGE)
        flags |= _flag(_beyond(b, self.groove, _MAX_WIDTH_FACTOR), GROOVE)
        if self.textures is not None:
            pairs = zip(a.ravel().tolist(), b.ravel().tolist(), strict=True)
            unknown = np.array([pair not in self.textures for pair in pairs], dtype=bool)
            flags |= _flag(unknown.reshape(a.shape), TEXTURE)
        return flags | _flag(np.not_equal(offset, 0), OFFSET)

    def load_flags(self, p_over_E: ArrayLike, nu: ArrayLike) -> Flags:
        """Return the flags of loads above the highest calibrated load.

        The half-plane's scaling law extends to other pitches but not to higher loads, whose strains
        are larger.
        """
        return _flag(reduced_load(p_over_E, nu) > self.limit, LOAD)

    def count_flags(self, count: ArrayLike) -> Flags:
        """Return the flags of counts above the highest calibrated count."""
        return _flag(np.asarray(count) > self.Q_max, Q)

    def highest_load(
        self, a_over_R: FloatArray, b_over_R: FloatArray, count: FloatArray, nu: FloatArray
    ) -> FloatArray:
        """Return the load p/E above which a predicted load is flagged, shape (n_place,).

        The limit is infinite at a fitted texture and count: the predicted load may exceed the
        highest observed load, but this transition was itself observed.
        """
        places = zip(a_over_R.tolist(), b_over_R.tolist(), count.tolist(), strict=True)
        seen = np.array([place in self.places for place in places], dtype=bool)
        return np.where(seen, np.inf, self.limit / reduced_load(1.0, nu))


def common_flags(flags: Flags) -> Flags:
    """Return the flags that are set in more than 1 % of the draws, the first axis."""
    is_common = [((flags & bit) > 0).mean(axis=0) > MIN_SHARE for bit in _BITS]
    return np.asarray(np.bitwise_or.reduce(list(map(_flag, is_common, _BITS))))


def names_of(flags: Flags) -> np.ndarray:
    """Return the names of flagged quantities, separated by commas; an empty text if none is."""
    values, place = np.unique(flags, return_inverse=True)
    names = [
        ",".join(name for bit, name in zip(_BITS, NAMES, strict=True) if value & bit)
        for value in values.tolist()
    ]
    return np.array(names, dtype=object)[place.ravel()].reshape(np.shape(flags))


def _ends(values: FloatArray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _beyond(value: FloatArray, ends: tuple[float, float], margin: float) -> BoolArray:
    low, high = ends[0] / margin * (1 - ROUNDING), ends[1] * margin * (1 + ROUNDING)
    return (value < low) | (value > high)


def _flag(where: BoolArray, bit: int) -> Flags:
    return np.asarray(where).astype(np.uint8) * np.uint8(bit)
