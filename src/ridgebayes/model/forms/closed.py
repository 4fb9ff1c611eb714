"""The closed-form contact forms of the paper: Classic, Modified and Hybrid."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.model.forms.arguments import widths
from ridgebayes.model.forms.base import Form


def per_texture(theta: FloatArray, a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Broadcast theta[..., 0] over the textures."""
    shape = np.broadcast_shapes(np.shape(a), np.shape(b))
    return np.broadcast_to(
        theta[..., 0].reshape(theta.shape[:-1] + (1,) * len(shape)), theta.shape[:-1] + shape
    )


class OneCoefficient(Form):
    """Base class of forms with the single coefficient c."""

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return ("c",)

    def rate(self, theta: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        return per_texture(theta, a_over_R, b_over_R)

    def log_rate_gradient(
        self, theta: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike
    ) -> FloatArray:
        return 1 / per_texture(theta, a_over_R, b_over_R)[..., None]

    def slope(
        self, a_over_R: ArrayLike, b_over_R: ArrayLike, theta: ArrayLike | None = None
    ) -> FloatArray:
        a, b = widths(a_over_R, b_over_R)
        return 2 * self.rate(self._theta(theta), a, b) / (a + b)


@dataclass(frozen=True)
class Classic(OneCoefficient):
    """Classic Hertzian form, eqs (3) and (4): the smooth Hertz contact length in pitches.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> rb.Classic().load([4, 6], a_over_R=0.022, b_over_R=0.02).round(5).tolist()  # p/E
    [0.00142, 0.00463]
    """

    name: ClassVar[str] = "classic"
    published: ClassVar[tuple[float]] = (1.382,)

    def shape(self, Q: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        a, b = np.asarray(a_over_R), np.asarray(b_over_R)
        value: FloatArray = (np.asarray(Q) / 2 - 1) * (a + b) + b / 2
        return value

    def pairs(self, shape: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        a, b = np.asarray(a_over_R), np.asarray(b_over_R)
        value: FloatArray = (shape - b / 2) / (a + b)
        return value


@dataclass(frozen=True)
class Modified(OneCoefficient):
    """Modified Hertzian form, eq (6): the contact length is measured from the first groove.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> rb.Modified().load([4, 6], a_over_R=0.022, b_over_R=0.02).round(5).tolist()  # p/E
    [0.00093, 0.00371]
    """

    name: ClassVar[str] = "modified"
    published: ClassVar[tuple[float, ...] | None] = (1.38,)

    def shape(self, Q: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        value: FloatArray = (np.asarray(Q) / 2 - 1) * (np.asarray(a_over_R) + np.asarray(b_over_R))
        return value

    def pairs(self, shape: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        value: FloatArray = shape / (np.asarray(a_over_R) + np.asarray(b_over_R))
        return value


@dataclass(frozen=True)
class Hybrid(Form):
    """Hybrid form, eq (7): the Modified form with an additional term in the ridge width.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> rb.Hybrid().load([4, 6], a_over_R=0.022, b_over_R=0.02).round(5).tolist()  # p/E
    [0.00093, 0.00371]
    """

    name: ClassVar[str] = "hybrid"
    published: ClassVar[tuple[float, ...] | None] = (1.348, 0.01583)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return ("c1", "c2")

    def shape(self, Q: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        shape = np.broadcast_shapes(np.shape(Q), np.shape(a_over_R), np.shape(b_over_R))
        return np.broadcast_to(np.asarray(Q) / 2 - 1, shape)

    def pairs(self, shape: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        return np.asarray(shape)

    def rate(self, theta: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        a, b = np.asarray(a_over_R), np.asarray(b_over_R)
        c1, c2 = per_texture(theta, a, b), per_texture(theta[..., 1:], a, b)
        value: FloatArray = c1 / (a + b) + c2 / a
        return value

    def log_rate_gradient(
        self, theta: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike
    ) -> FloatArray:
        a, b = np.asarray(a_over_R), np.asarray(b_over_R)
        rate = self.rate(theta, a, b)
        return np.stack([1 / (a + b) / rate, 1 / (a + 0 * b) / rate], axis=-1)

    def slope(
        self, a_over_R: ArrayLike, b_over_R: ArrayLike, theta: ArrayLike | None = None
    ) -> FloatArray:
        return 2 * self.rate(self._theta(theta), *widths(a_over_R, b_over_R))
