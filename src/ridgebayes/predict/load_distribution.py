"""`LoadDistribution`: the distribution of the load that reaches a count."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from itertools import compress
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes import drawing
from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.model.forms.arguments import common_shape, numbers
from ridgebayes.predict.extrapolation import LOAD, Flags, names_of
from ridgebayes.predict.load_draws import LoadDraws
from ridgebayes.predict.predicted import Predicted
from ridgebayes.predict.q_distribution import heavy_parts, shares

if TYPE_CHECKING:  # heavy
    from matplotlib.axes import Axes

# Draws times columns worked on together, which bounds memory; but at least so many columns.
_AT_ONCE, _LEAST_COLUMNS = 65_536, 16


class LoadDistribution(Predicted):
    """Distributions of loads p/E, with the names of scipy.stats.

    Each is a mixture over posterior draws of loads whose logarithms are normal, Student, or points.

    Parameters
    ----------
    log_mean : ndarray of float, shape (n_draw, ...)
        Centre of log(p/E) given each draw.
    sd : ndarray of float, shape (n_draw,) or (n_draw, ...)
        Scale of log(p/E) given each draw; 0 for a point.
    weight : ndarray of float, shape (n_draw,)
        Weights, sum 1.
    flags : ndarray of uint8, shape (...)
        Which of texture and count lie outside what was calibrated, see `predict.extrapolation`.
    df : ndarray of float, shape (n_draw,), optional
        Degrees of freedom of each draw's Student errors, infinite for normal ones; all are normal
        if not given.

    Notes
    -----
    *Validity.* Where `extrapolation` says so, texture, count or load lie beyond what was
    calibrated; `extrapolation_of` says which.
    *Cost.* Distributions of `predict_load` make their draws when they are asked, a block of places
    at a time: a million places take some 100 MB.

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
    >>> load.log_mean.shape == load.sd.shape == (len(load.weight), 2), load.df is None
    (True, True)
    >>> load.to_dataframe()["Q"].tolist()
    [6, 8]
    """

    _margin = 1e-12

    def __init__(
        self,
        log_mean: FloatArray,
        sd: FloatArray,
        weight: FloatArray,
        flags: Flags,
        df: FloatArray | None = None,
    ) -> None:
        shape = log_mean.shape[1:]
        if sd.ndim < log_mean.ndim:
            sd = np.broadcast_to(sd.reshape((-1,) + (1,) * len(shape)), log_mean.shape)
        n = len(log_mean)
        self._draws = LoadDraws.stored(log_mean.reshape(n, -1), sd.reshape(n, -1), weight, df)
        self._place = np.arange(log_mean[0].size).reshape(shape)
        self._flags = np.broadcast_to(np.asarray(flags, dtype=np.uint8), shape)
        self._highest = np.full(shape, np.inf)
        self._places: Mapping[str, np.ndarray] = {}

    @classmethod
    def of(
        cls,
        draws: LoadDraws,
        place: IntArray,
        flags: Flags,
        highest: FloatArray,
        where: Mapping[str, np.ndarray] | None = None,
    ) -> "LoadDistribution":
        """Make a distribution of draws that need not be there yet.

        Parameters
        ----------
        draws : LoadDraws
            Draws.
        place : ndarray of int, shape (...)
            Column of each place; places alike share theirs.
        flags : ndarray of uint8, shape (...)
            As above.
        highest : ndarray of float, shape (...), dimensionless
            Load p/E above which a median is an extrapolation.
        where : mapping of str to ndarray, shape (...), optional
            Columns of tables, for each place: kind_of_band, a_over_R, b_over_R, nu, Q.

        Returns
        -------
        LoadDistribution
            Distribution with the shape of `place`.
        """
        self = cls.__new__(cls)
        self._draws, self._place, self._flags, self._highest = draws, place, flags, highest
        self._places = where or {}
        return self

    def __repr__(self) -> str:
        return f"LoadDistribution(shape {self.shape}, {len(self.weight)} draws)"

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of textures and counts."""
        return self._place.shape

    @property
    def weight(self) -> FloatArray:
        """Weights of the draws, shape (n_draw,), sum 1."""
        return self._draws.weight

    @property
    def df(self) -> FloatArray | None:
        """Degrees of freedom of the draws' errors, shape (n_draw,); None where all are normal."""
        return self._draws.df

    @property
    def log_mean(self) -> FloatArray:
        """Centre of log(p/E) given each draw, shape (n_draw, ...), all of it in memory."""
        return self._all_columns[0]

    @property
    def sd(self) -> FloatArray:
        """Scale of log(p/E) given each draw, shape (n_draw, ...), all of it in memory."""
        return self._all_columns[1]

    @property
    def extrapolation(self) -> BoolArray:
        """Whether texture, count or median load are extrapolated, shape (...)."""
        value: BoolArray = self._all_flags != 0
        return value

    @property
    def extrapolation_of(self) -> np.ndarray:
        """Names of what was not, of Q, load, a/pitch, a/R, b/R, texture, shape (...).

        Separated by commas; empty text where all was.
        """
        return names_of(self._all_flags)

    def cdf(self, p_over_E: ArrayLike) -> FloatArray:
        """Return P(load <= p_over_E); no load is at or below 0.

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
        return self._at_loads(self._draws.cdf, p_over_E)

    def sf(self, p_over_E: ArrayLike) -> FloatArray:
        """Return P(load > p_over_E), to rounding where it is small.

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
        return self._at_loads(self._draws.sf, p_over_E)

    def pdf(self, p_over_E: ArrayLike) -> FloatArray:
        """Return the density of loads.

        Parameters
        ----------
        p_over_E : array_like of float, broadcastable, dimensionless
            Loads.

        Returns
        -------
        ndarray of float, broadcast shape, dimensionless
            Density over p/E; points, such as draws of the kind ``curve``, have none.

        Raises
        ------
        InputError
            As `cdf`.
        """
        p = numbers("p_over_E", p_over_E)
        density = self._at_loads(self._draws.density, p)
        return np.where(p > 0, density / np.where(p > 0, p, 1.0), 0.0)[()]

    def mean(self) -> FloatArray:
        """Return the mean load p/E, shape (...); infinite under Student errors, whose tails are."""
        return self._by_column(lambda mean, sd: self._draws.moments(mean, sd)[0])

    def std(self) -> FloatArray:
        """Return the standard deviation of the load, shape (...); infinite where the mean is."""
        return self._by_column(lambda mean, sd: self._draws.moments(mean, sd)[1])

    def _quantile(self, prob: FloatArray) -> FloatArray:
        shape = np.broadcast_shapes(prob.shape, self.shape)
        prob, places = np.broadcast_to(prob, shape), np.broadcast_to(self._numbers, shape)
        found = np.empty(shape)
        for one in np.unique(prob).tolist():
            here = prob == one
            some = self if here.all() and shape == self.shape else self._some(places[here])
            quantiles = some._by_column(partial(self._draws.quantile, one))
            found[here] = np.ravel(quantiles)
        return found[()]

    def median(self) -> FloatArray:
        """Return the median load p/E, shape (...)."""
        return self._median

    def _draw(self, generator: np.random.Generator, n: int) -> FloatArray:
        """Return draws; all places of one have one draw of the posterior."""
        pick = generator.choice(len(self.weight), size=n, p=self.weight)
        value = generator.standard_normal((n, *self.shape)).reshape(n, -1)
        if self.df is not None:
            df = self.df[pick]
            finite = np.where(np.isfinite(df), df, 1.0)
            wide = np.sqrt(finite / generator.chisquare(finite))
            value *= np.where(np.isfinite(df), wide, 1.0)[:, None]
        for here, mean, sd in self._blocks(self._place.ravel()):
            value[:, here] = np.exp(mean[pick] + sd[pick] * value[:, here])
        return value

    def widened(self, rel_se: FloatArray) -> "LoadDistribution":
        """Return the distribution of loads as they would be observed.

        Parameters
        ----------
        rel_se : ndarray of float, shape (...), dimensionless
            Known relative standard error of each load, in quadrature beside the draws' scale.

        Returns
        -------
        LoadDistribution
            Widened distribution of the same shape.
        """
        draws = self._draws.placed(self._place.ravel()).widened(np.ravel(rel_se))
        return self.of(draws, self._numbers, self._flags, self._highest, self._places)

    @property
    def _where(self) -> Mapping[str, np.ndarray]:
        return self._places

    def _columns(self, prob: float) -> dict[str, np.ndarray]:
        lower, upper = self.interval(prob)
        name = "load" if "load_unit" in self._places else "p_over_E"  # of a scene: in its unit
        return {
            f"{name}_median": self.median(),
            f"{name}_lower": lower,
            f"{name}_upper": upper,
            "prob": np.asarray(prob),
            "extrapolation": self.extrapolation,
            "extrapolation_of": self.extrapolation_of,
        }

    def _some(self, which: IntArray) -> "LoadDistribution":
        flags = np.broadcast_to(self._flags, self.shape).ravel()[which]
        place, highest = self._place.ravel()[which], self._highest.ravel()[which]
        return self.of(self._draws, place, flags, highest, self._flat_places(which))

    def _drawn(self, ax: "Axes | None") -> "Axes":
        if not self.shape or "Q" not in self._places:
            first = self._some(self._numbers.ravel()[:1])
            ends = first.quantile(1e-3), first.quantile(0.999)
            p = np.linspace(float(ends[0][0]), float(ends[1][0]), 200)
            unit = next(map(str, np.ravel(self._places.get("load_unit", ()))), None)
            return drawing.records.draw_distribution(p, first.cdf(p), ax, unit)
        return drawing.records.draw_loads(self.to_dataframe(), ax)

    @cached_property
    def _median(self) -> FloatArray:
        return self.quantile(0.5)

    @cached_property
    def _all_flags(self) -> Flags:
        if np.all(self._highest == np.inf):
            return self._flags
        return self._flags | np.where(self._median > self._highest, LOAD, 0).astype(np.uint8)

    @property
    def _all_columns(self) -> tuple[FloatArray, FloatArray]:
        mean, sd = self._draws.columns(self._place.ravel())
        shape = (len(self.weight), *self.shape)
        return mean.reshape(shape), np.broadcast_to(sd, mean.shape).reshape(shape)

    def _blocks(self, columns: IntArray) -> Iterator[tuple[slice, FloatArray, FloatArray]]:
        """Yield some columns after others: where they stand, centre and scale (n_draw, n)."""
        step = max(_AT_ONCE // len(self.weight), _LEAST_COLUMNS)
        for first in range(0, len(columns), step):
            here = slice(first, first + step)
            ids, place = np.unique(columns[here], return_inverse=True)
            mean, sd = self._draws.columns(ids)
            if len(ids) < len(place):
                mean, sd = mean[:, place], sd[:, place]
            yield here, mean, sd

    def _by_column(self, function: Callable[[FloatArray, FloatArray], FloatArray]) -> FloatArray:
        """Return a function's value at each place; it is worked out once for places alike."""
        columns, place = np.unique(self._place, return_inverse=True)
        value = np.empty(len(columns))
        for here, mean, sd in self._blocks(columns):
            value[here] = function(mean, sd)
        return value[place].reshape(self.shape)[()]  # a scalar of a single place

    def _at_loads(
        self, function: Callable[[FloatArray, FloatArray, FloatArray], FloatArray], load: ArrayLike
    ) -> FloatArray:
        """Return a function of log loads, and of centres and scales, at loads of each place."""
        p = numbers("p_over_E", load)
        if np.any(np.isnan(p)):
            raise InputError(f"p_over_E: expected numbers, got {load!r}")
        shape = common_shape(p_over_E=p, distribution=self._place)
        with np.errstate(divide="ignore"):
            y = np.broadcast_to(np.log(np.maximum(p, 0)), shape).ravel()
        found = np.empty(len(y))
        for here, mean, sd in self._blocks(np.broadcast_to(self._place, shape).ravel()):
            found[here] = function(y[here], mean, sd)
        return found.reshape(shape)[()]


def mix_loads(parts: Iterable[LoadDistribution], weights: Sequence[float]) -> LoadDistribution:
    """Return the average of load distributions, such as over forms by model probability.

    Parameters
    ----------
    parts : iterable of LoadDistribution
        Distributions of one shape.
    weights : sequence of float
        Non-negative; normalised here. Parts under 1e-9 are left out.

    Returns
    -------
    LoadDistribution
        Flagged as extrapolation wherever a part with weight above 1 % is, and where the median of
        the average lies above a load that such a part was calibrated to.

    Raises
    ------
    InputError
        If a weight is negative or not finite, or none is above 0.
    """
    share = shares(weights)
    pairs = [(part, w) for part, w in zip(parts, share.tolist(), strict=True) if w > 1e-9]
    kept = [part for part, _ in pairs]
    place, draws = kept[0]._place, [part._draws for part in kept]
    if not all(np.array_equal(part._place, place) for part in kept):
        place, draws = kept[0]._numbers, [part._draws.placed(part._place.ravel()) for part in kept]
    joined = LoadDraws.joined(zip(draws, (w for _, w in pairs), strict=True))
    heavy = list(compress(kept, heavy_parts(share[share > 1e-9])))
    flags = np.bitwise_or.reduce([part._flags for part in heavy])
    highest = np.minimum.reduce([part._highest for part in heavy])
    return LoadDistribution.of(joined, place, flags, highest, kept[0]._places)
