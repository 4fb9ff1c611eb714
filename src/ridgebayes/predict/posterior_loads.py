"""Log loads at which the draws of a posterior reach counts, at any texture.

Given a draw, the log load is normal: Student errors are normal ones whose scale varies from draw to
draw, and an offset that is not calibrated adds its variance.
"""

from copy import copy
from functools import cached_property

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
from ridgebayes.model.forms import Form, PowerLaw
from ridgebayes.predict.load_draws import MAX_DRAWS_TIMES_ROWS
from ridgebayes.runtime.randomness import stream

Counts = IntArray | FloatArray
N_SHARED = N_KEPT // 4  # draws where rows share offsets, whose places are worked out for each draw
LEAST_SHARE = 16  # part of these that a posterior of no weight in an average has
_WIDEST = 1e6  # of a Student scale: loads of such a draw are next to 0 or infinite


class PosteriorLoads:
    """Location and standard deviation of the log loads of a posterior's draws, at nu = 0.5.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    kind : str, optional
        ``simulation``, or ``curve`` for the form's own loads, which have no errors and offsets.
    share : float, optional
        Weight of the posterior in an average, which takes this share of the draws, a sixteenth at
        least: in proportion to weights draws of all posteriors tell as much as those of a single
        one.

    Attributes
    ----------
    theta : ndarray of float, shape (n_draw, n_parameter)
        Parameters: all draws, or 2,560 where rows share offsets.
    stride : int
        They are every n-th of the posterior's draws.
    has_mean : bool
        Whether loads have a mean, which they have not under Student errors.
    """

    def __init__(self, fit: Posterior, kind: str = "simulation", share: float = 1.0) -> None:
        is_curve = kind == "curve"
        n = N_SHARED if fit.noise.factors and not is_curve else len(fit.draws)
        n = max(round(n * min(share, 1.0)), n // LEAST_SHARE, 1)
        self.fit, self.is_curve, self.stride = fit, is_curve, -(-len(fit.draws) // n)
        self.theta = fit.draws[:: self.stride]
        self.has_mean = is_curve or fit.noise.tail == "normal"
        self._has_offsets = bool(fit.noise.factors) and not is_curve
        self._sigma = self.theta[:, fit.model.n_coefficient] * (not is_curve)
        if not self.has_mean:
            self._sigma *= _student_scales(self.theta[:, -1], fit.seed)
        self._which: slice | IntArray = slice(None)  # of these draws, in a part

    def __len__(self) -> int:
        return len(self._sigma)

    def parts(self) -> list["PosteriorLoads"]:
        """Return the loads of some draws after others.

        Smooth offsets take a matrix for each draw; the matrices of one part are held at once.
        """
        n_place = self.fit.model.offsets.n_smooth if self._has_offsets else 0
        n_part = -(-len(self) * n_place**2 // MAX_DRAWS_TIMES_ROWS)
        if n_part <= 1:
            return [self]
        parts = []
        for which in np.array_split(np.arange(len(self)), n_part):
            part = copy(self)
            part._which, part._sigma = which, self._sigma[which]
            parts.append(part)
        return parts

    @cached_property
    def _offsets(self) -> SharedOffsets | None:
        if not self._has_offsets or isinstance(self._which, slice):
            return self.fit.shared_offsets(self.stride) if self._has_offsets else None
        model, scores = self.fit.model, self.fit.coordinates[:: self.stride][self._which]
        eta = self.theta[self._which, model.n_coefficient :]
        return SharedOffsets(model, eta, scores[:, model.n_parameter :])

    def at(self, texture: Texture, Q: Counts) -> tuple[FloatArray, FloatArray]:
        """Return location and standard deviation of log loads, both (n_draw, n_Q).

        The location is infinite for a draw whose rate reaches no further ridge.
        """
        return self._with_offsets(np.log(self.load(texture, Q)), texture, Q)

    def at_ratio(self, ratio: float, Q: Counts) -> tuple[FloatArray, FloatArray]:
        """Return the same of a new texture whose pitch is R, at a ratio a/pitch."""
        texture = ratio, 1 - ratio
        # A power law says of a new texture what its prior does: the same draw at all of them.
        shown = (0.5, 0.5) if isinstance(self.fit.form, PowerLaw) else texture
        return self._with_offsets(np.log(self.load(shown, Q)), texture, Q)

    def at_places(
        self, a: FloatArray, b: FloatArray, Q: FloatArray, nu: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return what `at` does for places of any nu, all of shape (n,): both (n_draw, n)."""
        if self._offsets is None and not isinstance(self.fit.form, PowerLaw):
            mean = np.log(self._load_of(self.fit.form, self._coefficients, a, b, Q))
            sd = np.broadcast_to(self._sigma[:, None], mean.shape)
        else:  # a texture may have an offset or a K of its own
            mean, sd = np.empty((2, len(self), len(Q)))
            first, place = distinct(a, b)
            for j, i in enumerate(first):
                here = place == j
                mean[:, here], sd[:, here] = self.at((float(a[i]), float(b[i])), Q[here])
        return mean - np.log(reduced_load(1.0, nu)), sd

    def load(self, texture: Texture, Q: Counts) -> FloatArray:
        """Return the form's own load of each draw, (n_draw, n_Q); infinite where none reaches Q."""
        form, theta = self.fit.form, self._coefficients
        if isinstance(form, PowerLaw):
            bound = PowerLaw().bind((texture,))
            if texture in form.textures:  # its own K alone: there may be thousands
                theta = theta[:, [form.textures.index(texture)]]
            else:
                prior = slope_prior(texture, self.fit.model.prior_of_slopes)
                rng = stream(self.fit.seed, "new texture", bound.parameter_names[0])
                theta = prior.rvs(rng, len(theta))[:, None]
            form = bound
        return self._load_of(form, theta, *texture, Q)

    def check_scaling(self, ratio: float) -> None:
        """Raise InputError if loads of new textures do not go with the square of the pitch.

        Parameters
        ----------
        ratio : float
            An a/pitch to try that at.
        """
        form = self.fit.form
        if not isinstance(form, PowerLaw):
            pitches = [self.load((k * ratio, k - k * ratio), np.array([4, 6])) for k in (1, 2)]
            finite = np.isfinite(pitches[0])
            if not np.allclose(pitches[1][finite], 4 * pitches[0][finite]):
                raise InputError(
                    f"{form.name}: expected loads in proportion to the squared pitch, got others"
                )
            return
        slopes = self.fit.model.prior_of_slopes
        priors = [slope_prior((k * ratio, k - k * ratio), slopes) for k in (1, 2)]
        score = np.array([-1.0, 0.0, 1.0])
        if not np.allclose(priors[0].value_at(score), 2 * priors[1].value_at(score)):
            raise InputError(
                f"{form.name}: expected a prior of K in proportion to the pitch: with the median "
                f"auto and without bounds, got {priors[0].words}"
            )

    @property
    def _coefficients(self) -> FloatArray:
        return self.theta[:, : self.fit.model.n_coefficient]

    def _load_of(
        self, form: Form, theta: FloatArray, a: ArrayLike, b: ArrayLike, Q: Counts
    ) -> FloatArray:
        load = form.load(Q, a, b, theta[self._which])
        return np.nan_to_num(load, nan=np.inf, posinf=np.inf)

    def _with_offsets(
        self, mean: FloatArray, texture: Texture, Q: Counts
    ) -> tuple[FloatArray, FloatArray]:
        sd = np.broadcast_to(self._sigma[:, None], mean.shape)
        if self._offsets is None:
            return mean, sd
        steps, place = np.unique(Q, return_inverse=True)
        offset, variance = self._offsets.at(texture, steps.astype(np.int64))
        return mean + offset[:, place], np.sqrt(sd**2 + variance[:, place])


def _student_scales(df: FloatArray, seed: int) -> FloatArray:
    """Return the scales of normal errors that make Student errors of unit scale, shape (n_draw,).

    They are spread evenly over their distribution, and go with draws of the posterior at random.
    """
    rng, n = stream(seed, "scales of Student errors"), len(df)
    u = (rng.permutation(n) + rng.random(n)) / n
    with np.errstate(divide="ignore"):
        scale: FloatArray = np.sqrt(0.5 * df / special.gammaincinv(0.5 * df, u))
    return np.minimum(scale, _WIDEST)


def widest_count(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the count of a body in contact over its whole width, of textures of any shape.

    Under Student errors no further count has a probability: their tails leave some to any.
    """
    return np.asarray(2 + 2 * np.floor(np.maximum(1 - b / 2, 0) / (a + b)))


def distinct(*columns: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the flat index of each distinct row of some columns, and the row of each place."""
    frame = pd.DataFrame({i: column.ravel() for i, column in enumerate(columns)})
    place = frame.groupby(list(frame)).ngroup().to_numpy().astype(np.int64)
    return np.unique(place, return_index=True)[1].astype(np.int64), place
