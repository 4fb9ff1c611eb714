"""Loads at which each draw of a posterior reaches a count, and the shares that reach it by a load.

`PosteriorLoads` gives location and scale of each draw's log load; `Average` averages
P(load(Q) <= p) of one texture over draws.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from scipy.special import ndtr, stdtr

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior, SharedOffsets
from ridgebayes.model.default_priors import slope_prior
from ridgebayes.model.forms import Form, PowerLaw
from ridgebayes.predict.interpolant import Interpolant
from ridgebayes.runtime.randomness import stream

Counts = IntArray | FloatArray
N_LOAD_DRAWS = 2_560  # draws behind a load distribution; its quantiles move by 0.02 sd at most
_LEAST_SHARE = 16  # part of these that a posterior of no weight in an average has


@dataclass(frozen=True, eq=False)
class PosteriorLoads:
    """Some draws of a fit, with the offsets that rows share.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    theta : ndarray of float, shape (n_draw, n_parameter)
        Parameters.
    offsets : SharedOffsets or None
        Shared offsets of the same draws.
    """

    fit: Posterior
    theta: FloatArray
    offsets: SharedOffsets | None

    @classmethod
    def of(cls, fit: Posterior, n: int, kind: str) -> "PosteriorLoads":
        """Take about n of a fit's draws, evenly; a form's own curve needs no offsets."""
        stride = -(-len(fit.draws) // n)
        offsets = None if kind == "curve" else fit.shared_offsets(stride)
        return cls(fit, fit.draws[::stride], offsets)

    @classmethod
    def of_new_ones(cls, fit: Posterior, ratio: float) -> "PosteriorLoads":
        """Take draws for textures that none was calibrated on, whose loads scale with the pitch.

        Parameters
        ----------
        fit : Posterior
            Posterior.
        ratio : float
            An a/pitch to try that at.

        Raises
        ------
        InputError
            If the form's loads do not go with the square of the pitch.
        """
        own, x, Q = cls.of(fit, n_draws(fit), "simulation"), ratio, np.array([4, 6])
        if isinstance(fit.form, PowerLaw):
            _check_scaling(fit, ratio)
            return own
        twice = own.load((2 * x, 2 - 2 * x), Q, 0.5) / own.load((x, 1 - x), Q, 0.5)
        if not np.allclose(twice[np.isfinite(twice)], 4):
            raise InputError(
                f"{fit.form.name}: expected loads that go with the square of the pitch, got others"
            )
        return own

    @property
    def df(self) -> FloatArray | None:
        """Degrees of freedom of each draw's errors; None where these are normal."""
        return self.theta[:, -1] if self.fit.noise.tail == "student" else None

    def cdf(self, z: FloatArray) -> FloatArray:
        """Return P(error <= z scales) of each draw, (n_draw, n), with small absolute errors."""
        share: FloatArray = ndtr(z) if self.df is None else stdtr(self.df[:, None], z)
        return share

    def load(self, texture: Texture, Q: Counts, nu: float | FloatArray) -> FloatArray:
        """Return the form's own load of each draw, (n_draw, n_Q); infinite where none reaches Q."""
        form, theta = self._form_at(texture)
        return _or_infinite(form.load(Q, *texture, theta, nu))

    def log_load(
        self, texture: Texture, Q: Counts, nu: float | FloatArray, kind: str
    ) -> tuple[FloatArray, FloatArray]:
        """Return location and scale of the log load of each draw, both (n_draw, n_Q).

        The location is infinite for a draw whose rate reaches no further ridge.
        """
        mean = np.log(self.load(texture, Q, nu))
        if kind == "curve" or self.offsets is None:
            return mean, self._scale(mean, kind)
        sigma = self.theta[:, self.fit.model.n_coefficient, None]
        steps, places = np.unique(Q, return_inverse=True)
        offset, variance = self.offsets.at(texture, steps.astype(np.int64))
        if self.df is None:
            scale = np.sqrt(sigma**2 + variance)
        else:  # a normal and a t have no closed-form sum: one offset is drawn for each draw
            rng = stream(self.fit.seed, f"offset of a/R {texture[0]!r}, b/R {texture[1]!r}")
            offset = offset + np.sqrt(variance) * rng.standard_normal((len(offset), 1))
            scale = np.broadcast_to(sigma, offset.shape)
        return mean + offset[:, places], scale[:, places]

    def log_loads(
        self, a: FloatArray, b: FloatArray, Q: FloatArray, nu: FloatArray, kind: str
    ) -> tuple[FloatArray, FloatArray]:
        """Return what `log_load` does for many textures: all arguments are of shape (n,)."""
        form = self.fit.form
        if self.offsets is None and not isinstance(form, PowerLaw):
            theta = self.theta[:, : self.fit.model.n_coefficient]
            mean = np.log(_or_infinite(form.load(Q, a, b, theta, nu)))
            return mean, self._scale(mean, kind)
        mean, scale = np.empty((2, len(self.theta), len(Q)))
        first, place = distinct(a, b)
        for j, texture in enumerate(zip(a[first].tolist(), b[first].tolist(), strict=True)):
            here = place == j
            mean[:, here], scale[:, here] = self.log_load(texture, Q[here], nu[here], kind)
        return mean, scale

    def _scale(self, mean: FloatArray, kind: str) -> FloatArray:
        """Return the scale of errors that are all a row's own, in the shape of `mean`."""
        sigma = self.theta[:, self.fit.model.n_coefficient, None]
        return np.zeros(mean.shape) if kind == "curve" else np.broadcast_to(sigma, mean.shape)

    def _form_at(self, texture: Texture) -> tuple[Form, FloatArray]:
        """Return the form and its draws for a texture; a new one draws its K from the prior."""
        fit = self.fit
        theta = self.theta[:, : fit.model.n_coefficient]
        if not isinstance(fit.form, PowerLaw):
            return fit.form, theta
        form = PowerLaw().bind((texture,))
        if texture in fit.form.textures:  # its own K alone: there may be thousands
            return form, theta[:, [fit.form.textures.index(texture)]]
        prior = slope_prior(texture, fit.model.prior_of_slopes)
        rng = stream(fit.seed, "new texture", form.parameter_names[0])
        return form, prior.rvs(rng, len(theta))[:, None]


def _check_scaling(fit: Posterior, ratio: float) -> None:
    """Raise InputError if the prior of a new texture's K does not go with one over the pitch."""
    slopes = fit.model.prior_of_slopes
    one, twice = (slope_prior((k * ratio, k - k * ratio), slopes) for k in (1, 2))
    score = np.array([-1.0, 0.0, 1.0])
    if not np.allclose(one.value_at(score), 2 * twice.value_at(score)):
        raise InputError(
            f"{fit.form.name}: expected a prior of K that goes with the pitch, so that its median "
            f"is auto and it has no bounds, got {one.words}"
        )


def n_draws(fit: Posterior, share: float = 1.0) -> int:
    """Return how many draws probabilities of counts are averaged over, if the fit has as many.

    `share`: the fit's own weight where several are averaged, see `of_share`.
    """
    n = N_LOAD_DRAWS if fit.noise.factors else len(fit.draws)
    return of_share(n if fit.noise.tail == "normal" else n // 2, share)


def of_share(n: int, share: float) -> int:
    """Return how many of n draws are one posterior's by its weight in an average, n / 16 at least.

    In proportion to weights draws of all posteriors tell as much as n of a single one.
    """
    return max(round(n * min(share, 1.0)), n // _LEAST_SHARE, 1)


def _or_infinite(load: FloatArray) -> FloatArray:
    """Return loads, infinite where a form has none."""
    return np.nan_to_num(load, nan=np.inf, posinf=np.inf)


def distinct(*columns: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the flat index of each distinct row of some columns, and the row of each place."""
    frame = pd.DataFrame({i: column.ravel() for i, column in enumerate(columns)})
    place = frame.groupby(list(frame)).ngroup().to_numpy().astype(np.int64)
    return np.unique(place, return_index=True)[1].astype(np.int64), place


_SATURATED = 8.3  # standard deviations beyond which a normal distribution function is 0 or 1
_AT_ONCE = 2**20  # draws times loads, which bounds memory
_EXACT, _CLOSE = 1e-14, 1e-8  # errors of tables: of normal errors, and of Student errors
_SHIFTED = 3e-14  # of log loads: two counts' means are one but for a shift
_Table = Callable[[FloatArray], FloatArray]  # of log loads


class Average:
    """Means of P(load(Q) <= p) over draws.

    Parameters
    ----------
    draws : PosteriorLoads
        Draws.
    kind : str
        ``simulation`` or ``curve``.
    """

    def __init__(self, draws: PosteriorLoads, kind: str) -> None:
        self._draws, self._kind = draws, kind
        self._known: tuple[FloatArray, FloatArray, _Table] | None = None

    def at(self, texture: Texture, Q: IntArray, p: FloatArray, nu: float) -> FloatArray:
        """Return P(load(Q) <= p), shape (n_load, n_Q)."""
        draws = self._draws
        if self._kind == "curve":
            # Compared as loads, so that a draw's own transition load counts as reached.
            load = np.sort(draws.load(texture, Q, nu), axis=0)
            shares = [np.searchsorted(one, p, side="right") / len(one) for one in load.T]
            return np.stack(shares, axis=1)
        mean, scale = draws.log_load(texture, Q, nu, self._kind)
        with np.errstate(divide="ignore"):
            y = np.log(p)
        columns = zip(mean.T, scale.T, strict=True)
        return np.stack([self._errors(y, m, s) for m, s in columns], axis=1)

    def _errors(self, y: FloatArray, mean: FloatArray, scale: FloatArray) -> FloatArray:
        """Return the mean of distribution functions of errors at each y, shape (n,)."""
        result, here = np.zeros(len(y)), np.flatnonzero(y > -np.inf)
        if self._draws.df is None:
            reach = _SATURATED * scale
            result[y > (mean + reach).max()] = 1.0
            here = np.flatnonzero((y >= (mean - reach).min()) & (result == 0))
        finite = np.isfinite(mean)
        if not len(here) or not finite.any():
            return result
        means = partial(self._mean, mean=mean, scale=scale)

        def table() -> _Table:
            middle, width = np.median(mean[finite]), np.median(scale)

            # Tails reach every load: in this coordinate they are no longer than the rest.
            def along(x: FloatArray) -> FloatArray:
                return means(middle + width * np.sinh(x))

            tabulated = Interpolant(along, _EXACT if self._draws.df is None else _CLOSE)
            return lambda y: tabulated(np.arcsinh((y - middle) / width))

        known, shift = self._shared(mean, scale, table)
        result[here] = np.clip(known(y[here] - shift), 0.0, 1.0)
        return result

    def _shared(
        self, mean: FloatArray, scale: FloatArray, make: Callable[[], _Table]
    ) -> tuple[_Table, float]:
        """Return a table of a count's mean, and how far in log load that lies off.

        Counts of one texture mostly share theirs.
        """
        if self._known is not None and np.isfinite(mean).all():
            known, known_scale, table = self._known
            with np.errstate(invalid="ignore"):
                apart = mean - known
                off = max(np.ptp(apart), np.abs(scale - known_scale).max())
            if off < max(_CLOSE * float(scale.min()), _SHIFTED):
                return table, float(apart[0])
        self._known = mean, scale, make()
        return self._known[2], 0.0

    def _mean(self, y: FloatArray, mean: FloatArray, scale: FloatArray) -> FloatArray:
        """Return the mean at each y, shape (n,), evaluated there."""
        parts, n = [], max(_AT_ONCE // len(mean), 1)
        for i in range(0, len(y), n):
            z = (y[i : i + n] - mean[:, None]) / scale[:, None]
            parts.append(self._draws.cdf(z).mean(axis=0))
        return np.concatenate(parts)
