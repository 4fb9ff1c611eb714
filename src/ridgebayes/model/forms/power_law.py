"""The power law, a contact form with one coefficient per texture."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import InputError
from ridgebayes.model.forms.arguments import widths
from ridgebayes.model.forms.base import Form


@dataclass(frozen=True)
class PowerLaw(Form):
    """Power law, eq (5): one K per texture, so that it cannot predict other textures.

    Parameters
    ----------
    textures : tuple of (float, float)
        (a/R, b/R) of the textures in the order of `theta`.
    labels : tuple of str
        Names of the textures; made from the widths if not given.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> form = rb.PowerLaw(textures=((0.022, 0.02),), labels=("grip",))
    >>> form.parameter_names
    ('K[grip]',)
    >>> form.load([4, 6], 0.022, 0.02, theta=[66.0]).round(5).tolist()  # p/E
    [0.00092, 0.00367]
    """

    textures: tuple[Texture, ...] = ()
    labels: tuple[str, ...] = ()
    name: ClassVar[str] = "power-law"

    @property
    def parameter_names(self) -> tuple[str, ...]:
        labels = self.labels or [f"a{a!r}_b{b!r}" for a, b in self.textures]
        return tuple(f"K[{label}]" for label in labels)

    def bind(self, textures: tuple[Texture, ...], labels: tuple[str, ...] = ()) -> "PowerLaw":
        return PowerLaw(tuple((float(a), float(b)) for a, b in textures), labels)

    def shape(self, Q: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        shape = np.broadcast_shapes(np.shape(Q), np.shape(a_over_R), np.shape(b_over_R))
        return np.broadcast_to(np.asarray(Q) - 2, shape)

    def pairs(self, shape: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        return np.asarray(shape) / 2

    def rate(self, theta: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        return theta[..., self._index(a_over_R, b_over_R)]

    def log_rate_gradient(
        self, theta: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike
    ) -> FloatArray:
        indicator = np.eye(len(self.textures))[self._index(a_over_R, b_over_R)]
        return indicator / theta.reshape(
            theta.shape[:-1] + (1,) * (indicator.ndim - 1) + theta.shape[-1:]
        )

    def slope(
        self, a_over_R: ArrayLike, b_over_R: ArrayLike, theta: ArrayLike | None = None
    ) -> FloatArray:
        return self.rate(self._theta(theta), *widths(a_over_R, b_over_R))

    def _index(self, a_over_R: ArrayLike, b_over_R: ArrayLike) -> IntArray:
        index_of = {texture: index for index, texture in enumerate(self.textures)}
        a, b = np.broadcast_arrays(np.asarray(a_over_R, float), np.asarray(b_over_R, float))
        index = [index_of.get(pair, -1) for pair in zip(a.flat, b.flat, strict=True)]
        if -1 in index:
            unknown = index.index(-1)
            raise InputError(
                "power-law: expected textures it was bound to, got one without a K, "
                f"a/R = {a.flat[unknown]}, b/R = {b.flat[unknown]}"
            )
        return np.reshape(np.array(index, dtype=np.int64), a.shape)
