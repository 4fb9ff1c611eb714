"""Posterior predictions: the distribution of Q at a load, and of the load that reaches a Q.

Probabilities are averages of conditional probabilities over the posterior's draws: P(Q >= n) is the
mean over draws of P(load(n) <= p | draw), which is a distribution function under the error model
(kind ``simulation``: what a further simulation or measurement would show) and a step for the form's
own prediction (kind ``curve``). Calibrated textures and steps keep the offsets that their rows
imply; the unknown offsets of others widen the distribution.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms.arguments import common_shape, even_counts, loads, numbers, widths
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.predict.load_distribution import LoadDistribution, mix_loads
from ridgebayes.predict.load_draws import LARGEST_Q, NUMBERS_AT_ONCE, LoadDraws
from ridgebayes.predict.of_scene import load_of_scene, q_of_scene
from ridgebayes.predict.posterior_loads import PosteriorLoads, distinct, widest_count
from ridgebayes.predict.predicted import by_name
from ridgebayes.predict.q_distribution import QDistribution, mix_q, shares
from ridgebayes.scene.scene import Scene

KINDS = ("curve", "simulation")
_T = TypeVar("_T")


class Predictive(ABC):
    """Base of predictors: averages over posteriors, which `averaged` lists with their weights."""

    @property
    @abstractmethod
    def averaged(self) -> list[tuple[Posterior, float]]:
        """The posteriors that predictions are averaged over, with their weights."""

    def predict(
        self,
        a_over_R: ArrayLike | Scene,
        b_over_R: ArrayLike | None = None,
        p_over_E: ArrayLike | None = None,
        *,
        nu: ArrayLike = 0.5,
        kind: str = "simulation",
        load: ArrayLike | None = None,
    ) -> QDistribution:
        """Return the posterior predictive distribution of Q, averaged by the models' weights.

        Parameters
        ----------
        a_over_R, b_over_R, p_over_E : array_like of float, broadcastable, dimensionless
            Ridge width, groove width and load; the result has their broadcast shape. DataArrays
            of xarray meet by the names of their dimensions, and results bear these. Or a `Scene`
            in place of both widths, whose distributions are drawn together with the posterior.
        nu : array_like of float, broadcastable, dimensionless
            Poisson's ratio; of a scene its own.
        kind : str, optional
            ``simulation`` with the error model, ``curve`` for the form's own count.
        load : array_like of float or str, optional
            Loads of a scene in its own unit, or texts such as ``1.2 kPa``, in place of
            `p_over_E`. The scene's load with its distribution if neither is given.

        Returns
        -------
        QDistribution
            P(Q >= n) for every n up to the first that is negligible at the highest load.

        Raises
        ------
        InputError
            If `kind` is neither, a width or load is not positive and finite, `nu` is outside 0 to
            0.5, the shapes do not broadcast, or counts pass 20,000.
        ComputationError
            If a comparison has no form with an evidence.

        Notes
        -----
        *Validity.* Extrapolation is flagged in the result, not refused: beyond the calibrated
        a/pitch, above the highest calibrated Q or load, at an a/R or b/R below the lowest
        calibrated / 1.5 or above the highest x 1.5, and for the power law at a texture without a K.
        A scene off centre is predicted as if it were centred, and flagged.
        Under Student errors no further count than that of a body in contact over its whole width
        is given a probability.
        *Accuracy.* Monte Carlo error of a probability under 0.005 (10,240 draws of independent
        rows; 2,560 where rows share offsets). Under Student errors each draw has a normal error
        whose scale is drawn. Posteriors that are averaged have as many draws in all, each by its
        weight, but no less than a sixteenth.
        *Cost.* Some 0.3 s for 100,000 loads of one texture: averages over draws are tabulated where
        more than 512 loads need one, to a tenth of the Monte Carlo error.

        Examples
        --------
        >>> import ridgebayes as rb
        >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
        >>> q = fit.predict(0.022, 0.02, [0.002, 0.009])
        >>> q.median().tolist()
        [4, 8]

        A body whose modulus is known to 20 %:

        >>> body = {"radius": "8 mm", "youngs_modulus": "60 kPa ± 20 %"}
        >>> texture = {"ridge_width": "0.3 mm", "groove_width": "0.25 mm"}
        >>> data = {"body": body, "texture": texture, "load": {"line": "8 N/m"}}
        >>> scene = rb.Scene.from_dict(data)
        >>> [int(bound) for bound in fit.predict(scene).interval(0.9)]
        [4, 6]
        >>> fit.predict(scene, load=["4 N/m", "28 N/m"]).median().tolist()
        [4, 8]
        """
        _check_kind(kind)
        if isinstance(a_over_R, Scene):
            _refuse_beside_scene(b_over_R=b_over_R, nu=None if np.all(nu == 0.5) else nu)
            return q_of_scene(self.averaged, a_over_R, load=load, p_over_E=p_over_E, kind=kind)
        if load is not None or b_over_R is None or p_over_E is None:
            raise InputError("predict: expected a_over_R, b_over_R and p_over_E, or a Scene")
        named = {"a_over_R": a_over_R, "b_over_R": b_over_R, "p_over_E": p_over_E, "nu": nu}
        (*where, nu), labels = by_name(**named)
        mixed = mix_q(*self._parts(partial(predict_q, nu=nu, kind=kind), *where))
        return replace(mixed, labels=labels)

    def predict_load(
        self,
        a_over_R: ArrayLike | Scene,
        b_over_R: ArrayLike | None = None,
        Q: ArrayLike | None = None,
        *,
        nu: ArrayLike = 0.5,
        kind: str = "simulation",
    ) -> LoadDistribution:
        """Return the posterior predictive distribution of the load that reaches Q, averaged alike.

        Parameters
        ----------
        a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            Ridge and groove width. Or a `Scene` in place of both.
        Q : array_like of int, broadcastable, dimensionless
            Even counts of at least 4.
        nu : array_like of float, broadcastable, dimensionless
            Poisson's ratio.
        kind : str, optional
            ``simulation`` with the error model, ``curve`` for the form's own load.

        Returns
        -------
        LoadDistribution
            Distribution of p/E, or of a scene's load in its unit, with the broadcast shape.

        Raises
        ------
        InputError
            If `kind` is neither, a width is not positive and finite, a count is odd or under 4,
            `nu` is outside 0 to 0.5, or the shapes do not broadcast.
        ComputationError
            If a comparison has no form with an evidence.

        Notes
        -----
        *Validity.* As `predict`; a load is flagged where its median lies above the highest
        calibrated one, but not at a texture and count that a row was fitted at.
        *Cost.* Each distinct place is worked out once, a block at a time: some 2 ms a quantile
        where rows are independent, 1 ms where textures or steps share offsets, 8 ms under
        ``step-smooth``. A million places take some 300 MB.

        Examples
        --------
        >>> import ridgebayes as rb
        >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
        >>> load = fit.predict_load(0.022, 0.02, Q=8)
        >>> low, high = load.interval(0.9)
        >>> bool(low < load.median() < high)
        True
        """
        _check_kind(kind)
        if isinstance(a_over_R, Scene) and Q is not None:
            _refuse_beside_scene(b_over_R=b_over_R, nu=None if np.all(nu == 0.5) else nu)
            return load_of_scene(self.averaged, a_over_R, Q, kind=kind)
        if isinstance(a_over_R, Scene) or b_over_R is None or Q is None:
            raise InputError("predict_load: expected a_over_R, b_over_R and Q, or a Scene and Q")
        (*where, nu), labels = by_name(a_over_R=a_over_R, b_over_R=b_over_R, Q=Q, nu=nu)
        mixed = mix_loads(*self._parts(partial(predict_load, nu=nu, kind=kind), *where))
        return replace(mixed, labels=labels)

    def _parts(
        self, predicted: Callable[..., _T], *where: ArrayLike
    ) -> tuple[Iterator[_T], list[float]]:
        """Yield the predictions of the posteriors, beside their weights."""
        posteriors, weights = zip(*self.averaged, strict=True)
        pairs = zip(posteriors, shares(weights).tolist(), strict=True)
        return (predicted(fit, *where, share=share) for fit, share in pairs), list(weights)


def predict_q(
    fit: Posterior,
    a_over_R: ArrayLike,
    b_over_R: ArrayLike,
    p_over_E: ArrayLike,
    *,
    nu: ArrayLike = 0.5,
    kind: str = "simulation",
    share: float = 1.0,
) -> QDistribution:
    """Return the predictive distribution of Q of one posterior, see `Predictive.predict`.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    a_over_R, b_over_R, p_over_E, nu, kind
        As in `Predictive.predict`.
    share : float, optional
        Weight of this posterior in an average; it takes this share of the draws.

    Returns
    -------
    QDistribution
        Distribution with the broadcast shape.
    """
    _check_kind(kind)
    places = _broadcast(*widths(a_over_R, b_over_R), nu, p_over_E=loads(p_over_E))
    a, b, poisson, p = places.values()
    calibrated = CalibratedRange.of(fit)
    flags = calibrated.load_flags(p, poisson) | calibrated.texture_flags(a, b)
    y = reduced_load(p, poisson).ravel()
    if kind != "curve":  # a curve counts at the loads themselves, which a logarithm would round
        with np.errstate(divide="ignore"):
            y = np.log(y)
    first, place = distinct(a, b)
    textures = list(zip(a.ravel()[first].tolist(), b.ravel()[first].tolist(), strict=True))
    groups = np.split(np.argsort(place, kind="stable"), np.cumsum(np.bincount(place))[:-1])

    def distribution(part: PosteriorLoads) -> QDistribution:
        shares = [_reaching(part, *x, y[here]) for x, here in zip(textures, groups, strict=False)]
        survival = np.zeros((p.size, max((share.shape[1] for share in shares), default=1)))
        for here, share in zip(groups, shares, strict=False):
            survival[here, : share.shape[1]] = share
        survival = survival.reshape(*p.shape, survival.shape[1])
        return QDistribution(survival, flags, calibrated.Q_max, kind, places)

    parts = PosteriorLoads(fit, kind, share).parts()
    return mix_q(map(distribution, parts), [len(part) for part in parts])


def predict_load(
    fit: Posterior,
    a_over_R: ArrayLike,
    b_over_R: ArrayLike,
    Q: ArrayLike,
    *,
    nu: ArrayLike = 0.5,
    kind: str = "simulation",
    share: float = 1.0,
) -> LoadDistribution:
    """Return the predictive distribution of loads of one posterior, see `Predictive.predict_load`.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    a_over_R, b_over_R, Q, nu, kind
        As in `Predictive.predict_load`.
    share : float, optional
        As of `predict_q`.

    Returns
    -------
    LoadDistribution
        Distribution with the broadcast shape.
    """
    _check_kind(kind)
    places = _broadcast(*widths(a_over_R, b_over_R), nu, Q=even_counts(Q, least=4))
    a, b, poisson, q = places.values()
    first, place = distinct(a, b, q, poisson)
    a, b, q, poisson = columns = [column.ravel()[first] for column in (a, b, q, poisson)]
    calibrated = CalibratedRange.of(fit)
    flags = calibrated.texture_flags(a, b) | calibrated.count_flags(q)
    highest = calibrated.highest_load(a, b, q, poisson)
    parts = []
    for part in PosteriorLoads(fit, kind, share).parts():
        draws = LoadDraws.alike(len(part), partial(_at_places, part, columns), part.has_mean)
        is_small = len(part) * len(first) <= NUMBERS_AT_ONCE
        parts.append((draws.stored(len(first)) if is_small else draws, len(part)))
    n_draw = sum(n for _, n in parts)
    draws = LoadDraws.joined((draws, n / n_draw) for draws, n in parts)
    place = place.reshape(places["Q"].shape)
    where = {"kind_of_band": np.array(kind), **places, "Q": places["Q"].astype(np.int64)}
    return LoadDistribution(draws, place, flags[place], highest[place], where)


def _at_places(
    loads: PosteriorLoads, places: Sequence[FloatArray], ids: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return location and sd of the log loads of some places (a/R, b/R, Q, nu)."""
    a, b, q, nu = (column[ids] for column in places)
    return loads.at_places(a, b, q, nu)


def _reaching(loads: PosteriorLoads, a: float, b: float, y: FloatArray) -> FloatArray:
    """Return P(Q >= 2), P(Q >= 4), ... at log loads at nu = 0.5 of one texture, (n, n_step)."""

    def columns(ids: IntArray) -> tuple[FloatArray, FloatArray]:
        counts = 4 + 2 * ids
        if loads.is_curve:
            load = loads.load((a, b), counts)
            return load, np.zeros(load.shape)
        return loads.at((a, b), counts)

    last = LARGEST_Q
    if not loads.has_mean:
        last = min(last, int(widest_count(np.array(a), np.array(b))))
    draws = LoadDraws.alike(len(loads), columns, loads.has_mean)
    return draws.reaching(y, last, f" at a/R, b/R = {(a, b)}")


def _broadcast(
    a: FloatArray, b: FloatArray, nu: ArrayLike, **other: FloatArray
) -> dict[str, FloatArray]:
    """Return textures, Poisson's ratio and loads or counts in one shape, by name."""
    columns = {"a_over_R": a, "b_over_R": b, "nu": numbers("nu", nu), **other}
    shape = common_shape(**columns)
    reduced_load(1.0, nu)  # refuses a Poisson's ratio outside its range
    return {name: np.broadcast_to(column, shape) for name, column in columns.items()}


def _refuse_beside_scene(**values: ArrayLike | None) -> None:
    """Refuse arguments that a scene already has."""
    for name in [name for name, value in values.items() if value is not None]:
        raise InputError(f"{name}: expected no value beside a Scene, got {values[name]!r}")


def _check_kind(kind: str) -> None:
    if kind not in KINDS:
        raise InputError(f"kind: expected one of {', '.join(KINDS)}, got {kind!r}")
