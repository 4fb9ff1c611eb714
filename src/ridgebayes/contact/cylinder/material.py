"""Stress and stiffness of an Ogden material in plane strain, at any strain.

The mean stress p is a separate field, so nothing becomes infinite at nu = 0.5; its equation is
J - 1 - p/K = 0. This module has the other equations: the stress P(F, p) and its derivative by F, on
arrays of deformation gradients, shape (..., 2, 2), in units of E.
"""

from dataclasses import dataclass

import numpy as np

from ridgebayes._types import NEO_HOOKEAN, FloatArray, Ogden
from ridgebayes.errors import InputError

_NEAR_STRETCH, _N_TAYLOR = 0.1, 6


@dataclass(frozen=True)
class Material:
    """Isotropic material of Young's modulus 1.

    Parameters
    ----------
    nu : float, scalar, dimensionless
        Poisson's ratio, 0 to 0.5, both included.
    ogden : tuple of (float, float), optional
        Terms (c, m) of W = sum of 2 mu c/m^2 (J^(-m/3) (l1^m + l2^m + 1) - 3), + K/2 (J - 1)^2: c
        is a share of the shear modulus mu, and m the exponent of the stretches l1 and l2. A single
        term with m = 2 is neo-Hookean. Terms with m = 2 and -2 give the Mooney-Rivlin material,
        which equals it in plane strain at nu = 0.5. Larger exponents stiffen.
    """

    nu: float = 0.5
    ogden: Ogden = NEO_HOOKEAN

    def __post_init__(self) -> None:
        if not 0.0 <= self.nu <= 0.5:
            raise InputError(f"nu = {self.nu!r}; expected 0 to 0.5")

    @property
    def mu(self) -> float:
        """Shear modulus over Young's modulus."""
        return 0.5 / (1.0 + self.nu)

    @property
    def compressibility(self) -> float:
        """Young's modulus over K: 3 (1 - 2 nu), zero for an incompressible material."""
        return 3.0 * (1.0 - 2.0 * self.nu)

    def stress(self, F: FloatArray, p: FloatArray) -> FloatArray:
        """Return the first Piola-Kirchhoff stress, shape (..., 2, 2)."""
        by_s, by_J = self._slopes(F)[:2, ..., None, None]
        return np.asarray(2.0 * by_s * F + (by_J + p[..., None, None]) * cofactor(F))

    def stiffness(self, F: FloatArray, p: FloatArray) -> FloatArray:
        """Return dP/dF at fixed p, shape (..., 2, 2, 2, 2)."""
        eye4 = np.einsum("ik,jl->ijkl", np.eye(2), np.eye(2))
        four, cof = (..., None, None, None, None), cofactor(F)
        by_s, by_J, by_ss, by_sJ, by_JJ = self._slopes(F)[four]
        mixed = np.einsum("...ij,...kl->...ijkl", F, cof)
        mixed = mixed + np.moveaxis(mixed, (-4, -3), (-2, -1))
        tangent = 2.0 * by_s * eye4 + 2.0 * by_sJ * mixed
        tangent = tangent + 4.0 * by_ss * np.einsum("...ij,...kl->...ijkl", F, F)
        tangent = tangent + by_JJ * np.einsum("...ij,...kl->...ijkl", cof, cof)
        # The cofactor is linear in F, so its derivative is the cofactor of unit gradients.
        return np.asarray(tangent + (by_J + p[four]) * cofactor(eye4))

    def _slopes(self, F: FloatArray) -> FloatArray:
        """Return the derivatives of the energy without its volumetric part, shape (5, ...).

        By s = F:F of the plane F, by its determinant J, and the second by ss, sJ and JJ.
        """
        square, J = np.einsum("...ij,...ij->...", F, F), jacobian(F)
        total = np.zeros((5, *J.shape))
        for share, exponent in self.ogden:
            total += 2.0 * self.mu * share / exponent**2 * _ogden_slopes(square, J, exponent)
        return total


def _ogden_slopes(square: FloatArray, J: FloatArray, exponent: float) -> FloatArray:
    """Return the derivatives of J^(-m/3) (l1^m + l2^m + 1) in the order of `Material._slopes`.

    The exponent is m. With c = F:F/2J, l1^m + l2^m = 2 J^(m/2) T(c), where T(cosh t) = cosh(m t/2).
    """
    c, third, sixth = 0.5 * square / J, exponent / 3.0, exponent / 6.0
    T, dT, ddT = _chebyshev(c, 0.5 * exponent)
    h, alone = J**sixth, third * J ** (-third - 1.0)
    return np.stack(
        [
            h * dT / J,
            2.0 * h / J * (sixth * T - c * dT) - alone,
            0.5 * h * ddT / J**2,
            h / J**2 * ((sixth - 1.0) * dT - c * ddT),
            2.0 * h / J**2 * (sixth * (sixth - 1.0) * T + 2.0 * (1.0 - sixth) * c * dT + c**2 * ddT)
            + (third + 1.0) * alone / J,
        ]
    )


def _chebyshev(c: FloatArray, n: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return T(c) = cosh(n arccosh c) for c >= 1 and real n, and its first two derivatives."""
    above = np.maximum(c - 1.0, 0.0)
    s = np.arccosh(1.0 + above)
    near = s < _NEAR_STRETCH / max(abs(n), 1.0)  # both stretches are nearly equal
    far = np.where(near, 1.0, s)
    T, dT = np.cosh(n * s), n * np.sinh(n * far) / np.sinh(far)
    ddT = (n**2 * T - c * dT) / np.sinh(far) ** 2  # Chebyshev's equation
    # Taylor series about c = 1.
    terms = np.cumprod([(n**2 - j**2) / ((2 * j + 1) * max(j, 1)) for j in range(_N_TAYLOR)])
    dT = np.where(near, np.polynomial.polynomial.polyval(above, terms), dT)
    second = np.polynomial.polynomial.polyder(terms)
    return T, dT, np.where(near, np.polynomial.polynomial.polyval(above, second), ddT)


def jacobian(F: FloatArray) -> FloatArray:
    """Return det F of plane gradients, which is J in plane strain."""
    return F[..., 0, 0] * F[..., 1, 1] - F[..., 0, 1] * F[..., 1, 0]


def cofactor(F: FloatArray) -> FloatArray:
    """Return cof F = J F^-T = dJ/dF of plane gradients."""
    cof = np.empty_like(F)
    cof[..., 0, 0], cof[..., 1, 1] = F[..., 1, 1], F[..., 0, 0]
    cof[..., 0, 1], cof[..., 1, 0] = -F[..., 1, 0], -F[..., 0, 1]
    return cof
