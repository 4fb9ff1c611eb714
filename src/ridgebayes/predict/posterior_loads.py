"""Log loads at which the draws of a posterior reach counts, at any texture.

Given a draw, the log load is normal. A Student error is a normal error whose scale differs between
draws, and an offset without rows adds its variance.
"""

from collections.abc import Iterator
from copy import copy
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy import special

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture, reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.posterior import Posterior, SharedOffsets
from ridgebayes.model.default_priors import slope_prior
from ridgebayes.model.forms import PowerLaw
from ridgebayes.predict.load_draws import MAX_DRAWS_TIMES_ROWS, Columns, survival
from ridgebayes.runtime.randomness import stream

Counts = IntArray | FloatArray
N_SHARED = N_KEPT // 4  # number of draws if rows share offsets, which are costly for each draw
DRAWS_DIVISOR = 16  # each averaged posterior has at least a sixteenth of its draws
# Avoids overflow; loads of such a draw are already near 0 or infinite.
_MAX_STUDENT_SCALE = np.finfo(float).eps ** -0.5


class PosteriorLoads:
    """Mean and standard deviation of the log load given each draw of a posterior, at nu = 0.5.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    kind : str, optional
        ``simulation``, or ``curve`` for loads without errors and offsets.
    share : float, optional
        Weight of the posterior in an average. At most this share of the draws of a single
        prediction is used, or a sixteenth if that is more: an average then has the Monte Carlo
        error of a single posterior at about the same cost.

    Attributes
    ----------
    theta : ndarray of float, shape (n_draw, n_parameter)
        Parameters of the draws used: at most 10,240, or 2,560 if rows share offsets, times `share`.
    stride : int
        Step between the posterior's draws that are used.
    has_mean : bool
        Whether the mean load is finite; under Student errors it is not.
    """

    def __init__(self, fit: Posterior, kind: str = "simulation", share: float = 1.0) -> None:
        self._is_curve = is_curve = kind == "curve"
        self._has_offsets = bool(fit.noise.factors) and not is_curve
        self._is_power_law = isinstance(fit.form, PowerLaw)
        n = N_SHARED if self._has_offsets else N_KEPT
        n = max(round(n * min(share, 1.0)), n // DRAWS_DIVISOR, 1)
        self.fit, self.stride = fit, -(-len(fit.draws) // n)
        self.theta = fit.draws[:: self.stride]
        self.has_mean = is_curve or fit.noise.tail == "normal"
        self._sigma = self.theta[:, fit.model.n_coefficient] * (not is_curve)
        if not self.has_mean:
            self._sigma *= _student_scales(self.theta[:, -1], fit.seed)
        self._which = np.arange(len(self.theta))  # draws of this part

    def __len__(self) -> int:
        return len(self._sigma)

    def parts(self) -> Iterator["PosteriorLoads"]:
        """Split the draws into parts that are computed one after the other.

        Smooth offsets need a matrix for each draw; only the matrices of one part are in memory.
        """
        n_place = self.fit.model.offsets.n_smooth if self._has_offsets else 0
        n_part = max(-(-len(self) * n_place**2 // MAX_DRAWS_TIMES_ROWS), 1)
        for which in np.array_split(np.arange(len(self)), n_part):
            part = copy(self)
            part._which, part._sigma = which, self._sigma[which]
            yield part

    @cached_property
    def _offsets(self) -> SharedOffsets | None:
        if not self._has_offsets:
            return None
        if len(self) == len(self.theta):
            return self.fit.shared_offsets(self.stride)
        model, scores = self.fit.model, self.fit.coordinates[:: self.stride][self._which]
        eta = self.theta[self._which, model.n_coefficient :]
        return SharedOffsets(model, eta, scores[:, model.n_parameter :])

    def at(self, texture: Texture, Q: Counts) -> Columns:
        """Return mean and standard deviation of log loads, both (n_draw, n_Q).

        The mean is infinite if a draw never reaches the count.
        """
        return self._add_offsets(np.log(self.load(texture, Q)), texture, Q)

    def at_ratio(self, ratio: float, Q: Counts) -> Columns:
        """Return the result of `at` for a new texture of pitch R with a given a/pitch."""
        texture = ratio, 1 - ratio
        # The power law's coefficient of a new texture is drawn from the prior, once for all ratios.
        drawn = (0.5, 0.5) if self._is_power_law else texture
        return self._add_offsets(np.log(self.load(drawn, Q)), texture, Q)

    def at_places(self, places: FloatArray, ids: IntArray) -> Columns:
        """Return the result of `at` at some of the places (a/R, b/R, nu, Q), shape (4, n)."""
        a, b, nu, Q = places[:, ids]
        if self._offsets is None and not self._is_power_law:
            mean, sd = self.at((a, b), Q)
        else:  # offsets and power-law coefficients are computed texture by texture
            mean, sd = np.empty((2, len(self), len(Q)))
            for texture, here in by_texture(a, b):
                mean[:, here], sd[:, here] = self.at(texture, Q[here])
        return mean - np.log(reduced_load(1.0, nu)), sd

    def load(self, texture: Texture, Q: Counts) -> FloatArray:
        """Return the form's load for each draw, (n_draw, n_Q); infinite if Q is never reached."""
        form, theta = self.fit.form, self.theta[:, : self.fit.model.n_coefficient]
        if isinstance(form, PowerLaw):
            bound = PowerLaw().bind((texture,))
            if texture in form.textures:  # select one K, as there may be thousands
                theta = theta[:, [form.textures.index(texture)]]
            else:
                prior = slope_prior(texture, self.fit.model.prior_of_slopes)
                rng = stream(self.fit.seed, "new texture", bound.parameter_names[0])
                theta = prior.value_at(special.ndtri(_strata(rng, len(theta))))[:, None]
            form = bound
        load = form.load(Q, *texture, theta[self._which])
        return np.nan_to_num(load, nan=np.inf, posinf=np.inf)

    def survival(self, texture: Texture, p: FloatArray) -> FloatArray:
        """Return P(Q >= 2), P(Q >= 4), ... at loads at nu = 0.5, shape (n, n_step)."""

        def columns(ids: IntArray) -> Columns:
            counts = 4 + 2 * ids
            if self._is_curve:  # compares unrounded loads, not their logarithms
                load = self.load(texture, counts)
                return load, np.zeros(load.shape)
            mean, sd = self.at(texture, counts)
            return self.within_body(mean, *texture, counts), sd

        with np.errstate(divide="ignore"):
            y = p if self._is_curve else np.log(p)
        return survival(columns, y, f" at a/R, b/R = {texture}")

    def check_scaling(self, ratio: float) -> None:
        """Raise InputError if loads of new textures are not proportional to the squared pitch.

        Parameters
        ----------
        ratio : float
            a/pitch at which the loads are compared.
        """
        loads, rule = [], "loads in proportion to the squared pitch, got others"
        for texture in ((ratio, 1 - ratio), (2 * ratio, 2 - 2 * ratio)):
            if self._is_power_law:
                prior = slope_prior(texture, self.fit.model.prior_of_slopes)
                loads.append(prior.value_at(np.array([-1.0, 0.0, 1.0])) ** -2.0)
                rule = "a prior of K in proportion to the pitch: with the median auto and without "
                rule += f"bounds, got {prior.words}"
            else:
                loads.append(self.load(texture, np.array([4, 6])))
        finite = np.isfinite(loads[0])
        if not np.allclose(loads[1][finite], 4 * loads[0][finite]):
            raise InputError(f"{self.fit.form.name}: expected {rule}")

    def within_body(self, mean: FloatArray, a: ArrayLike, b: ArrayLike, Q: Counts) -> FloatArray:
        """Return log loads, infinite for counts beyond the whole width under Student errors.

        Heavy tails would reach any count.
        """
        is_beyond = np.logical_and(not self.has_mean, widest_count(a, b) < Q)
        return np.where(is_beyond, np.inf, mean)

    def _add_offsets(self, mean: FloatArray, texture: Texture, Q: Counts) -> Columns:
        sd = np.broadcast_to(self._sigma[:, None], mean.shape)
        if self._offsets is None:
            return mean, sd
        steps, place = np.unique(Q, return_inverse=True)
        offset, variance = self._offsets.at(texture, steps.astype(np.int64))
        return mean + offset[:, place], np.sqrt(sd**2 + variance[:, place])


def _student_scales(df: FloatArray, seed: int) -> FloatArray:
    """Draw the scales of normal errors whose mixture is a Student error, shape (n_draw,).

    The scales are stratified quantiles of their distribution, in random order.
    """
    u = _strata(stream(seed, "scales of Student errors"), len(df))
    with np.errstate(divide="ignore"):
        scale: FloatArray = np.sqrt(0.5 * df / special.gammaincinv(0.5 * df, u))
    return np.minimum(scale, _MAX_STUDENT_SCALE)


def _strata(rng: np.random.Generator, n: int) -> FloatArray:
    """Draw a probability in each of n intervals of equal size, in random order, shape (n,)."""
    value: FloatArray = (rng.permutation(n) + rng.random(n)) / n
    return value


def widest_count(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Return the count of a body that is in contact over its whole width."""
    return np.asarray(2 + 2 * np.floor(np.maximum(1 - np.divide(b, 2), 0) / np.add(a, b)))


def by_texture(a: FloatArray, b: FloatArray) -> list[tuple[Any, IntArray]]:
    """Return the distinct textures of flattened widths, and the places of each."""
    groups = pd.DataFrame({"a": a.ravel(), "b": b.ravel()}).groupby(["a", "b"])
    return [(texture, np.asarray(here)) for texture, here in groups.indices.items()]
