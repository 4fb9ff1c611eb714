"""Stress and stiffness against the energy they come from, and against hand-checked cases."""

import math

import numpy as np
import pytest
from scipy import optimize

from ridgebayes import InputError
from ridgebayes.contact.cylinder.material import Material, jacobian
from tests.contact.cylinder.energy import energy_density

NU = [0.0, 0.3, 0.49]
STIFF = ((0.6, 2.0), (0.4, 9.0))
MATERIALS = [
    pytest.param((), id="neo-Hookean"),
    pytest.param((STIFF,), id="stiffening"),
    pytest.param((((0.7, 2.0), (0.3, -2.0)),), id="Mooney-Rivlin"),
]
STEP = 1e-5


def gradients(n=20, size=0.3, seed=1):
    """Deformation gradients with a positive Jacobian."""
    F = np.eye(2) + size * np.random.default_rng(seed).uniform(-1.0, 1.0, (n, 2, 2))
    assert jacobian(F).min() > 0.2
    return F


def directions():
    """The four components of F, one after the other, with their places."""
    for i in range(2):
        for j in range(2):
            one = np.zeros((2, 2))
            one[i, j] = STEP
            yield i, j, one


def pressure_of(material, F):
    """K times the change of volume, where it may change."""
    return (jacobian(F) - 1.0) / material.compressibility


@pytest.mark.parametrize("kind", MATERIALS)
@pytest.mark.parametrize("nu", NU)
def test_stress__is_the_derivative_of_the_energy(nu, kind):
    material, F = Material(nu, *kind), gradients()
    stress = material.stress(F, pressure_of(material, F))
    for i, j, dF in directions():
        slope = (energy_density(material, F + dF) - energy_density(material, F - dF)) / (2 * STEP)
        # Finite differences: STEP^2 times a third derivative, and rounding of K over STEP.
        np.testing.assert_allclose(slope, stress[:, i, j], atol=2e-8)


@pytest.mark.parametrize("size", [0.3, 0.02])
@pytest.mark.parametrize("kind", MATERIALS)
@pytest.mark.parametrize("nu", [*NU, 0.5])
def test_stiffness__is_the_derivative_of_the_stress_at_fixed_pressure(nu, kind, size):
    material, F = Material(nu, *kind), gradients(size=size)
    p = np.random.default_rng(2).uniform(-0.5, 0.5, len(F))
    stiffness = material.stiffness(F, p)
    assert stiffness.shape == (len(F), 2, 2, 2, 2)
    for k, m, dF in directions():
        slope = (material.stress(F + dF, p) - material.stress(F - dF, p)) / (2 * STEP)
        # Finite differences: STEP^2 times a third derivative.
        np.testing.assert_allclose(slope, stiffness[..., k, m], atol=1e-8)


@pytest.mark.parametrize("ogden", [STIFF, ((1.0, -3.0),), ((0.5, 1.0), (0.5, 20.0))])
@pytest.mark.parametrize("stretch", [0.7, 1.0 + 1e-9, 1.02, 1.3])
def test_stretch_without_volume__needs_ogdens_stress(ogden, stretch):
    """Plane strain, nu = 0.5, free sides: sigma_1 = sum of 2 mu c/m (l^m - l^-m)."""
    material, F = Material(0.5, ogden=ogden), np.diag([stretch, 1.0 / stretch])
    free = material.stress(F, np.array(0.0))
    p = -free[1, 1] / stretch  # cof(F)_22 = stretch
    cauchy = material.stress(F, np.array(p)) @ F.T
    expected = sum(2 / 3 * c / m * (stretch**m - stretch**-m) for c, m in ogden)
    np.testing.assert_allclose(cauchy, np.diag([expected, 0.0]), rtol=1e-12, atol=1e-13)  # rounding


@pytest.mark.parametrize("nu", NU)
def test_a_block_free_at_its_sides__is_stretched_as_ogdens_energy_says(nu):
    """The sides' stretch makes the energy least; the force is the energy's slope."""
    material, stretch = Material(nu, ogden=STIFF), 1.25

    def energy(along, across):
        return float(energy_density(material, np.diag([along, across])))

    across = optimize.minimize_scalar(
        lambda x: energy(stretch, x), bounds=(0.6, 1.2), method="bounded", options={"xatol": 1e-10}
    ).x
    F = np.diag([stretch, across])
    stress = material.stress(F, pressure_of(material, F))
    slope = (energy(stretch + STEP, across) - energy(stretch - STEP, across)) / (2 * STEP)
    # Finite differences, and where the least energy is found: the root of rounding.
    np.testing.assert_allclose(stress, np.diag([slope, 0.0]), atol=3e-7)


@pytest.mark.parametrize("nu", NU)
def test_small_uniaxial_stress__has_the_moduli_of_plane_strain(nu):
    """Free sides: stress over strain is E / (1 - nu^2), sideways strain -nu / (1 - nu)."""
    strain = 1e-6
    material = Material(nu)
    F = np.eye(2) + np.diag([strain, -nu / (1 - nu) * strain])
    stress = material.stress(F, pressure_of(material, F))
    expected = np.diag([strain / (1 - nu**2), 0.0])
    np.testing.assert_allclose(stress, expected, atol=1e-10)  # order: strain squared, times K


@pytest.mark.parametrize("nu", [-1e-9, 0.5 + 1e-9, 1.0, math.nan, math.inf])
def test_nu__outside_its_range_is_refused(nu):
    with pytest.raises(InputError, match="nu"):
        Material(nu)
