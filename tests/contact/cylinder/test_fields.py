"""Files and tables of a pressed cylinder: read back, they are the state."""

import functools

import meshio
import numpy as np
import pytest

from ridgebayes import InputError
from ridgebayes.contact.cylinder.contact_problem import State
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.fields import nodal_fields, surface_table, write_fields
from ridgebayes.contact.cylinder.newton import Control, solve
from ridgebayes.contact.rigid_profile import Profile

PROFILES = {
    "sharp": Profile(0.022, 0.02),
    "rounded": Profile(0.022, 0.02, corner=0.004),
    "offset": Profile(0.022, 0.02, offset=0.2),
    "flat": None,
}
STRETCH = np.array([[1.1, 0.2], [-0.05, 0.97]])


@functools.cache
def body(name="sharp", *, nu=0.5):
    return Cylinder(PROFILES[name], p_max=0.003, nu=nu, edges=8)


@functools.cache
def raised(name="sharp", rise=4e-3):
    problem = body(name).problem
    return solve(problem, problem.unloaded(), Control("rise", rise))[0]


def stretched(cylinder, mean=0.0):
    """A state of one gradient and mean stress everywhere."""
    solid = cylinder.problem.solid
    still = cylinder.unloaded()
    p = solid.no_pressure()
    p[:, 0] = mean
    u = solid.points @ (STRETCH - np.eye(2)).T
    return State(u, p, still.pressure, still.shear, 0.0)


# ------------------------------------------------------------------------------------------ files


def test_xdmf__is_a_series_in_the_load(tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    monkeypatch.chdir(elsewhere)
    states = [raised(rise=2e-3), raised()]
    write_fields(body(), states, tmp_path / "series.xdmf")
    # Numbers are beside the file, not in the current folder, and nothing else is left.
    assert {one.name for one in tmp_path.iterdir()} == {"series.xdmf", "series.h5", "elsewhere"}
    assert not list(elsewhere.iterdir())
    with meshio.xdmf.TimeSeriesReader(tmp_path / "series.xdmf") as series:
        points, cells = series.read_points_cells()
        steps = [series.read_data(i) for i in range(series.num_steps)]
    np.testing.assert_array_equal(points[:, :2], body().problem.solid.points)
    assert [one.type for one in cells] == ["quad9"]
    np.testing.assert_array_equal(cells[0].data, body().problem.solid.nodes)
    assert [time for time, _, _ in steps] == [body().p_over_E(one) for one in states]
    for (_, found, _), state in zip(steps, states, strict=True):
        for key, values in nodal_fields(body(), state).items():
            np.testing.assert_array_equal(found[key], values)


@pytest.mark.parametrize(
    ("name", "count", "message"),
    [("a.xdmf", 0, "no state"), ("none/a.xdmf", 1, "cannot be written")],
)
def test_write_fields__says_what_it_cannot_write(name, count, message, tmp_path):
    with pytest.raises(InputError, match=message):
        write_fields(body(), [body().unloaded()] * count, tmp_path / name)
    assert not list(tmp_path.iterdir())


# ----------------------------------------------------------------------------------------- fields


@pytest.mark.parametrize("nu", [0.3, 0.5])
def test_fields__of_a_constant_gradient_are_those_of_the_material(nu):
    cylinder = body(nu=nu)
    found = nodal_fields(cylinder, stretched(cylinder, 0.17))
    mu = 0.5 / (1 + nu)
    # Cauchy stress of a neo-Hookean body: mu J^(-5/3) dev(b) + p.
    F = np.eye(3)
    F[:2, :2] = STRETCH
    J, b = np.linalg.det(F), F @ F.T
    expected = mu * J ** (-5 / 3) * (b - np.trace(b) / 3 * np.eye(3)) + 0.17 * np.eye(3)
    rounding = {"rtol": 0, "atol": 1e-11}  # of coordinates over the size of the smallest element
    stress = found["cauchy_stress"].reshape(-1, 3, 3)
    np.testing.assert_allclose(stress, np.broadcast_to(expected, stress.shape), **rounding)
    np.testing.assert_allclose(found["volume_ratio"], J, **rounding)
    np.testing.assert_allclose(found["pressure"], -0.17, **rounding)


def test_stress__below_a_contact_is_its_pressure():
    """A smooth contact: no shear there, and the normal stress is minus the segment's pressure."""
    table = surface_table(body("flat"), raised("flat"))
    fields = nodal_fields(body("flat"), raised("flat"))
    place = body("flat").problem.solid.points + raised("flat").u
    nodes = body("flat").problem.solid.mesh.rim[:, 0]
    nodes = nodes[place[nodes, 0] < 0.6 * table["x"].max()]
    assert len(nodes) > 5
    pressure = np.interp(place[nodes, 0], table["x"], table["pressure"])
    stress = fields["cauchy_stress"][nodes]
    # Fields at the edge of an element, and pressures constant on segments: per cents.
    np.testing.assert_allclose(-stress[:, 4], pressure, rtol=0.05)
    np.testing.assert_allclose(stress[:, 1], 0.0, atol=0.05 * pressure.max())


# ---------------------------------------------------------------------------------------- surface


@pytest.mark.slow
@pytest.mark.parametrize("name", PROFILES)
def test_surface_table__carries_the_load(name):
    table = surface_table(body(name), raised(name))
    carried = (table["pressure"] * table["length"] * table["normal_y"]).sum()
    if not body(name).mirrored:
        carried /= 2  # p is line load over 2 R; of a mirrored body half of it is meshed
    # The normal is that in the middle of a segment: of round ones, at this fineness, 15 degrees
    # from that at its ends, whose sine is 1.1 % less than the angle.
    load = body(name).p_over_E(raised(name))
    assert carried == pytest.approx(load, rel=1e-2 if name == "rounded" else 1e-12)
