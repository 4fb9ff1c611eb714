"""Posterior predictive distributions of Q at a load, and of the load that reaches a Q.

P(Q >= n) is the mean over the posterior's draws of P(load(n) <= p | draw). For the kind
``simulation``, which predicts a further simulation or measurement, this probability follows from
the error model. For the kind ``curve``, which predicts the form's load without errors, it is 0 or
1. Calibrated textures and steps keep the offsets inferred from their rows; the unknown offsets of
new textures widen the distribution.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import TypeVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ridgebayes._types import BATCH_SIZE, FloatArray, IntArray
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.errors import InputError, warn_of
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms.arguments import common_shape, even_counts, loads, numbers, widths
from ridgebayes.predict.extrapolation import CalibratedRange
from ridgebayes.predict.load_distribution import LoadDistribution, mix_loads
from ridgebayes.predict.load_draws import Columns
from ridgebayes.predict.of_scene import load_of_scene, q_of_scene, without_effect
from ridgebayes.predict.posterior_loads import PosteriorLoads, by_texture
from ridgebayes.predict.predicted import align_arrays
from ridgebayes.predict.q_distribution import QDistribution, mix_q, shares
from ridgebayes.scene.scene import Scene

KINDS = ("curve", "simulation")
Places = dict[str, FloatArray]  # a_over_R, b_over_R, nu, and p_over_E or Q, of one shape
_T = TypeVar("_T")


class Predictive(ABC):
    """Base class of predictors that average over the weighted posteriors in `averaged`."""

    @property
    @abstractmethod
    def averaged(self) -> list[tuple[Posterior, float]]:
        """Posteriors over which predictions are averaged, with their weights."""

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
        """Return the posterior predictive distribution of Q, averaged over models by their weights.

        Parameters
        ----------
        a_over_R, b_over_R, p_over_E : array_like of float, broadcastable, dimensionless
            Ridge width, groove width and load; the result has their broadcast shape. xarray
            DataArrays are broadcast by dimension name, and the results are DataArrays too. A
            `Scene` may replace both widths; its uncertain values are drawn together with the
            posterior.
        nu : array_like of float, broadcastable, dimensionless
            Poisson's ratio; not allowed with a scene, which has its own.
        kind : str, optional
            ``simulation`` with the error model, ``curve`` for the form's count without errors.
        load : array_like of float or str, optional
            Loads of a scene in the scene's unit, or texts such as ``1.2 kPa``, instead of
            `p_over_E`. If neither is given, the scene's load with its distribution is used.

        Returns
        -------
        QDistribution
            P(Q >= n) for every n up to the first with a negligible probability at all loads.

        Raises
        ------
        InputError
            If `kind` is unknown, a width or load is not positive and finite, `nu` is outside 0 to
            0.5, the shapes do not broadcast, or counts exceed 20,000.
        ComputationError
            If a comparison has no form with an evidence.

        Warns
        -----
        CautionWarning
            If values of the scene have no effect.

        Notes
        -----
        *Validity.* Extrapolation is allowed and flagged in the result: a/pitch beyond its
        calibrated range, Q or load above the highest calibrated value, a/R or b/R below the lowest
        calibrated value / 1.5 or above the highest x 1.5, and, for the power law, a texture without
        a fitted K. A scene that is off centre is predicted as if it were centred, and is flagged.
        Groove depth, corner radius, ``ogden`` and friction of a scene are not used: the prediction
        holds for ridges and bodies like those of the fitted rows. Under Student errors counts above
        the count of full contact have probability 0.
        *Accuracy.* The Monte Carlo error of a probability is below 0.005 for independent rows
        (10,240 draws), and below 0.01 if rows share offsets (2,560). If such rows are brackets,
        counts or have Student errors, it is below 0.013: about 1,600 draws count. Under Student
        errors each draw has a normal error with a randomly drawn scale. Averages over posteriors
        share these draws in proportion to the weights, with at least a sixteenth of them for each
        posterior.
        *Cost.* About 0.3 s for 100,000 loads of one texture. Averages over draws are interpolated
        for more than 512 loads, with an error of at most a tenth of the Monte Carlo error.

        Examples
        --------
        >>> import ridgebayes as rb
        >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
        >>> q = fit.predict(0.022, 0.02, [0.002, 0.009])
        >>> q.median().tolist()
        [4, 8]

        A body with an uncertainty of 20 % in its modulus:

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
            warn_of(without_effect(a_over_R))
            return q_of_scene(self.averaged, a_over_R, load=load, p_over_E=p_over_E, kind=kind)
        if load is not None or b_over_R is None or p_over_E is None:
            raise InputError("predict: expected a_over_R, b_over_R and p_over_E, or a Scene")
        named = {"a_over_R": a_over_R, "b_over_R": b_over_R, "p_over_E": p_over_E, "nu": nu}
        where, labels = align_arrays(**named)
        mixed = mix_q(*self._parts(predict_q, q_places(*where), kind))
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
        """Return the posterior predictive distribution of the load that reaches Q.

        The distribution is averaged over models by their weights, as in `predict`.

        Parameters
        ----------
        a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
            Ridge and groove width; a `Scene` may replace both.
        Q : array_like of int, broadcastable, dimensionless
            Even counts of at least 4.
        nu : array_like of float, broadcastable, dimensionless
            Poisson's ratio.
        kind : str, optional
            ``simulation`` with the error model, ``curve`` for the form's load without errors.

        Returns
        -------
        LoadDistribution
            Distributions of p/E, or of a scene's load in its unit, with the broadcast shape.

        Raises
        ------
        InputError
            If `kind` is unknown, a width is not positive and finite, a count is odd or below 4,
            `nu` is outside 0 to 0.5, or the shapes do not broadcast.
        ComputationError
            If a comparison has no form with an evidence.

        Warns
        -----
        CautionWarning
            If values of the scene have no effect.

        Notes
        -----
        *Validity.* As in `predict`. A load is flagged if its median is above the highest calibrated
        load, except at the texture and count of a fitted row.
        *Cost.* Each distinct place is computed once, in blocks. A quantile takes about 2 ms for
        independent rows, 1 ms if textures or steps share offsets, and 8 ms under ``step-smooth``.
        A million places take up to 170 MB.

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
            warn_of(without_effect(a_over_R))
            return load_of_scene(self.averaged, a_over_R, Q, kind=kind)
        if isinstance(a_over_R, Scene) or b_over_R is None or Q is None:
            raise InputError("predict_load: expected a_over_R, b_over_R and Q, or a Scene and Q")
        where, labels = align_arrays(a_over_R=a_over_R, b_over_R=b_over_R, Q=Q, nu=nu)
        mixed = mix_loads(*self._parts(predict_load, load_places(*where), kind))
        return replace(mixed, labels=labels)

    def _parts(
        self, predicted: Callable[..., _T], places: Places, kind: str
    ) -> tuple[Iterator[_T], list[float]]:
        """Return an iterator over the posteriors' predictions, and their weights."""
        posteriors, weights = zip(*self.averaged, strict=True)
        pairs = zip(posteriors, shares(weights).tolist(), strict=True)
        return (predicted(fit, places, kind, share) for fit, share in pairs), list(weights)


def q_places(
    a_over_R: ArrayLike, b_over_R: ArrayLike, p_over_E: ArrayLike, nu: ArrayLike = 0.5
) -> Places:
    """Return the checked arguments of a prediction of Q, broadcast to one shape."""
    return _broadcast(*widths(a_over_R, b_over_R), nu, p_over_E=loads(p_over_E))


def load_places(
    a_over_R: ArrayLike, b_over_R: ArrayLike, Q: ArrayLike, nu: ArrayLike = 0.5
) -> Places:
    """Return the checked arguments of a prediction of loads, broadcast to one shape."""
    return _broadcast(*widths(a_over_R, b_over_R), nu, Q=even_counts(Q, least=4))


def predict_q(
    fit: Posterior, places: Places, kind: str = "simulation", share: float = 1.0
) -> QDistribution:
    """Return the predictive distribution of Q of a single posterior, see `Predictive.predict`.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    places : dict of str to ndarray of float, shape (...)
        Result of `q_places`.
    kind : str, optional
        As in `Predictive.predict`.
    share : float, optional
        Weight of this posterior in an average; this share of its draws is used.

    Returns
    -------
    QDistribution
        Distribution with the shape of the places.
    """
    a, b, poisson, p = places.values()
    calibrated = CalibratedRange.of(fit)
    flags = calibrated.load_flags(p, poisson) | calibrated.texture_flags(a, b)
    reduced, textures = reduced_load(p, poisson).ravel(), by_texture(a, b)

    def distribution(part: PosteriorLoads) -> QDistribution:
        blocks = [part.survival(texture, reduced[here]) for texture, here in textures]
        survival = np.zeros((p.size, max((block.shape[1] for block in blocks), default=1)))
        for (_, here), block in zip(textures, blocks, strict=True):
            survival[here, : block.shape[1]] = block
        survival = survival.reshape(*p.shape, survival.shape[1])
        return QDistribution(survival, flags, calibrated.Q_max, kind, places)

    parts = list(PosteriorLoads(fit, kind, share).parts())
    return mix_q(map(distribution, parts), [len(part) for part in parts])


def predict_load(
    fit: Posterior, places: Places, kind: str = "simulation", share: float = 1.0
) -> LoadDistribution:
    """Return the predictive distribution of loads of one posterior, see `Predictive.predict_load`.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    places : dict of str to ndarray of float, shape (...)
        Result of `load_places`.
    kind, share
        As in `predict_q`.

    Returns
    -------
    LoadDistribution
        Distribution with the shape of the places.
    """
    # Equal places share a column.
    frame = pd.DataFrame({name: column.ravel() for name, column in places.items()})
    a, b, poisson, q = columns = frame.drop_duplicates().to_numpy().T
    ids = frame.groupby([*frame], sort=False).ngroup()
    place = np.asarray(ids, np.int64).reshape(places["Q"].shape)
    calibrated = CalibratedRange.of(fit)
    flags = (calibrated.texture_flags(a, b) | calibrated.count_flags(q))[place]
    highest = calibrated.highest_load(a, b, q, poisson)[place]
    where = {"kind_of_band": np.array(kind), **places, "Q": places["Q"].astype(np.int64)}

    def distribution(part: PosteriorLoads) -> LoadDistribution:
        at = partial(part.at_places, columns)
        if len(part) * len(q) <= BATCH_SIZE:  # computed once
            at = partial(_stored, *at(np.arange(len(q))))
        weight = np.full(len(part), 1 / len(part))
        return LoadDistribution(weight, at, place, flags, highest, where, part.has_mean)

    parts = list(PosteriorLoads(fit, kind, share).parts())
    return mix_loads(map(distribution, parts), [len(part) for part in parts])


def _stored(mean: FloatArray, sd: FloatArray, ids: IntArray) -> Columns:
    return mean[:, ids], sd[:, ids]


def _broadcast(a: FloatArray, b: FloatArray, nu: ArrayLike, **other: FloatArray) -> Places:
    """Broadcast textures, Poisson's ratio and loads or counts to one shape."""
    columns = {"a_over_R": a, "b_over_R": b, "nu": numbers("nu", nu), **other}
    shape = common_shape(**columns)
    reduced_load(1.0, nu)  # raises InputError for a Poisson's ratio outside its range
    return {name: np.broadcast_to(column, shape) for name, column in columns.items()}


def _refuse_beside_scene(**values: ArrayLike | None) -> None:
    """Raise InputError for arguments that the scene already determines."""
    for name in [name for name, value in values.items() if value is not None]:
        raise InputError(f"{name}: expected no value beside a Scene, got {values[name]!r}")


def _check_kind(kind: str) -> None:
    if kind not in KINDS:
        raise InputError(f"kind: expected one of {', '.join(KINDS)}, got {kind!r}")
