"""Stored energy of the material and of a meshed body, to check stresses and forces against."""

import numpy as np

from ridgebayes.contact.cylinder.material import jacobian


def energy_density(material, F):
    """Return the stored energy over E where the volume may change; shape (...)."""
    J = jacobian(F)
    stretches = np.linalg.svd(F, compute_uv=False) * J[..., None] ** (-1.0 / 3.0)
    shear = np.zeros_like(J)
    for share, m in material.ogden:
        powers = (stretches**m).sum(axis=-1) + J ** (-m / 3.0)
        shear += 2.0 * material.mu * share / m**2 * (powers - 3.0)
    if material.compressibility == 0.0:
        return shear
    return shear + 0.5 / material.compressibility * (J - 1.0) ** 2


def stored_energy(solid, u):
    """Return the energy over E R^2 and unit length, of displacements of the nodes."""
    return float(np.sum(solid._weight * energy_density(solid.material, solid.gradients(u))))
