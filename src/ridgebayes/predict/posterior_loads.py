"""Loads at which each draw of a posterior reaches a count: location and scale of their logarithms.

Draws may be weighted nodes, see `ridgebayes.predict.qmc_nodes`.
"""

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from scipy.special import ndtri

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Form, PowerLaw
from ridgebayes.model.priors import default_priors
from ridgebayes.model.shared_offsets import OffsetsGiven
from ridgebayes.predict.qmc_nodes import nodes_of
from ridgebayes.runtime.randomness import stream

Counts = IntArray | FloatArray
_FEW = 4  # coordinates that a thousand nodes fill
_N_NODE, _N_MANY = 1_024, 4_096
_N_CURVE = 16_384


@dataclass(frozen=True, eq=False)
class PosteriorLoads:
    """Some draws of a fit, or nodes, with what their rows tell of shared offsets.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    theta : ndarray of float, shape (n_draw, n_parameter)
        Parameters.
    offsets : OffsetsGiven or None
        Of the same draws.
    weight : ndarray of float, shape (n_draw, 2), or None
        Of nodes, see `ridgebayes.predict.qmc_nodes.Nodes`; draws have none.
    even : ndarray of float, shape (n_draw,), or None
        Of nodes: a further coordinate, uniform from 0 to 1, for what is not in the posterior.
    """

    fit: Posterior
    theta: FloatArray
    offsets: OffsetsGiven | None
    weight: FloatArray | None = None
    uniform: FloatArray | None = None

    @classmethod
    def of(cls, fit: Posterior, n: int) -> "PosteriorLoads":
        """Take about n of a fit's draws, evenly."""
        stride = -(-len(fit.draws) // n)
        if fit.model.offsets is None:
            return cls(fit, fit.draws[::stride], None)
        kept = _prepared.get(fit)
        if kept is None or kept[0] < stride:  # worked out once for all textures
            kept = stride, fit.model.offsets_given(fit.coordinates[::stride])
            _prepared[fit] = kept
        stride, offsets = kept
        return cls(fit, fit.draws[::stride], offsets)

    @classmethod
    def nodes(cls, fit: Posterior, kind: str) -> "PosteriorLoads | None":
        """Return the nodes that stand for a fit of rows without shared offsets, if any can.

        With offsets a density costs so much that nodes would gain nothing over draws.
        """
        if fit.model.offsets is not None:
            return None
        n = _N_NODE if fit.model.n_coordinate <= _FEW else _N_MANY
        found = nodes_of(fit, _N_CURVE if kind == "curve" else n)
        if found is None:
            return None
        return cls(fit, found.theta, None, found.weight, found.uniform)

    def average(self, values: FloatArray) -> FloatArray:
        """Return the mean over draws of values (n_draw, ...), shape (n_answer, ...).

        One answer of draws, two of nodes.
        """
        if self.weight is None:
            return values.mean(axis=0)[None]
        return np.tensordot(self.weight, values, axes=(0, 0))

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
        rng = stream(fit.seed, "new texture", form.parameter_names[0])
        if self.uniform is None:
            return form, prior.rvs(rng, len(theta))[:, None]
        return form, prior.value_at(ndtri(self.uniform))[:, None]


# Stride and offsets of a fit's draws, as long as there is the fit: they must not refer to it.
_prepared: "WeakKeyDictionary[Posterior, tuple[int, OffsetsGiven | None]]" = WeakKeyDictionary()
