"""Distribution of the load that reaches a count."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ridgebayes import drawing
from ridgebayes._types import BATCH_SIZE, BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.model.forms.arguments import common_shape, numbers
from ridgebayes.predict import load_draws
from ridgebayes.predict.extrapolation import LOAD, Flags, names_of
from ridgebayes.predict.load_draws import Columns
from ridgebayes.predict.predicted import Predicted, keep_labels
from ridgebayes.predict.q_distribution import heavy_parts, shares

if TYPE_CHECKING:  # heavy
    import xarray as xr
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class LoadDistribution(Predicted):
    """Distributions of loads p/E, with the names of scipy.stats.

    Each distribution is a mixture over posterior draws; given a draw, the log load is normal or a
    point.

    Parameters
    ----------
    weight : ndarray of float, shape (n_draw,)
        Weights of the draws, with sum 1.
    columns : callable
        Function of column numbers, shape (n,), that returns mean and standard deviation of
        log(p/E) given each draw, both (n_draw, n). A standard deviation of 0 is a point.
    place : ndarray of int, shape (...)
        Column of each place; equal places share a column.
    flags : ndarray of uint8, shape (...)
        Texture and count quantities outside the calibrated range, see `predict.extrapolation`.
    highest : ndarray of float, shape (...), dimensionless
        Load p/E above which a median is flagged as extrapolation.
    places : mapping of str to ndarray, shape (...), optional
        Table columns for each place: kind_of_band, a_over_R, b_over_R, nu, Q.
    has_mean : bool, optional
        Whether the mean load is finite; under Student errors it is not.
    labels : xarray.DataArray, shape (...), optional
        Dimensions and coordinates of the methods' results; its values are not used.

    Notes
    -----
    *Validity.* `extrapolation` is True where texture, count or load are beyond the calibrated
    range; `extrapolation_of` names them.
    *Cost.* `predict_load` returns distributions that compute their draws when a method needs them,
    one block of places at a time. A million places take up to 170 MB.
    *Accuracy.* Under Student errors each draw has a normal error with a randomly drawn scale.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> load = fit.predict_load(0.015, 0.045, Q=[6, 8])
    >>> load.median().round(4).tolist()  # p/E
    [0.0072, 0.0163]
    >>> load.shape, load.extrapolation.tolist(), load.extrapolation_of.tolist()
    ((2,), [True, True], ['a/pitch', 'a/pitch'])
    >>> low, high = load.interval(0.9)
    >>> (load.cdf(high) - load.cdf(low)).round(9).tolist(), load.sf(high).round(9).tolist()
    ([0.9, 0.9], [0.05, 0.05])
    >>> bool((load.ppf(0.95) == load.quantile(0.95)).all()), load.rvs(5, random_state=1).shape
    (True, (5, 2))
    >>> (load.std() / load.mean()).round(2).tolist(), bool((load.pdf(low) > load.pdf(high)).all())
    ([0.03, 0.03], True)
    >>> wide = load.widened(np.array([0.1, 0.1]))  # as seen by an instrument of 10 % error
    >>> (wide.std() / wide.mean()).round(2).tolist(), wide.plot().get_xlabel()
    ([0.1, 0.1], 'edges in contact $Q$')
    >>> load.log_mean.shape == load.sd.shape == (len(load.weight), 2)
    True
    >>> load.to_dataframe()["Q"].tolist()
    [6, 8]
    """

    weight: FloatArray
    columns: Callable[[IntArray], Columns]
    place: IntArray
    flags: Flags
    highest: FloatArray
    places: Mapping[str, np.ndarray] = field(default_factory=dict)
    has_mean: bool = True
    labels: "xr.DataArray | None" = None

    _MIN_TAIL = 1e-12

    def __repr__(self) -> str:
        return f"LoadDistribution(shape {self.shape}, {len(self.weight)} draws)"

    @property
    def shape(self) -> tuple[int, ...]:
        """Broadcast shape of the textures and counts."""
        return self.place.shape

    @property
    def log_mean(self) -> FloatArray:
        """Mean of log(p/E) given each draw, shape (n_draw, ...); all places are held in memory."""
        return self._all_draws(0)

    @property
    def sd(self) -> FloatArray:
        """Standard deviation of log(p/E) given each draw, shape (n_draw, ...), as `log_mean`."""
        return self._all_draws(1)

    @property
    @keep_labels
    def extrapolation(self) -> BoolArray:
        """Whether texture, count or median load are extrapolated, shape (...)."""
        value: BoolArray = self._all_flags != 0
        return value

    @property
    @keep_labels
    def extrapolation_of(self) -> np.ndarray:
        """Names of the extrapolated quantities, separated by commas, shape (...).

        The names are Q, load, a/pitch, a/R, b/R, texture and offset; the text is empty if nothing
        is extrapolated.
        """
        return names_of(self._all_flags)

    @keep_labels
    def cdf(self, p_over_E: ArrayLike) -> FloatArray:
        """Return P(load <= p_over_E), which is 0 for loads <= 0.

        Parameters
        ----------
        p_over_E : array_like of float, broadcastable, dimensionless
            Loads.

        Returns
        -------
        ndarray of float, broadcast shape, dimensionless
            Probabilities.

        Raises
        ------
        InputError
            If a load is NaN, or the shapes do not broadcast.
        """
        return self._at_loads(p_over_E, load_draws.cdf)

    @keep_labels
    def sf(self, p_over_E: ArrayLike) -> FloatArray:
        """Return P(load > p_over_E), accurate also where it is small.

        Parameters
        ----------
        p_over_E : array_like of float, broadcastable, dimensionless
            Loads.

        Returns
        -------
        ndarray of float, broadcast shape, dimensionless
            Probabilities.

        Raises
        ------
        InputError
            As `cdf`.
        """
        return self._at_loads(p_over_E, load_draws.sf)

    @keep_labels
    def pdf(self, p_over_E: ArrayLike) -> FloatArray:
        """Return the probability density of the load.

        Parameters
        ----------
        p_over_E : array_like of float, broadcastable, dimensionless
            Loads.

        Returns
        -------
        ndarray of float, broadcast shape, dimensionless
            Density over p/E. Points, such as draws of the kind ``curve``, contribute 0.

        Raises
        ------
        InputError
            As `cdf`.
        """
        p = numbers("p_over_E", p_over_E)
        density = self._at_loads(p, load_draws.density)
        return np.where(p > 0, density / np.where(p > 0, p, 1.0), 0.0)[()]

    @keep_labels
    def mean(self) -> FloatArray:
        """Return the mean load p/E, shape (...); infinite under Student errors."""
        return self._moment(0)

    @keep_labels
    def std(self) -> FloatArray:
        """Return the standard deviation of the load, shape (...); infinite if the mean is."""
        return self._moment(1)

    def _moment(self, which: int) -> FloatArray:
        """Return the mean (0) or standard deviation (1) of the loads."""
        if not self.has_mean:
            return np.full(self.shape, np.inf)[()]
        return self._at(
            np.zeros(()), lambda _, mean, sd: load_draws.moments(mean, sd, self.weight)[which]
        )

    def _quantile(self, prob: FloatArray) -> FloatArray:
        return self._at(prob, partial(load_draws.quantile, weight=self.weight))

    @keep_labels
    def median(self) -> FloatArray:
        """Return the median load p/E, shape (...)."""
        return self._median

    def _draw(self, generator: np.random.Generator, n: int) -> FloatArray:
        """Return draws, shape (n, ...); all places of a draw use the same posterior draw."""
        pick = generator.choice(len(self.weight), size=n, p=self.weight)
        value = generator.standard_normal((n, *self.shape)).reshape(n, -1)
        with np.errstate(over="ignore"):
            for here, mean, sd in self._blocks(self.place.ravel()):
                value[:, here] = np.exp(mean[pick] + sd[pick] * value[:, here])
        return value

    def widened(self, rel_se: FloatArray) -> "LoadDistribution":
        """Return the distribution of observed loads, with measurement error.

        Parameters
        ----------
        rel_se : ndarray of float, shape (...), dimensionless
            Known relative standard error of each load, added in quadrature.

        Returns
        -------
        LoadDistribution
            Widened distribution of the same shape.
        """
        columns = partial(_widened, self.columns, self.place.ravel(), np.ravel(rel_se))
        return replace(self, columns=columns, place=self._place_ids)

    def _columns(self, prob: float) -> dict[str, np.ndarray]:
        lower, upper = self.interval(prob)
        name = "load" if "load_unit" in self.places else "p_over_E"  # a scene's load is in its unit
        return {
            **self.places,
            f"{name}_median": self.median(),
            f"{name}_lower": lower,
            f"{name}_upper": upper,
            "prob": np.asarray(prob),
            "extrapolation": self.extrapolation,
            "extrapolation_of": self.extrapolation_of,
        }

    def _first(self, n: int) -> "LoadDistribution":
        arrays = {name: getattr(self, name) for name in ("place", "flags", "highest")}
        return replace(
            self, places=self._heads(self.places, n), labels=None, **self._heads(arrays, n)
        )

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Plot 90 % intervals against count for each texture, or the cdf of one place.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; those of a new figure if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        if not self.shape or "Q" not in self.places:
            first = self._first(1)
            low, high = (float(first.quantile(prob)[0]) for prob in (1e-3, 0.999))
            p = np.linspace(low, high, 200)
            unit = next(map(str, np.ravel(self.places.get("load_unit", ()))), None)
            return drawing.records.draw_distribution(p, first.cdf(p), ax, unit)
        return drawing.records.draw_loads(self.to_dataframe(), ax)

    @cached_property
    def _median(self) -> FloatArray:
        return self.quantile(0.5)

    @cached_property
    def _all_flags(self) -> Flags:
        if np.all(self.highest == np.inf):
            return self.flags
        return self.flags | np.where(self._median > self.highest, LOAD, 0).astype(np.uint8)

    def _all_draws(self, which: int) -> FloatArray:
        """Return location (0) or standard deviation (1) of all draws, shape (n_draw, ...)."""
        value = np.array(self.columns(self.place.ravel())[which])
        return value.reshape(len(self.weight), *self.shape)

    def _blocks(self, columns: IntArray) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
        """Yield blocks of columns: their positions, and mean and sd, both (n_draw, n)."""
        order = np.argsort(columns, kind="stable")  # equal columns share a block
        step = max(BATCH_SIZE // len(self.weight), 1)
        for first in range(0, len(columns), step):
            here = order[first : first + step]
            ids, place = np.unique(columns[here], return_inverse=True)
            mean, sd = self.columns(ids)
            yield here, mean[:, place], sd[:, place]

    def _at(self, x: FloatArray, function: Callable[..., FloatArray]) -> FloatArray:
        """Return a function of x, means and sds at each place, computed once for equal ones."""
        shape = common_shape(x=x, distribution=self.place)
        arrays = {"column": np.broadcast_to(self.place, shape), "x": np.broadcast_to(x, shape)}
        pairs = pd.DataFrame({name: values.ravel() for name, values in arrays.items()})
        distinct, row = pairs.drop_duplicates(), pairs.groupby([*pairs], sort=False).ngroup()
        value = np.empty(len(distinct))
        for here, mean, sd in self._blocks(distinct["column"].to_numpy()):
            value[here] = function(distinct["x"].to_numpy()[here], mean, sd)
        return value[row].reshape(shape)[()]  # a scalar for a single place

    def _at_loads(self, load: ArrayLike, function: Callable[..., FloatArray]) -> FloatArray:
        """Return the average over draws of a function of log loads, means and sds."""
        p = numbers("p_over_E", load)
        if np.any(np.isnan(p)):
            raise InputError(f"p_over_E: expected numbers, got {load!r}")
        common_shape(p_over_E=p, distribution=self.place)
        with np.errstate(divide="ignore"):
            y = np.log(np.maximum(p, 0))
        return self._at(y, lambda *x: load_draws.average(function(*x), self.weight))


def mix_loads(parts: Iterable[LoadDistribution], weights: Sequence[float]) -> LoadDistribution:
    """Return the average of load distributions, such as over forms by model probability.

    Parameters
    ----------
    parts : iterable of LoadDistribution
        Distributions of one shape.
    weights : sequence of float
        Weights >= 0; they are normalised. Parts of a weight below 1e-9 are left out.

    Returns
    -------
    LoadDistribution
        Average. It is flagged as extrapolation wherever a part with weight above 1 % is, or the
        median of the average is above the highest calibrated load of such a part.

    Raises
    ------
    InputError
        If a weight is negative or not finite, or none is above 0.
    """
    share = shares(weights)
    pairs = [(part, w) for part, w in zip(parts, share.tolist(), strict=True) if w > 1e-9]
    kept = [part for part, _ in pairs]
    heavy = list(compress(kept, heavy_parts(share[share > 1e-9])))
    return replace(
        kept[0],
        weight=np.concatenate([w * part.weight for part, w in pairs]),
        columns=partial(_joined, [part.columns for part in kept]),
        flags=np.bitwise_or.reduce([part.flags for part in heavy]),
        highest=np.minimum.reduce([part.highest for part in heavy]),
        has_mean=all(part.has_mean for part in kept),
    )


def _joined(parts: Sequence[Callable[[IntArray], Columns]], ids: IntArray) -> Columns:
    """Return the concatenated draws of several sets."""
    means, sds = zip(*(columns(ids) for columns in parts), strict=True)
    return np.concatenate(means), np.concatenate(sds)


def _widened(
    columns: Callable[[IntArray], Columns], place: IntArray, rel_se: FloatArray, ids: IntArray
) -> Columns:
    mean, sd = columns(place[ids])
    return mean, np.hypot(sd, rel_se[ids])
