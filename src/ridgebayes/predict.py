"""Posterior predictions: the distribution of Q at a load, and of the load that reaches a Q.

Probabilities are averages of conditional probabilities over the posterior's draws: P(Q >= n) is the
mean over draws of P(load(n) <= p | draw), which is a distribution function under the error model
(kind ``simulation``: what a further simulation would show) and a step for the form's own prediction
(kind ``curve``). A texture and a step that were calibrated on keep the offsets that their rows tell
of; others widen the distribution by what is not known of theirs.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fit import Fit
from ridgebayes.forms import Form, PowerLaw, Texture, reduced_load
from ridgebayes.forms.base import loads, unique_textures, widths
from ridgebayes.loads import LoadDistribution
from ridgebayes.noise import Noise
from ridgebayes.offsets import OffsetsGiven
from ridgebayes.priors import default_priors
from ridgebayes.qdistribution import QDistribution
from ridgebayes.randomness import stream

Counts = IntArray | FloatArray
KINDS = ("curve", "simulation")
NEGLIGIBLE = 1e-6  # P(Q >= n) at the highest load under which no further n is computed
N_LOAD_DRAWS = 2_560  # draws behind a load distribution; its quantiles move by 0.02 sd at most
_LARGEST_Q = 20_000
_BLOCK = 8  # counts worked out at a time
_SATURATED = 8.3  # standard deviations beyond which a normal distribution function is 0 or 1


def predict_q(
    fit: Fit,
    a_over_R: float | FloatArray,
    b_over_R: float | FloatArray,
    p_over_E: float | FloatArray,
    *,
    nu: float | FloatArray = 0.5,
    kind: str = "simulation",
) -> QDistribution:
    """Return the posterior predictive distribution of Q.

    Parameters
    ----------
    fit : Fit
        Posterior.
    a_over_R, b_over_R, p_over_E : array_like of float, broadcastable, dimensionless
        Textures and loads; the result has their broadcast shape.
    nu : array_like of float, broadcastable, dimensionless
        Poisson's ratio.
    kind : str, optional
        ``simulation`` with the error model, ``curve`` for the form's own count.

    Returns
    -------
    QDistribution
        P(Q >= n) for every n up to the first that is negligible at the highest load.

    Raises
    ------
    InputError
        If `kind` is neither, a width or load is not positive and finite, `nu` is outside 0 to 0.5,
        or counts pass 20,000.

    Notes
    -----
    *Validity.* Extrapolation beyond the calibrated range of a/pitch and of Q is flagged in the
    result, not refused.
    Under Student errors no further count than that of a body in contact over its whole width is
    given a probability.
    *Accuracy.* Monte Carlo error of a probability under 0.005 (10,240 draws of independent rows;
    2,560 where rows share offsets, 1,280 under Student errors).

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), rng=1)
    >>> q = fit.predict(0.022, 0.02, [0.002, 0.009])
    >>> q.median().tolist()
    [4, 8]
    """
    _check_kind(kind)
    a, b, p = np.broadcast_arrays(*widths(a_over_R, b_over_R), loads(p_over_E))
    reduced_load(p, nu)  # refuses a Poisson's ratio outside its range
    p, poisson = np.broadcast_arrays(p, np.asarray(nu, dtype=float))
    a, b = np.broadcast_to(a, p.shape), np.broadcast_to(b, p.shape)
    textures = unique_textures(a, b)
    ladders = [
        _survival(fit, texture, p[here], poisson[here], kind)
        for texture, here in _by_texture(a, b, textures)
    ]
    n_step = max(ladder.shape[1] for ladder in ladders)
    survival = np.zeros((*p.shape, n_step))
    outside = np.zeros(p.shape, dtype=bool)
    for (texture, here), ladder in zip(_by_texture(a, b, textures), ladders, strict=True):
        padded = np.zeros((len(ladder), n_step))
        padded[:, : ladder.shape[1]] = ladder
        survival[here] = padded
        outside[here] = texture_extrapolates(fit, texture)
    return QDistribution(survival, outside, int(fit.model.data.Q.max()), kind)


def predict_load(
    fit: Fit,
    a_over_R: float | FloatArray,
    b_over_R: float | FloatArray,
    Q: int | FloatArray,
    *,
    nu: float = 0.5,
    kind: str = "simulation",
) -> LoadDistribution:
    """Return the posterior predictive distribution of the load that reaches Q.

    Parameters
    ----------
    fit : Fit
        Posterior.
    a_over_R, b_over_R : array_like of float, broadcastable, dimensionless
        Textures.
    Q : array_like of int, broadcastable, dimensionless
        Even counts of at least 4.
    nu : float, optional
        Poisson's ratio.
    kind : str, optional
        ``simulation`` with the error model, ``curve`` for the form's own load.

    Returns
    -------
    LoadDistribution
        Of the broadcast shape.

    Raises
    ------
    InputError
        If `kind` is neither, a width is not positive and finite, a count is odd or under 4, or
        `nu` is outside 0 to 0.5.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), rng=1)
    >>> load = fit.predict_load(0.022, 0.02, Q=8)
    >>> low, high = load.interval(0.9)
    >>> bool(low < load.median() < high)
    True
    """
    _check_kind(kind)
    a, b, q = np.broadcast_arrays(*widths(a_over_R, b_over_R), np.asarray(Q))
    if not np.all((q >= 4) & (np.mod(q, 2) == 0)):
        raise InputError(f"Q: {Q!r} given; rule: even and at least 4")
    part = _Draws.of(fit, N_LOAD_DRAWS)
    mean, sd = np.empty((len(part.theta), *q.shape)), np.zeros((len(part.theta), *q.shape))
    outside = np.zeros(q.shape, dtype=bool)
    for texture, here in _by_texture(a, b, unique_textures(a, b)):
        mean[:, here], sd[:, here] = part.log_load(texture, q[here], nu, kind)
        outside[here] = texture_extrapolates(fit, texture)
    outside = outside | (q > fit.model.data.Q.max())
    weight = np.full(len(mean), 1 / len(mean))
    return LoadDistribution(mean, sd, weight, outside, part.df)


def mix_q(parts: Sequence[QDistribution], weights: Sequence[float]) -> QDistribution:
    """Return the average of distributions of Q, such as over forms by model probability.

    Parameters
    ----------
    parts : sequence of QDistribution
        Of one shape and kind.
    weights : sequence of float
        Non-negative; normalised here.

    Returns
    -------
    QDistribution
        Flagged as extrapolation wherever a part with weight above 1 % is.
    """
    share = np.asarray(weights, dtype=float) / np.sum(weights)
    n_step = max(part.survival.shape[-1] for part in parts)
    survival = np.zeros((*parts[0].survival.shape[:-1], n_step))
    for part, weight in zip(parts, share, strict=True):
        survival[..., : part.survival.shape[-1]] += weight * part.survival
    heavy = [part for part, weight in zip(parts, share, strict=True) if weight > 0.01]
    outside = np.any([part.texture_outside for part in heavy], axis=0)
    q_max = min(part.q_calibrated_max for part in heavy)
    return QDistribution(survival, outside, q_max, parts[0].kind)


def texture_extrapolates(fit: Fit, texture: Texture) -> bool:
    """Return whether a texture lies outside what the fit was calibrated on.

    Outside means a/pitch beyond the calibrated range; for the power law, any texture without a K.
    """
    if isinstance(fit.form, PowerLaw):
        return texture not in fit.form.textures
    ratios = [a / (a + b) for a, b in fit.model.data.textures]
    ratio = texture[0] / (texture[0] + texture[1])
    slack = 1e-12  # of a texture that is a calibrated one at another scale, but for rounding
    return not min(ratios) * (1 - slack) <= ratio <= max(ratios) * (1 + slack)


@dataclass(frozen=True, eq=False)
class _Draws:
    """Some draws of a fit, with what their rows tell of shared offsets."""

    fit: Fit
    theta: FloatArray
    offsets: OffsetsGiven | None

    @classmethod
    def of(cls, fit: Fit, n: int) -> "_Draws":
        stride = -(-len(fit.draws) // n)
        if fit.model.offsets is None:
            return cls(fit, fit.draws[::stride], None)
        kept = _prepared.get(fit)
        if kept is None or kept[0] < stride:  # worked out once for all textures
            kept = stride, fit.model.offsets_given(fit.coordinates[::stride])
            _prepared[fit] = kept
        stride, offsets = kept
        return cls(fit, fit.draws[::stride], offsets)

    @property
    def df(self) -> FloatArray | None:
        """Degrees of freedom of each draw's errors; None where these are normal."""
        return self.theta[:, -1] if self.fit.noise.tail == "student" else None

    def load(self, texture: Texture, Q: Counts, nu: float | FloatArray) -> FloatArray:
        """Return the form's own load of each draw, (n_draw, n_Q); infinite where none reaches Q."""
        form, theta = self._form_at(texture)
        return np.nan_to_num(form.load(Q, *texture, theta, nu), nan=np.inf, posinf=np.inf)

    def log_load(
        self, texture: Texture, Q: Counts, nu: float | FloatArray, kind: str
    ) -> tuple[FloatArray, FloatArray]:
        """Return location and scale of the log load of each draw, both (n_draw, n_Q).

        The location is infinite for a draw whose rate reaches no further ridge.
        """
        mean = np.log(self.load(texture, Q, nu))
        if kind == "curve":
            return mean, np.zeros(mean.shape)
        sigma = self.theta[:, self.fit.model.n_coefficient, None]
        if self.offsets is None:
            return mean, np.broadcast_to(sigma, mean.shape)
        steps, places = np.unique(Q, return_inverse=True)
        offset, variance = self.offsets.at(texture, steps.astype(np.int64))
        if self.df is None:
            scale = np.sqrt(sigma**2 + variance)
        else:  # a normal and a t have no closed-form sum: one offset is drawn for each draw
            rng = stream(self.fit.seed, f"offset of a/R {texture[0]!r}, b/R {texture[1]!r}")
            offset = offset + np.sqrt(variance) * rng.standard_normal((len(offset), 1))
            scale = np.broadcast_to(sigma, offset.shape)
        return mean + offset[:, places], scale[:, places]

    def _form_at(self, texture: Texture) -> tuple[Form, FloatArray]:
        """Return the form and its draws for a texture; a new one draws its K from the prior."""
        fit = self.fit
        theta = self.theta[:, : fit.model.n_coefficient]
        if not isinstance(fit.form, PowerLaw) or texture in fit.form.textures:
            return fit.form, theta
        form = PowerLaw().bind((texture,))
        prior = default_priors(form)[form.parameter_names[0]]
        new = prior.rvs(stream(fit.seed, "new texture", form.parameter_names[0]), len(theta))
        return form, new[:, None]


# Stride and offsets of a fit's draws, as long as there is the fit: they must not refer to it.
_prepared: "WeakKeyDictionary[Fit, tuple[int, OffsetsGiven | None]]" = WeakKeyDictionary()


def _survival(fit: Fit, texture: Texture, p: FloatArray, nu: FloatArray, kind: str) -> FloatArray:
    """Return P(Q >= 2), P(Q >= 4), ... at loads p of one texture, shape (n_load, n_step)."""
    n_draw = len(fit.draws) if fit.model.offsets is None else N_LOAD_DRAWS
    draws = _Draws.of(fit, n_draw if fit.noise.tail == "normal" else N_LOAD_DRAWS // 2)
    columns = [np.ones(len(p))]
    last = _LARGEST_Q if draws.df is None else _widest(texture)
    for first in range(4, last + 2, 2 * _BLOCK):
        block = np.arange(first, first + 2 * _BLOCK, 2)
        found = np.empty((len(p), _BLOCK))
        for poisson in np.unique(nu):
            here = nu == poisson
            if kind == "curve":
                # Compared as loads, so that a draw's own transition load counts as reached.
                load = np.sort(draws.load(texture, block, poisson), axis=0)
                for i in range(_BLOCK):
                    found[here, i] = np.searchsorted(load[:, i], p[here], side="right") / len(load)
                continue
            mean, scale = draws.log_load(texture, block, poisson, kind)
            for i in range(_BLOCK):
                found[here, i] = _reached(fit.noise, p[here], mean[:, i], scale[:, i], draws.df)
        for column in found.T:
            # One noise draw cannot reach a further ridge before a nearer one.
            columns.append(np.minimum(column, columns[-1]))
            if columns[-1].max() < NEGLIGIBLE:
                return np.stack(columns, axis=-1)
    if draws.df is not None:
        return np.stack(columns, axis=-1)
    raise InputError(f"p_over_E: counts above {_LARGEST_Q} at a/R, b/R = {texture}; rule: fewer")


def _widest(texture: Texture) -> int:
    """Return the count of a body in contact over its whole width.

    Student errors of few degrees of freedom leave some probability to any count at all.
    """
    a, b = texture
    return min(2 + 2 * int(max(1 - b / 2, 0) / (a + b)), _LARGEST_Q)


def _reached(
    noise: Noise, p: FloatArray, mean: FloatArray, scale: FloatArray, df: FloatArray | None
) -> FloatArray:
    """Return the mean over draws of P(log load <= log p), normals where they are not 0 or 1."""
    with np.errstate(divide="ignore"):
        y = np.log(p)
    reach = _SATURATED * scale if df is None else np.inf
    result = (y > (mean + reach).max()).astype(float)
    between = np.flatnonzero((y >= (mean - reach).min()) & (result == 0))
    nu = None if df is None else df[:, None]
    for i in range(0, len(between), 500):  # bounded memory: draws x 500 loads
        part = between[i : i + 500]
        z = (y[part] - mean[:, None]) / scale[:, None]
        result[part] = noise.distribution.cdf(z, nu).mean(axis=0)
    return result


def _by_texture(
    a: FloatArray, b: FloatArray, textures: list[Texture]
) -> Iterator[tuple[Texture, BoolArray]]:
    for texture in textures:
        yield texture, (a == texture[0]) & (b == texture[1])


def _check_kind(kind: str) -> None:
    if kind not in KINDS:
        raise InputError(f"kind: {kind!r} given; rule: one of {', '.join(KINDS)}")
