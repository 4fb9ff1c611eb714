"""Stress and stiffness of the body in plane strain: linear, or neo-Hookean at any strain.

The mean stress is a field of its own, p, so that nothing becomes infinite at nu = 0.5; its equation
is J - 1 - p/K = 0 (its trace at small strain). What is here is the rest: the stress P(F, p) and its
derivative by F, on arrays of deformation gradients, shape (..., 2, 2), in units of E.
"""

from dataclasses import dataclass

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError

_IDENTITY = np.eye(2)
# d cof(F)_iJ / d F_kL of a plane F: cof(F) = [[F22, -F21], [-F12, F11]].
_COFACTOR = np.zeros((2, 2, 2, 2))
_COFACTOR[0, 0, 1, 1] = _COFACTOR[1, 1, 0, 0] = 1.0
_COFACTOR[0, 1, 1, 0] = _COFACTOR[1, 0, 0, 1] = -1.0


@dataclass(frozen=True)
class Material:
    """An isotropic body of Young's modulus 1.

    Parameters
    ----------
    nu : float, scalar, dimensionless
        Poisson's ratio, 0 to 0.5, both included.
    finite : bool
        Neo-Hookean at finite strain, W = mu/2 (J^(-2/3) I1 - 3) + K/2 (J - 1)^2 with I1 of the
        three-dimensional F; or linear.
    """

    nu: float = 0.5
    finite: bool = True

    def __post_init__(self) -> None:
        if not 0.0 <= self.nu <= 0.5:
            raise InputError(f"nu = {self.nu!r}; expected 0 to 0.5")

    @property
    def mu(self) -> float:
        """Shear modulus over Young's."""
        return 0.5 / (1.0 + self.nu)

    @property
    def compressibility(self) -> float:
        """1/K times Young's modulus: 3 (1 - 2 nu), zero where the volume cannot change."""
        return 3.0 * (1.0 - 2.0 * self.nu)

    def stress(self, F: FloatArray, p: FloatArray) -> FloatArray:
        """Return the first Piola-Kirchhoff stress, shape (..., 2, 2)."""
        if not self.finite:
            H = F - _IDENTITY
            trace = np.trace(H, axis1=-2, axis2=-1)[..., None, None]
            strain = 0.5 * (H + np.swapaxes(H, -1, -2))
            deviator = strain - trace / 3.0 * _IDENTITY
            return np.asarray(2.0 * self.mu * deviator + p[..., None, None] * _IDENTITY)
        J, cof = jacobian(F), cofactor(F)
        first = np.einsum("...ij,...ij->...", F, F) + 1.0
        scale = self.mu * J ** (-2.0 / 3.0)
        hydrostatic = (p - scale * first / (3.0 * J))[..., None, None] * cof
        return np.asarray(scale[..., None, None] * F + hydrostatic)

    def stiffness(self, F: FloatArray, p: FloatArray) -> FloatArray:
        """Return dP/dF at fixed p, shape (..., 2, 2, 2, 2)."""
        eye4 = np.einsum("ik,jl->ijkl", _IDENTITY, _IDENTITY)
        if not self.finite:
            swap = np.einsum("il,jk->ijkl", _IDENTITY, _IDENTITY)
            outer = np.einsum("ij,kl->ijkl", _IDENTITY, _IDENTITY)
            one = self.mu * (eye4 + swap - 2.0 / 3.0 * outer)
            return np.broadcast_to(one, (*F.shape[:-2], 2, 2, 2, 2))
        J, cof = jacobian(F), cofactor(F)
        inverse = cof / J[..., None, None]  # F^-T
        first = np.einsum("...ij,...ij->...", F, F) + 1.0
        scale = self.mu * J ** (-2.0 / 3.0)
        mixed = np.einsum("...ij,...kl->...ijkl", F, inverse)
        found = eye4 - 2.0 / 3.0 * (mixed + np.moveaxis(mixed, (-4, -3), (-2, -1)))
        four = (..., None, None, None, None)
        outer = np.einsum("...ij,...kl->...ijkl", inverse, inverse)
        found = found + (2.0 / 9.0 * first)[four] * outer
        found = found + (first / 3.0)[four] * np.einsum("...il,...kj->...ijkl", inverse, inverse)
        value: FloatArray = scale[four] * found + p[four] * _COFACTOR
        return value


def jacobian(F: FloatArray) -> FloatArray:
    """Return det F of plane gradients, which is J in plane strain."""
    return F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]


def cofactor(F: FloatArray) -> FloatArray:
    """Return cof F = J F^-T = dJ/dF of plane gradients."""
    found = np.empty_like(F)
    found[..., 0, 0], found[..., 1, 1] = F[..., 1, 1], F[..., 0, 0]
    found[..., 0, 1], found[..., 1, 0] = -F[..., 1, 0], -F[..., 0, 1]
    return found
