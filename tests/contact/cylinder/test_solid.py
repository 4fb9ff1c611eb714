"""Forces and stiffness of the meshed body: patch tests, derivatives, orders of convergence."""

import functools
import math

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from skfem import Basis, ElementQuad2, LinearForm

from ridgebayes.contact.cylinder.material import Material
from ridgebayes.contact.cylinder.mesh import disk_mesh
from ridgebayes.contact.cylinder.solid import InvertedError, Solid

STRETCH = np.array([[1.15, 0.2], [-0.1, 0.95]])
STEP = 1e-6


@functools.cache
def graded():
    """Distorted elements: splitting columns, bent edges, a factor of 20 in size."""
    return disk_mesh(lambda angle: np.minimum(0.02 + 0.4 * angle, 0.3))


def solid(nu=0.3):
    return Solid(graded(), Material(nu))


def volume_residual(body, u, p):
    return body._volume(body.gradients(u), body.pressures(p))


def inner_nodes(mesh):
    """Nodes on no edge that belongs to one element alone."""
    nine = mesh.mesh.dofs.element_dofs
    sides = np.concatenate(
        [np.stack([nine[i], nine[(i + 1) % 4], nine[4 + i]], axis=-1) for i in range(4)]
    )
    sides[:, :2] = np.sort(sides[:, :2], axis=1)
    found, counts = np.unique(sides, axis=0, return_counts=True)
    return np.setdiff1d(np.arange(len(mesh.points)), found[counts == 1])


def waves(points, size=0.05):
    """A smooth displacement of no symmetry, far from turning anything inside out."""
    x, y = points.T
    return size * np.stack([np.sin(2 * x + y) + y**2, np.cos(x - 3 * y)], axis=-1)


def some_state(body):
    """Displacements and pressures without any smoothness from element to element."""
    rng = np.random.default_rng(3)
    p = rng.uniform(-0.2, 0.2, (body.n_element, 3))
    return waves(body.points), p


def some_directions(body):
    rng = np.random.default_rng(4)
    x, y = body.points.T
    smooth = np.stack([np.cos(3 * y) + x, np.sin(2 * x * y)], axis=-1)
    # At the scale of an element, lest its gradient be larger than one.
    rough = 0.005 * rng.uniform(-1.0, 1.0, body.points.shape)
    return smooth + rough, rng.uniform(-1.0, 1.0, (body.n_element, 3))


def slope(function, step=STEP):
    return (function(step) - function(-step)) / (2 * step)


# ----------------------------------------------------------------------------------------- patch


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
def test_patch__of_constant_stress_has_no_force_inside(nu):
    body = solid(nu)
    u, p = body.points @ (STRETCH - np.eye(2)).T, body.no_pressure()
    p[:, 0] = 0.17
    force = body.force(u, p)
    # Rounding: forces of elements are of order 0.1 at most.
    np.testing.assert_allclose(force[inner_nodes(body.mesh)], 0.0, atol=1e-14)
    assert np.abs(force).max() > 1e-3
    stress = body.material.stress(STRETCH, np.array(0.17))
    # The virtual work of a constant gradient is the stress times the area.
    area = body._weight.sum()
    np.testing.assert_allclose(force.T @ body.points, area * stress, atol=1e-14)  # rounding


# ----------------------------------------------------------------------------------------- energy


# --------------------------------------------------------------------------------- linearisation


def test_linear_step__is_the_derivative_at_finite_strain():
    body = solid(0.3)
    u, p = some_state(body)
    du, _ = some_directions(body)
    found = body.assemble(u, p)
    dp = found.pressure_step(du, body.dofs)
    force = slope(lambda t: body.force(u + t * du, p + t * dp))
    volume = slope(lambda t: volume_residual(body, u + t * du, p + t * dp))
    expected = found.condensed + (found.stiffness @ du.ravel()).reshape(-1, 2)
    np.testing.assert_allclose(force, expected, atol=5e-9)  # finite differences
    np.testing.assert_allclose(volume, -found.volume, atol=1e-10)  # finite differences


def test_assemble__refuses_elements_turned_inside_out():
    body = solid()
    p = body.no_pressure()
    whole = body.points * [-2.0, 0.0]
    with pytest.raises(InvertedError):
        body.assemble(whole, p)
    one = np.zeros_like(body.points)
    nodes = body.nodes[7]
    one[nodes[8]] = 0.8 * (body.points[nodes[0]] - body.points[nodes[8]])
    with pytest.raises(InvertedError):
        body.assemble(one, p)
    with pytest.raises(InvertedError):
        body.assemble(np.full_like(body.points, np.nan), p)


# ----------------------------------------------------------------------------------- convergence


def compressible(x, y):
    """A displacement, its pressure and the load per volume that goes with them, nu = 0.3."""
    mu, K = 0.5 / 1.3, 1.0 / 1.2
    a, b = 2 * x + y, x - 2 * y
    u = np.sin(a), np.cos(b)
    volume = 2 * np.cos(a) + 2 * np.sin(b)
    slopes = -4 * np.sin(a) + 2 * np.cos(b), -2 * np.sin(a) - 4 * np.cos(b)
    # div(2 mu dev e) = mu lap u + mu/3 grad div u in plane strain; lap u = -5 u.
    load = [5 * mu * u[i] - (mu / 3 + K) * slopes[i] for i in range(2)]
    return u, K * volume, load


def incompressible(x, y):
    """A displacement without divergence, of the stream function sin 2x cos 3y, at nu = 0.5."""
    mu = 1.0 / 3.0
    u = -3 * np.sin(2 * x) * np.sin(3 * y), -2 * np.cos(2 * x) * np.cos(3 * y)
    p = np.cos(x + 2 * y)
    down = -np.sin(x + 2 * y)
    return u, p, [13 * mu * u[i] - (i + 1) * down for i in range(2)]  # lap u = -13 u


SIZE = 1e-6  # of displacements: so small that the body is linear, to as much of them


def solved(exact, nu, n):
    """Longest edge, errors of displacements and of pressures: a quarter held all around."""
    mesh = disk_mesh(lambda angle: np.full_like(angle, math.pi / 12 / n), refine=n)
    body = Solid(mesh, Material(nu))
    basis = Basis(mesh.mesh, ElementQuad2(), intorder=8)
    loads = [
        SIZE * LinearForm(lambda v, w, i=i: exact(*w.x)[2][i] * v).assemble(basis) for i in range(2)
    ]
    inner = inner_nodes(mesh)
    u, p = SIZE * np.stack(exact(*body.points.T)[0], axis=-1), body.no_pressure()
    u[inner] = 0.0
    free = np.stack([2 * inner, 2 * inner + 1], axis=-1).ravel()
    for _ in range(4):
        found = body.assemble(u, p)
        rest = np.stack(loads, axis=-1) - found.force - found.condensed
        du = np.zeros(2 * body.n_node)
        du[free] = spsolve(found.stiffness[free][:, free], rest.ravel()[free])
        p = p + found.pressure_step(du, body.dofs)
        u = u + du.reshape(-1, 2)
    left = np.stack(loads, axis=-1) - body.force(u, p)
    assert np.abs(left[inner]).max() < 1e-10 * SIZE  # rounding
    u, p = u / SIZE, p / SIZE
    wanted = exact(*basis.global_coordinates())[0]
    apart = sum((basis.interpolate(u[:, i]) - wanted[i]) ** 2 for i in range(2))
    at = Basis(mesh.mesh, ElementQuad2(), intorder=5).global_coordinates()
    off = body.pressures(p) - exact(*at)[1]
    if nu == 0.5:  # known but for a constant, of a body held all around
        off -= np.average(off, weights=body._weight)
    at = mesh.points[mesh.mesh.t]
    longest = np.linalg.norm(at - np.roll(at, 1, axis=0), axis=-1).max()
    squares = (basis.dx * apart).sum(), (body._weight * off**2).sum()
    return longest, *np.sqrt(squares)


@pytest.mark.slow
@pytest.mark.parametrize(("exact", "nu"), [(compressible, 0.3), (incompressible, 0.5)])
def test_solution__converges_with_the_third_power_of_the_edges_and_pressure_with_the_second(
    exact, nu
):
    longest, *errors = np.array([solved(exact, nu, n) for n in (2, 4, 8)]).T
    orders = np.diff(np.log(errors)) / np.diff(np.log(longest))
    # Discretisation order: 3 for quadratic displacements, 2 for linear pressures.
    np.testing.assert_allclose(orders[0], 3.0, atol=0.2)
    np.testing.assert_allclose(orders[1], 2.0, atol=0.3)
    assert errors[0][-1] < 5e-5
    assert errors[1][-1] < 1e-3
