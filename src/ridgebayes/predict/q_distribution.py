"""Distribution of the even count Q at each of many textures and loads."""

import math
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes import drawing
from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.model.forms.arguments import common_shape, numbers
from ridgebayes.predict.extrapolation import MIN_SHARE, Flags, Q, names_of
from ridgebayes.predict.predicted import Predicted, keep_labels

if TYPE_CHECKING:  # heavy
    import xarray as xr
    from matplotlib.axes import Axes


class CountProbabilities(np.ndarray[Any, np.dtype[np.float64]]):
    """Array of a probability for each count; calling it with counts returns their probabilities."""

    _at: Callable[[ArrayLike], FloatArray]

    @classmethod
    def of(cls, values: FloatArray, at: Callable[[ArrayLike], FloatArray]) -> "CountProbabilities":
        """Return an array of the values of all counts that can be called."""
        self = values.view(cls)
        self._at = at
        return self

    def __call__(self, k: ArrayLike) -> FloatArray:
        return self._at(k)

    def __array_wrap__(self, array: np.ndarray, *_: Any) -> Any:
        return np.asarray(array)[()]  # results computed from it are plain arrays


@dataclass(frozen=True, eq=False, repr=False)
class QDistribution(Predicted):
    """Distributions of Q on 2, 4, 6, ..., with the names of scipy.stats.

    Parameters
    ----------
    survival : ndarray of float, shape (..., n_step), dimensionless
        P(Q >= 2), P(Q >= 4), ...; the first is 1, and the values never increase.
    flags : ndarray of uint8, shape (...)
        Texture and load quantities outside the calibrated range, see `predict.extrapolation`.
    q_calibrated_max : int
        Largest calibrated count.
    kind : str
        ``simulation`` or ``curve``.
    places : mapping of str to ndarray, shape (...), optional
        a_over_R, b_over_R, nu and p_over_E of each distribution.
    labels : xarray.DataArray, shape (...), optional
        Dimensions and coordinates of the methods' results; its values are not used.

    Notes
    -----
    *Validity.* `extrapolation` is True where texture, load or count are beyond the calibrated
    range; `extrapolation_of` names them. The probability of counts above the last of `q` is below
    1e-6 and set to 0.

    Examples
    --------
    >>> q = QDistribution(np.array([1.0, 0.75, 0.25]), np.array(False), 10, "simulation")
    >>> q.pmf.tolist(), float(q.pmf(4)), float(q.sf(4)), float(q.mean()), int(q.median())
    ([0.25, 0.5, 0.25], 0.5, 0.25, 4.0, 4)
    >>> q.q.tolist(), q.cdf.tolist(), float(q.at_least(4)), round(float(q.std()), 3)
    ([2, 4, 6], [0.25, 0.75, 1.0], 0.75, 1.414)
    >>> [int(end) for end in q.interval(0.5)], int(q.ppf(0.9)), int(q.quantile(0.9))
    ([2, 4], 6, 6)
    >>> q.shape, q.rvs(5, random_state=1).shape, q.plot().get_xlabel()
    ((), (5,), 'edges in contact $Q$')

    A fit predicts a distribution for each texture and load and flags extrapolation:

    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> q = fit.predict(a_over_R=0.022, b_over_R=[0.02, 0.09], p_over_E=0.009)
    >>> q.extrapolation().tolist(), q.extrapolation_of().tolist()
    ([False, True], ['', 'a/pitch,b/R'])
    >>> q.to_dataframe()[["b_over_R", "q_median"]].to_numpy().tolist()
    [[0.02, 8.0], [0.09, 4.0]]
    """

    survival: FloatArray
    flags: Flags
    q_calibrated_max: int
    kind: str
    places: Mapping[str, np.ndarray] = field(default_factory=dict)
    labels: "xr.DataArray | None" = None

    def __repr__(self) -> str:
        return f"QDistribution({self.kind}, shape {self.shape}, Q <= {self.q[-1]})"

    @property
    def shape(self) -> tuple[int, ...]:
        """Broadcast shape of the textures and loads."""
        return self.survival.shape[:-1]

    @property
    def q(self) -> IntArray:
        """The counts 2, 4, ..., shape (n_step,)."""
        return 2 + 2 * np.arange(self.survival.shape[-1])

    @property
    def pmf(self) -> CountProbabilities:
        """P(Q = q) for each of `q`, shape (..., n_step); ``pmf(k)`` is P(Q = k)."""
        values = self.survival - self._above
        return CountProbabilities.of(values, lambda k: self._at(k, operator.eq, values))

    @property
    def cdf(self) -> CountProbabilities:
        """P(Q <= q) for each of `q`, shape (..., n_step); ``cdf(k)`` is P(Q <= k)."""
        return CountProbabilities.of(1 - self._above, lambda k: 1 - self._sf(k))

    @property
    def sf(self) -> CountProbabilities:
        """P(Q > q) for each of `q`, shape (..., n_step); ``sf(k)`` is P(Q > k)."""
        return CountProbabilities.of(self._above, self._sf)

    @property
    def _above(self) -> FloatArray:
        return np.concatenate([self.survival[..., 1:], np.zeros_like(self.survival[..., :1])], -1)

    def _sf(self, k: ArrayLike) -> FloatArray:
        return self._at(k, operator.gt, self.survival)

    @keep_labels
    def _at(
        self, k: ArrayLike, is_in: Callable[..., Any], values: FloatArray, name: str = "k"
    ) -> FloatArray:
        """Return the largest value of the counts that compare with k, or 0."""
        count = numbers(name, k)
        if np.any(np.isnan(count)):
            raise InputError(f"{name}: expected a number, got nan")
        common_shape(**{name: count}, distribution=self._place_ids)
        chosen = np.where(is_in(self.q, count[..., None]), values, 0.0)
        return np.asarray(chosen.max(axis=-1))[()]

    def at_least(self, n: ArrayLike) -> FloatArray:
        """Return P(Q >= n).

        Parameters
        ----------
        n : array_like of float, broadcastable, dimensionless
            Counts.

        Returns
        -------
        ndarray of float, broadcast shape, dimensionless
            Probabilities.

        Raises
        ------
        InputError
            If a count is NaN, or the shapes do not broadcast.
        """
        return self._at(n, operator.ge, self.survival, "n")

    @keep_labels
    def mean(self) -> FloatArray:
        """Return the mean of Q, shape (...)."""
        value: FloatArray = 2 * self.survival.sum(axis=-1)
        return value

    @keep_labels
    def std(self) -> FloatArray:
        """Return the standard deviation of Q, shape (...)."""
        squared = (self.q - np.asarray(self.mean())[..., None]) ** 2
        value: FloatArray = np.sqrt((np.asarray(self.pmf) * squared).sum(axis=-1))
        return value

    def _quantile(self, prob: FloatArray) -> IntArray:
        # Rounding of the sums must not move the quantile to the next count.
        reached = np.asarray(self.cdf) >= prob[..., None] * (1 - 1e-12)
        value: IntArray = self.q[np.argmax(reached, axis=-1)]
        return value

    @keep_labels
    def extrapolation(self, prob: float = 0.9) -> BoolArray:
        """Return whether texture, load or the upper end of the interval are extrapolated.

        Parameters
        ----------
        prob : float, dimensionless
            Probability of the interval.

        Returns
        -------
        ndarray of bool, shape (...)
            True if a quantity is outside the calibrated range.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1.
        """
        value: BoolArray = self._all_flags(prob) != 0
        return value

    @keep_labels
    def extrapolation_of(self, prob: float = 0.9) -> np.ndarray:
        """Return the names of the extrapolated quantities, separated by commas.

        Parameters
        ----------
        prob : float, dimensionless
            Probability of the interval.

        Returns
        -------
        ndarray of str, shape (...)
            Names among Q, load, a/pitch, a/R, b/R, texture and offset; an empty text if nothing is
            extrapolated.

        Raises
        ------
        InputError
            If `prob` is outside 0 to 1.
        """
        return names_of(self._all_flags(prob))

    def _all_flags(self, prob: float) -> Flags:
        beyond = self.interval(prob)[1] > self.q_calibrated_max
        return self.flags | np.where(beyond, Q, 0).astype(np.uint8)

    def _draw(self, generator: np.random.Generator, n: int) -> IntArray:
        number, draws = generator.random((n, *self.shape)), np.zeros((n, *self.shape), np.int64)
        for step in np.moveaxis(self.survival, -1, 0):
            draws += 2 * (number < step)
        return draws

    def _columns(self, prob: float) -> dict[str, np.ndarray]:
        (lower, upper), beyond = self.interval(prob), self.extrapolation_of(prob)
        return {
            "kind_of_band": np.asarray(self.kind),
            **self.places,
            "q_mean": self.mean(),
            "q_median": self.median(),
            "q_lower": lower,
            "q_upper": upper,
            "prob": np.asarray(prob),
            "extrapolation": beyond != "",
            "extrapolation_of": beyond,
        } | {f"p_q_ge_{n}": self.survival[..., i] for i, n in enumerate(self.q) if i}

    def _first(self, n: int) -> "QDistribution":
        survival = self.survival.reshape(-1, self.survival.shape[-1])[:n]
        flags, places = self._heads({"flags": self.flags}, n), self._heads(self.places, n)
        return replace(self, survival=survival, places=places, labels=None, **flags)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Plot 90 % intervals against load for each texture, or the probabilities of one place.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; those of a new figure if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        if not self.shape or "p_over_E" not in self.places:
            first = self._first(1)
            return drawing.records.draw_probabilities(first.q, np.asarray(first.pmf)[0], ax)
        return drawing.records.draw_bands(self.to_dataframe(), ax)


def mix_q(parts: Iterable[QDistribution], weights: Sequence[float]) -> QDistribution:
    """Return the average of distributions of Q, such as over forms by model probability.

    Parameters
    ----------
    parts : iterable of QDistribution
        Distributions of one shape and kind. They are read one at a time, so a generator saves
        memory.
    weights : sequence of float
        Weights >= 0; they are normalised.

    Returns
    -------
    QDistribution
        Average. It is flagged as extrapolation wherever a part with weight above 1 % is.

    Raises
    ------
    InputError
        If a weight is negative or not finite, or none is above 0.
    """
    share = shares(weights)
    survival, flags, q_max = np.zeros(1), np.zeros((), dtype=np.uint8), np.iinfo(np.int64).max
    for part, weight, is_heavy in zip(parts, share.tolist(), heavy_parts(share), strict=True):
        # Add the shorter array to the longer in place, which saves memory.
        new = sorted((weight * part.survival, survival), key=lambda x: -x.shape[-1])
        survival = new[0]
        survival[..., : new[1].shape[-1]] += new[1]
        if is_heavy:
            flags, q_max = flags | part.flags, min(q_max, part.q_calibrated_max)
    return replace(part, survival=survival, flags=flags, q_calibrated_max=int(q_max))


def stacked(parts: Sequence[QDistribution]) -> QDistribution:
    """Stack distributions of one shape along a new first axis."""
    n_step = max(part.survival.shape[-1] for part in parts)
    survival = np.zeros((len(parts), *parts[0].shape, n_step))
    for row, part in zip(survival, parts, strict=True):
        row[..., : part.survival.shape[-1]] = part.survival
    flags = np.stack([part.flags for part in parts])
    places = [{k: np.broadcast_to(x, part.shape) for k, x in part.places.items()} for part in parts]
    stacks = {name: np.stack([place[name] for place in places]) for name in places[0]}
    return replace(parts[0], survival=survival, flags=flags, places=stacks)


def shares(weights: Sequence[float]) -> FloatArray:
    """Normalise weights to sum 1; raise InputError if they are negative, not finite or all 0."""
    values = np.asarray(weights, dtype=float)
    if not (np.all(values >= 0) and 0 < values.sum() < math.inf):
        raise InputError(f"weights: expected finite numbers >= 0, not all 0, got {weights!r}")
    return np.asarray(values / values.sum())


def heavy_parts(share: FloatArray) -> BoolArray:
    """Return which parts of a mixture are heavy enough to flag the mixture as extrapolated."""
    return np.asarray((share > MIN_SHARE) | (share == share.max()))
