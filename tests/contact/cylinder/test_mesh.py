"""Meshes of the disk: conforming, on the circle, as fine as asked, mirror images of themselves."""

import math

import numpy as np
import pytest

from ridgebayes.contact.cylinder.mesh import disk_mesh

PARTS = [pytest.param({}, id="quarter"), pytest.param({"both_sides": True}, id="lower half")]


def even(width):
    return lambda angle: np.full_like(angle, width)


def graded(angle):
    """Fine below an edge of contact at 0.1, and coarse far from it."""
    return np.minimum(1.5e-3 + 0.3 * np.abs(np.abs(angle) - 0.1), 0.3)


def shallow(angle):
    """Coarse everywhere but near the lowest point: some columns never split, some twice."""
    return np.minimum(0.02 + 0.5 * np.abs(angle), 0.35)


SIZES = [pytest.param(even(0.1), id="even"), graded, shallow]


def facets(found):
    """Corners and middle of each element's four edges, each once; of how many elements."""
    nine = found.mesh.dofs.element_dofs
    sides = np.concatenate(
        [np.stack([nine[i], nine[(i + 1) % 4], nine[4 + i]], axis=-1) for i in range(4)]
    )
    sides[:, :2] = np.sort(sides[:, :2], axis=1)
    return np.unique(sides, axis=0, return_counts=True)


def on_circle(points):
    return np.abs(np.hypot(*points.T) - 1.0) < 1e-12  # rounding


def angle_of(points):
    return np.arctan2(points[..., 0], -points[..., 1])


def area_of(found):
    """Gauss' rule of three points each way: exact for the Jacobian of nine nodes."""
    t, w = np.polynomial.legendre.leggauss(3)
    grid = 0.5 + 0.5 * np.stack(np.meshgrid(t, t)).reshape(2, -1)
    return float((found.mesh.mapping().detDF(grid) @ np.outer(w, w).ravel()).sum()) / 4.0


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("size", SIZES)
def test_mesh__interior_edges_have_two_elements_and_the_others_lie_on_the_boundary(size, part):
    found = disk_mesh(size, **part)
    x, y = found.points.T
    sides, counts = facets(found)
    assert set(counts) == {1, 2}
    outer = sides[counts == 1]
    on_axis = (np.abs(x) < 1e-12) & ("both_sides" not in part)  # rounding
    on_middle = np.abs(y) < 1e-12  # rounding
    on_rim = on_circle(found.points)
    lies = [on[outer].all(axis=1) for on in (on_axis, on_middle, on_rim)]
    assert np.logical_or.reduce(lies).all()
    # Each straight side is covered, once: rounding of a sum of lengths.
    lengths = np.linalg.norm(found.points[outer[:, 0]] - found.points[outer[:, 1]], axis=1)
    wanted = [0.0 if "both_sides" in part else 1.0, 2.0 if "both_sides" in part else 1.0]
    assert [lengths[on].sum() for on in lies[:2]] == pytest.approx(wanted, abs=1e-13)
    rim = np.sort(found.rim[:, [0, 2]], axis=1)
    assert {*map(tuple, rim)} == {*map(tuple, outer[lies[2], :2])}
    assert len(rim) == lies[2].sum()


@pytest.mark.parametrize(("part", "area"), [({}, math.pi / 4), ({"both_sides": True}, math.pi / 2)])
def test_area__is_the_disks_to_fourth_order(part, area):
    errors = [
        area - area_of(disk_mesh(even(math.pi / 12 / n), refine=n, **part)) for n in (1, 2, 4)
    ]
    # Discretisation: a parabola through three places of an arc misses h^4/480 of its area.
    assert errors[0] / area == pytest.approx((math.pi / 12) ** 4 / 480, rel=0.02)
    ratios = np.divide(errors[:-1], errors[1:])
    # Discretisation order: 2^4, the next term h^2 smaller.
    np.testing.assert_allclose(ratios, 16.0, rtol=0.01)


@pytest.mark.parametrize("refine", [1, 3])
@pytest.mark.parametrize("size", SIZES)
def test_size__is_the_most_an_edge_is_long(size, refine):
    found = disk_mesh(size, refine=refine, both_sides=True)
    ends = angle_of(found.points[found.rim[:, [0, 2]]])
    width = np.diff(ends, axis=1)[:, 0]
    asked = size(np.linspace(*ends.T, 201)).min(axis=0)
    # The size is looked at in nine places of a column; it may fall between them by its slope of
    # at most 1/2 over a sixteenth of the width.
    assert (width <= asked * (1 + 1e-9) + 0.5 * width / 16).all()
    # It is met at both ends of its range: 6, 8, .. 16 columns times a power of 3 are all there is.
    finest = size(np.linspace(0.0, math.pi / 2, 20_001)).min()
    assert 0.75 * finest <= width.min() * (1 + 1e-9)  # rounding
    assert width.min() <= finest * (1 + 1e-9)  # rounding
