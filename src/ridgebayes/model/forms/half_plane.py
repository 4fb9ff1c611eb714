"""The half-plane equation as a contact form, with one coefficient that is 1 in theory."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.contact.hertz import hertz_constant
from ridgebayes.contact.scaling import REFERENCE, Texture
from ridgebayes.errors import InputError
from ridgebayes.model.forms.arguments import unique_textures
from ridgebayes.model.forms.closed import OneCoefficient


@dataclass(frozen=True)
class HalfPlane(OneCoefficient):
    """Half-plane form: transition loads of the half-plane equation, divided by c^2.

    In theory c = 1. Between transitions Q' is interpolated linearly in s. `slope` is the limit for
    many ridges, smooth Hertz contact. More than `n_transition_max` pairs raise InputError, since
    the solver needs a ridge for each pair. So do grooves that are too narrow for the solver to
    reach its tolerance, below about b = a/100,000.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> rb.HalfPlane().load([4, 6], a_over_R=0.022, b_over_R=0.02).round(5).tolist()  # p/E
    [0.00099, 0.00376]
    """

    name: ClassVar[str] = "half-plane"
    published: ClassVar[tuple[float, ...] | None] = (1.0,)
    n_transition_max: ClassVar[int] = 500

    def shape(self, Q: ArrayLike, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        Q, a, b = np.broadcast_arrays(np.asarray(Q, float), a_over_R, b_over_R)
        shape = np.empty(Q.shape)
        for texture in unique_textures(a, b):
            here = (a == texture[0]) & (b == texture[1])
            steps = (Q[here] / 2 - 1).astype(int)
            shape[here] = self._transitions(texture, int(steps.max()))[steps]
        return shape

    def pairs(self, shape: FloatArray, a_over_R: ArrayLike, b_over_R: ArrayLike) -> FloatArray:
        value, a, b = np.broadcast_arrays(shape, a_over_R, b_over_R)
        pairs = np.full(value.shape, np.nan)
        for texture in unique_textures(a, b):
            here = (a == texture[0]) & (b == texture[1]) & ~np.isnan(value)
            if not here.any():
                continue
            # First guess: transitions of smooth Hertz contact, 0.72 L apart in s.
            n = float(np.max(value[here])) / (0.72 * (texture[0] + texture[1]))
            transitions = self._transitions(texture, math.ceil(n) + 3)
            while transitions[-1] < np.max(value[here]):
                transitions = self._transitions(texture, len(transitions) + 3)
            pairs[here] = np.interp(value[here], transitions, np.arange(len(transitions)))
        return pairs

    def slope(
        self, a_over_R: ArrayLike, b_over_R: ArrayLike, theta: ArrayLike | None = None
    ) -> FloatArray:
        return hertz_constant(0.5) * super().slope(a_over_R, b_over_R, theta)

    def _transitions(self, texture: Texture, n_transition: int) -> FloatArray:
        """Return s of transitions 0 to n at c = 1 and nu = 0.5; transition 0 is first touch."""
        if n_transition > self.n_transition_max:
            raise InputError(
                f"half-plane: a/R = {texture[0]}, b/R = {texture[1]}: expected at most "
                f"{self.n_transition_max} pairs, got {n_transition:.4g}"
            )
        result = transition_loads(texture[0], texture[1], max(n_transition, 1))
        failed = [status for status in result.status if status != "ok"]
        if failed:
            raise InputError(
                f"half-plane: a/R = {texture[0]}, b/R = {texture[1]}: expected loads within "
                f"their tolerance, got {failed[0]}"
            )
        pitch = texture[0] + texture[1]
        return np.concatenate([[0.0], pitch * np.sqrt(result.F / REFERENCE)])
