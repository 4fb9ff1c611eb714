"""Posterior predictions: the distribution of Q at a load, and of the load that reaches a Q.

Probabilities are averages of conditional probabilities over the posterior's draws: P(Q >= n) is the
mean over draws of P(load(n) <= p | draw), which is a distribution function under the error model
(kind ``simulation``: what a further simulation or measurement would show) and a step for the form's
own prediction (kind ``curve``). Calibrated textures and steps keep the offsets that their rows
imply; the unknown offsets of others widen the distribution.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture, reduced_load
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms.arguments import common_shape, even_counts, loads, numbers, widths
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.predict.load_distribution import LoadDistribution, mix_loads
from ridgebayes.predict.load_draws import LoadDraws
from ridgebayes.predict.of_scene import NEGLIGIBLE, load_of_scene, q_of_scene
from ridgebayes.predict.predictive_cdf import (
    N_LOAD_DRAWS,
    Average,
    PosteriorLoads,
    distinct,
    n_draws,
    of_share,
)
from ridgebayes.predict.q_distribution import QDistribution, mix_q, shares
from ridgebayes.scene.scene import Scene

KINDS = ("curve", "simulation")
_STORED = 2**19  # draws times places up to which a load distribution keeps them: 8 MB
_HELD = 2**23  # numbers of smooth offsets' matrices that are held at once: 64 MB
_LARGEST_Q = 20_000
_BLOCK = 8  # counts worked out at a time
_MANY = 4 + 2 * _BLOCK * 16  # the first count before which it is asked whether counts end at all


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
            Ridge width, groove width and load; the result has their broadcast shape. Or a `Scene`
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
        Under Student errors no further count than that of a body in contact over its whole width
        is given a probability.
        *Accuracy.* Monte Carlo error of a probability under 0.005 (10,240 draws of independent
        rows; 2,560 where rows share offsets; half as many under Student errors). Posteriors that
        are averaged have as many in all, each by its weight, but no less than a sixteenth.
        *Cost.* Some 0.3 s for 100,000 loads of one texture: means over draws are tabulated, to
        1e-13, where more than 1,000 loads need one; of Student errors to 1e-7, also where counts
        share them.

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
        parts, weights = zip(*self.averaged, strict=True)
        each = zip(parts, shares(weights).tolist(), strict=True)
        predicted = partial(predict_q, nu=nu, kind=kind)
        found = (predicted(one, a_over_R, b_over_R, p_over_E, share=w) for one, w in each)
        return mix_q(found, weights)

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
        *Cost.* Each distinct place is worked out once, a block at a time: some 0.2 ms a quantile
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
        parts, weights = zip(*self.averaged, strict=True)
        each = zip(parts, shares(weights).tolist(), strict=True)
        predicted = partial(predict_load, nu=nu, kind=kind)
        found = (predicted(one, a_over_R, b_over_R, Q, share=w) for one, w in each)
        return mix_loads(found, weights)


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
    first, place = distinct(a, b)
    own_a, own_b = a.ravel()[first], b.ravel()[first]
    textures = list(zip(own_a.tolist(), own_b.tolist(), strict=True))
    calibrated = CalibratedRange.of(fit)
    n_draw = n_draws(fit, share)
    parts = _in_parts(fit, kind, n_draw)
    if len(parts) > 1:
        predicted = partial(predict_q, nu=nu, kind=kind)
        each = (fit.at_draws(u, fit.seed + i) for i, u in enumerate(parts))
        found = (predicted(one, a_over_R, b_over_R, p_over_E) for one in each)
        return mix_q(found, [len(u) for u in parts])
    flat_p, flat_nu = p.ravel(), poisson.ravel()
    flags = calibrated.load_flags(flat_p, flat_nu)
    flags |= calibrated.texture_flags(own_a, own_b)[place]
    groups = np.split(np.argsort(place, kind="stable"), np.cumsum(np.bincount(place))[:-1])
    ladders = [
        _survival(fit, texture, flat_p[here], flat_nu[here], kind, n_draw)
        for texture, here in zip(textures, groups, strict=False)
    ]
    n_step = max((ladder.shape[-1] for ladder in ladders), default=1)
    survival = np.zeros((p.size, n_step))
    for here, ladder in zip(groups, ladders, strict=False):
        survival[here, : ladder.shape[1]] = ladder
    return QDistribution(
        survival.reshape(*p.shape, n_step),
        flags.reshape(p.shape),
        calibrated.Q_max,
        kind,
        np.nan,
        places,
    )


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
    n = of_share(N_LOAD_DRAWS, share)
    parts = _in_parts(fit, kind, n)
    if len(parts) > 1:
        each = (fit.at_draws(u, fit.seed + i) for i, u in enumerate(parts))
        found = (predict_load(one, a_over_R, b_over_R, Q, nu=nu, kind=kind) for one in each)
        return mix_loads(found, [len(u) for u in parts])
    places = _broadcast(*widths(a_over_R, b_over_R), nu, Q=even_counts(Q, least=4))
    a, b, poisson, q = places.values()
    first, place = distinct(a, b, q, poisson)
    a, b, q, poisson = own = [column.ravel()[first] for column in (a, b, q, poisson)]
    calibrated = CalibratedRange.of(fit)
    flags = calibrated.texture_flags(a, b) | calibrated.count_flags(q)
    highest = calibrated.highest_load(a, b, q, poisson)
    part = PosteriorLoads.of(fit, n, kind)
    n_draw = len(part.theta)
    make = partial(_columns, part, own, kind)
    draws = LoadDraws(np.full(n_draw, 1 / n_draw), part.df, make)
    if n_draw * len(first) <= _STORED:
        draws = LoadDraws.stored(*make(np.arange(len(first))), draws.weight, draws.df)
    place = place.reshape(places["Q"].shape)
    where = {"kind_of_band": np.array(kind), **places, "Q": places["Q"].astype(np.int64)}
    return LoadDistribution.of(draws, place, flags[place], highest[place], where)


def _in_parts(fit: Posterior, kind: str, n: int) -> list[FloatArray]:
    """Return about n draws in parts, by their coordinates; no parts where offsets are not needed.

    Smooth offsets take a matrix for each draw; the matrices of one part are held at once.
    """
    n_place = fit.model.offsets.n_smooth
    if not n_place or kind == "curve":
        return []
    u = fit.coordinates[:: -(-len(fit.draws) // n)]
    return np.array_split(u, -(-len(u) * n_place**2 // _HELD))


def _columns(
    part: PosteriorLoads, places: Sequence[FloatArray], kind: str, ids: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return location and scale of the log loads of some places (a/R, b/R, Q, nu)."""
    a, b, q, nu = (column[ids] for column in places)
    return part.log_loads(a, b, q, nu, kind)


def _survival(
    fit: Posterior,
    texture: Texture,
    p: FloatArray,
    nu: FloatArray,
    kind: str,
    n_draw: int,
) -> FloatArray:
    """Return P(Q >= 2), P(Q >= 4), ... at loads p of one texture, shape (n_load, n_step)."""
    draws = PosteriorLoads.of(fit, n_draw, kind)
    average = Average(draws, kind)
    columns = [np.ones(len(p))]
    last = _LARGEST_Q if draws.df is None else _widest(texture)

    def reaching(counts: IntArray) -> FloatArray:
        found = np.empty((len(p), len(counts)))
        for poisson in np.unique(nu):
            here = nu == poisson
            found[here] = average.at(texture, counts, p[here], float(poisson))
        return found

    for first in range(4, last + 2, 2 * _BLOCK):
        if first == _MANY and draws.df is None and reaching(np.array([last])).max() >= NEGLIGIBLE:
            break
        counts = np.arange(first, first + 2 * _BLOCK, 2)
        # Student errors end at `last`; of normal ones a count beyond it tells whether they do.
        found = reaching(counts if draws.df is None else counts[counts <= last])
        for column in found.T:
            # One noise draw cannot reach a further ridge before a nearer one.
            columns.append(np.minimum(column, columns[-1]))
            if columns[-1].max() < NEGLIGIBLE:
                return np.stack(columns, axis=-1)
    if draws.df is not None:
        return np.stack(columns, axis=-1)
    raise InputError(
        f"p_over_E: expected counts up to {_LARGEST_Q}, got more at a/R, b/R = {texture}"
    )


def _widest(texture: Texture) -> int:
    """Return the count of a body in contact over its whole width.

    Student errors of few degrees of freedom leave some probability to any count at all.
    """
    a, b = texture
    return min(2 + 2 * int(max(1 - b / 2, 0) / (a + b)), _LARGEST_Q)


def _broadcast(
    a: FloatArray, b: FloatArray, nu: ArrayLike, **other: FloatArray
) -> dict[str, FloatArray]:
    """Return textures, Poisson's ratio and loads or counts in one shape, by name."""
    columns = {"a_over_R": a, "b_over_R": b, "nu": numbers("nu", nu), **other}
    shape = common_shape(**columns)
    reduced_load(1.0, nu)  # refuses a Poisson's ratio outside its range
    return {name: np.broadcast_to(column, shape) for name, column in columns.items()}


def _refuse_beside_scene(**values: ArrayLike | None) -> None:
    """Refuse what a scene has itself."""
    for name in [name for name, value in values.items() if value is not None]:
        raise InputError(f"{name}: expected none beside a Scene, got {values[name]!r}")


def _check_kind(kind: str) -> None:
    if kind not in KINDS:
        raise InputError(f"kind: expected one of {', '.join(KINDS)}, got {kind!r}")
