"""Gaps along rays and distances from points: their values, derivatives, and which place counts."""

import math

import numpy as np
import pytest

from ridgebayes.contact.cylinder.surface import cast, distance, kink, shapes

UP = np.array([0.0, 1.0])


def joined(nodes):
    """Edges through nodes: first, middle, last, and so on."""
    return np.stack([nodes[:-2:2], nodes[1:-1:2], nodes[2::2]], axis=1)


def circle(n_edge, start=-math.pi, stop=math.pi, *, radius=1.0, centre=(0.0, 0.0)):
    """An arc by angles from the lowest point, counter-clockwise."""
    angle = np.linspace(start, stop, 2 * n_edge + 1)
    return joined(np.array(centre) + radius * np.column_stack([np.sin(angle), -np.cos(angle)]))


def straight(*corners):
    """Straight edges from corner to corner."""
    at = np.array(corners, dtype=float)
    return np.stack([at[:-1], 0.5 * (at[:-1] + at[1:]), at[1:]], axis=1)


SQUARE = straight((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))


def dented(n_edge=20, seed=1):
    """The lower part of a circle, each node moved by a part of an edge: kinks at every end."""
    angle = np.linspace(-1.2, 1.2, 2 * n_edge + 1)
    nodes = np.column_stack([np.sin(angle), -np.cos(angle)])
    return joined(nodes + 0.01 * np.random.default_rng(seed).uniform(-1.0, 1.0, nodes.shape))


def rays(x, y, normal=UP, behind=0.5):
    x, y = np.broadcast_arrays(np.atleast_1d(x), y)
    point = np.column_stack([x, y]).astype(float)
    normal = np.asarray(normal, dtype=float)
    normal = np.broadcast_to(normal / np.hypot(*normal.T)[..., None], point.shape).copy()
    return point, normal, {"behind": np.full(len(point), behind), "ahead": 0.5}


# ------------------------------------------------------------------------------------------ cast


def test_cast__of_vertical_rays_measures_up_to_the_circle():
    x = np.linspace(-0.8, 0.8, 33)
    off = []
    for n_edge in (24, 48, 96):
        point, normal, reach = rays(x, -1.01)
        hits = cast(circle(n_edge), point, normal, **reach)
        np.testing.assert_array_equal(hits.ray, np.arange(33))
        off.append(np.abs(hits.gap - (1.01 - np.sqrt(1.0 - x**2))).max())
        rim = circle(n_edge)
        at = np.einsum("nk,nki->ni", shapes(hits.s), rim[hits.edge])
        # Rounding: where it says it meets the rim, it does.
        np.testing.assert_allclose(at, point + hits.gap[:, None] * normal, atol=1e-14)
    # Discretisation order: parabolas leave the circle by h^4/500 or so, a sixteenth in each step;
    # where on its edge each ray falls, varies.
    assert off[0] < 1.5e-5
    np.testing.assert_allclose(np.divide(off[:-1], off[1:]), 16.0, rtol=0.25)


def test_cast__counts_entries_and_no_exits():
    """A ray that starts in the body and leaves it within reach meets nothing."""
    point, normal, reach = rays([0.05, 0.3], 0.8)
    assert len(cast(circle(64), point, normal, **reach).ray) == 0
    backwards = cast(circle(64), point, -normal, **reach)
    assert len(backwards.ray) == 2
    assert (backwards.gap < 0).all()


def test_cast__meets_an_edge_that_bulges_past_its_nodes():
    """x(s) = 2.6 s - 1.6 s^2 reaches 1.05625, beyond all three nodes; after that it is an exit."""
    edge = np.array([[[0.0, -1.0], [0.9, -1.1], [1.0, -1.0]]])
    point, normal, reach = rays([1.03, 1.05624, 1.05626], -1.3)
    hits = cast(edge, point, normal, **reach)
    np.testing.assert_array_equal(hits.ray, [0, 1])
    assert hits.s[0] == pytest.approx((2.6 - math.sqrt(2.6**2 - 6.4 * 1.03)) / 3.2)
    assert (hits.s < 0.8125).all()


# ------------------------------------------------------------------------------------------ kink


# -------------------------------------------------------------------------------------- distance


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ((0.3, -1.2), 0.2),
        ((0.3, -0.9), -0.1),
        ((-1.4, 0.1), 0.4),
        ((1.3, -1.4), 0.5),  # a corner: 3, 4, 5
        ((0.0, 0.25), -0.75),
        ((0.2, 1.0), 0.0),
    ],
)
def test_distance__from_a_square_is_exact(point, expected):
    found, _, gradient = distance(SQUARE, np.array(point))
    assert found == pytest.approx(expected, abs=1e-15)  # rounding
    # The distance falls as the edge comes nearer: minus the unit outward direction.
    assert np.hypot(*gradient.sum(axis=0)) == pytest.approx(1.0, abs=1e-15)  # rounding


def some_points():
    rng = np.random.default_rng(11)
    angle = rng.uniform(-1.0, 1.0, 40)
    return rng.uniform(0.8, 1.2, 40)[:, None] * np.column_stack([np.sin(angle), -np.cos(angle)])


def test_distance__is_to_the_nearest_of_all_places():
    rim = dented()
    s = np.linspace(0.0, 1.0, 2001)
    places = np.einsum("sk,eki->esi", shapes(s), rim)
    for point in some_points():
        apart = np.linalg.norm(places - point, axis=-1)
        found, edge, _ = distance(rim, point)
        # Discretisation of the search: half a step of 6e-5, squared, over twice the distance.
        assert abs(found) == pytest.approx(apart.min(), abs=1e-6)
        assert apart[edge].min() == pytest.approx(apart.min(), abs=1e-6)
        assert (found < 0) == (np.hypot(*point) < 1.0) or abs(found) < 0.03


@pytest.mark.parametrize("lean", [0.05, 1e-9, 0.0, -1e-9, -0.05])
def test_kink__keeps_its_sign_where_an_edge_turns_past_the_normal(lean):
    """A rim that folds down over a corner: as it passes the vertical its slope has no limit."""
    rim = straight((0.0, 0.0), (1.0, 0.0), (1.0 + lean, -1.0))
    (found,) = kink(rim, np.array([0]), np.array([[1.0, 0.0]]), UP[None])
    expected = -1.0 / lean if lean > 1e-4 else -1e4  # the steepest slope
    assert found == pytest.approx(expected, rel=1e-9)  # rounding over the lean
