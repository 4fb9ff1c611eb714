"""Figures of the cylinder: what is drawn is the state, and all of the text can be read."""

import functools
import math

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection, TriMesh

import ridgebayes as rb
from ridgebayes.contact.contact_solution import solve_contact
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.newton import Control, solve
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.report.figures.bodies import plot_deformed, plot_pressed

A, B, RISE = 0.022, 0.02, 4e-3
PROFILES = {
    "sharp": Profile(A, B),
    "rounded": Profile(A, B, corner=0.004),
    "offset": Profile(A, B, offset=0.2),
    "floored": Profile(A, 0.03, depth=8e-4),
    "flat": None,
}
WIDE, W = 0.03, 5.7e-3  # grooves and load of the half-plane solutions
SOLVED = {
    "plain": Profile(0.02, WIDE),
    "offset": Profile(0.02, WIDE, offset=0.2),
    "floored": Profile(0.02, WIDE, depth=8e-4),
    "rounded": Profile(0.02, WIDE, corner=6e-3),
}


@functools.cache
def pressed(name):
    cylinder = Cylinder(PROFILES[name], p_max=0.003, edges=8)
    return cylinder, solve(cylinder.problem, cylinder.unloaded(), Control("rise", RISE))[0]


def drawn(axes, kind):
    return [one for one in axes.collections if type(one) is kind]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[] if name in {"offset", "flat"} else [pytest.mark.long])
        for name in PROFILES
    ],
)
def test_plot_deformed__has_no_text_that_is_clipped_or_lies_on_other_text(name, faults):
    figure = plot_deformed(*pressed(name))
    assert len(figure.axes) == 5
    assert faults(figure) == ([], [])


@pytest.mark.parametrize("name", PROFILES)
def test_plot_deformed__draws_the_deformed_body_on_both_sides(name):
    cylinder, state = pressed(name)
    whole, near, _, *_ = plot_deformed(cylinder, state).axes
    points = cylinder.problem.solid.points + state.u
    for axes in (whole, near):
        assert axes.get_aspect() == 1.0
        (coloured,) = drawn(axes, TriMesh)
        x, y = coloured._triangulation.x, coloured._triangulation.y
        n = len(points)
        np.testing.assert_array_equal(np.column_stack([x, y])[:n], points)
        assert x.min() == pytest.approx(-x.max(), rel=1e-2)  # exact where mirrored
        # Triangles cover the body once: half a disk that keeps its volume, but for chords.
        corners = np.stack([x, y], axis=-1)[coloured._triangulation.triangles]
        (a, b), (c, d) = (corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0)
        areas = 0.5 * np.abs(a * d - b * c)
        assert areas.sum() == pytest.approx(np.pi / 2, rel=2e-3)
        (edges,) = drawn(axes, LineCollection)
        assert {len(one) for one in edges.get_segments()} == {5}
    left, right = whole.get_xlim()
    bottom, top = whole.get_ylim()
    assert left < x.min() < x.max() < right
    assert bottom < y.min() < y.max() < top


@pytest.mark.parametrize("name", PROFILES)
def test_plot_deformed__draws_pressures_that_carry_the_load(name):
    cylinder, state = pressed(name)
    _, near, below, *_ = plot_deformed(cylinder, state).axes
    assert below.get_xlim() == near.get_xlim()
    (bars,) = drawn(below, PolyCollection)
    sizes = np.array([np.ptp(one.vertices, axis=0) for one in bars.get_paths()])
    # P' = 2 R p. Bars are as wide as a round segment's tangent in its middle: 15 degrees, at this
    # fineness, from that at its ends, whose sine is 1.1 % less than the angle.
    load = 2 * cylinder.p_over_E(state)
    assert sizes.prod(axis=1).sum() == pytest.approx(load, rel=1e-2 if name == "rounded" else 1e-12)
    ends = np.concatenate([one.vertices[:, 0] for one in bars.get_paths()])
    low, high = below.get_xlim()
    assert low < ends.min() < ends.max() < high


def test_plot_deformed__says_what_it_cannot_draw():
    cylinder, _ = pressed("sharp")
    with pytest.raises(rb.InputError, match="touches nothing"):
        plot_deformed(cylinder, cylinder.unloaded())


def found(name):
    solution = solve_contact(SOLVED[name], W, rel_tol=1e-5)
    assert solution.status == "ok"
    return solution


@pytest.mark.parametrize("name", SOLVED)
def test_plot_pressed__has_no_text_that_is_clipped_or_lies_on_other_text(name, faults):
    figure = plot_pressed(found(name))
    assert len(figure.axes) == 2
    assert faults(figure) == ([], [])


@pytest.mark.parametrize("name", SOLVED)
def test_plot_pressed__draws_the_surface_of_the_solution_on_the_ridges(name):
    solution = found(name)
    top, _ = plot_pressed(solution).axes
    body, rigid = top.lines
    x, y = body.get_data()
    at = np.abs(x) if solution.profile.mirrored else x
    np.testing.assert_array_equal(y, solution.pressing.surface(at))
    # The body lies on the ridges, and nowhere below them: within the solution's tolerance.
    step = x[1] - x[0]
    profile = solution.profile
    edges = np.array([[r.start, r.stop] for r in map(profile.ridge, range(-9, 9))]).ravel()
    near = np.abs(x[:, None] - edges).min(axis=1) < 2 * step  # drawn slanting
    assert (y - rigid.get_ydata())[~near].min() > -1e-3 * -y.min()
    # Steps of the drawn ridges are where the ridges are: a step of the grid.
    heights = rigid.get_ydata()
    assert heights.max() == 0.0
    for land in map(profile.ridge, range(-1, 1)):
        middle = 0.5 * (land.start + land.stop)
        assert heights[np.abs(x - middle).argmin()] == 0.0
    groove = profile.ridge(0).stop + 0.5 * WIDE
    assert heights[np.abs(x - groove).argmin()] == heights.min()
    if math.isfinite(profile.depth):
        assert heights.min() == -profile.depth
        assert y.min() == pytest.approx(-profile.depth, rel=1e-3)  # tolerance of the solution
    # All that touches is in sight.
    low, high = top.get_ylim()
    assert low < min(heights.min(), y.min())
    assert high > 0
    assert x.max() > solution.pressing.intervals.right.max()


@pytest.mark.parametrize("offset", [0.2, -0.3])
def test_plot_pressed__draws_pressures_that_carry_the_load(offset):
    solution = solve_contact(Profile(0.02, WIDE, corner=6e-3, offset=offset), W, rel_tol=1e-5)
    _, below = plot_pressed(solution).axes
    assert len(below.lines) == solution.Q
    carried = 0.0
    for line in below.lines:
        x, y = line.get_data()
        assert y.min() >= 0
        carried += abs(np.trapezoid(y, x))
    # W = 4 (1 - nu^2)/pi p/E and P' = 2 R p. Of 200 points, and a sliver at each end left out.
    assert carried == pytest.approx(0.5 * math.pi * W, rel=2e-3)


def test_plot_pressed__shows_a_mirrored_body_on_both_sides():
    _, below = plot_pressed(found("plain")).axes
    ends = sorted((line.get_xdata().min(), line.get_xdata().max()) for line in below.lines)
    # Rounding.
    np.testing.assert_allclose(ends, [(-b, -a) for a, b in reversed(ends)], atol=1e-15)
    assert len(ends) == found("plain").Q
