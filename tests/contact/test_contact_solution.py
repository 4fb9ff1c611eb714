"""Which lands are in contact and how hard, against closed forms, a grid, and the inequalities."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st
from scipy import linalg

from ridgebayes.contact import hertz
from ridgebayes.contact.contact_solution import load_factor, solve_contact, solve_many_contacts
from ridgebayes.contact.rigid_profile import Profile

A, B = 0.012, 0.03
SHAPES = [
    {},
    {"offset": 0.3},
    {"offset": 0.5},
    {"corner": 2e-3},
    {"depth": 3e-4},
    {"corner": 1e-3, "depth": 5e-4, "offset": 0.2},
]


def press_on(W, *, scale=1.0, start=None, **shape):
    long = {key: value for key, value in shape.items() if key in ("offset", "corner")}
    if "depth" in shape:
        long["depth"] = shape["depth"] * scale**2
    profile = Profile(scale * A, scale * B, **long)
    return solve_contact(profile, scale**2 * W, start=None if start is None else start.covered)


def on_a_grid(profile, W, n):
    """Constant pressures on n cells, active set: approach, and the force on each land by start."""
    reach = 1.15 * math.sqrt(2 * W) + 0.5 * profile.pitch
    dx = 2 * reach / n
    x = -reach + dx * (np.arange(n) + 0.5)
    height = np.full(n, profile.depth)
    n_ridge = math.ceil(reach / profile.pitch) + 2
    segments = [profile.ridge(number) for number in range(-n_ridge, n_ridge + 1)]
    for land in segments:
        on = (x > land.start) & (x < land.stop)
        height[on] = land.height(x[on])
    distance = dx * np.arange(n)

    def integral(t):
        return t * np.log(np.maximum(np.abs(t), 1e-300)) - t

    matrix = linalg.toeplitz(integral(distance - dx / 2) - integral(distance + dx / 2))
    usable = np.isfinite(height)
    active = usable & (np.abs(x) < 1.1 * math.sqrt(2 * W) + 0.5 * profile.b)
    for _ in range(200):
        at = np.flatnonzero(active)
        equations = np.zeros((len(at) + 1, len(at) + 1))
        equations[:-1, :-1] = matrix[np.ix_(at, at)]
        equations[:-1, -1], equations[-1, :-1] = -1.0, dx
        solved = np.linalg.solve(equations, np.append(-0.5 * x[at] ** 2 - height[at], W))
        q, approach = solved[:-1], solved[-1]
        gap = 0.5 * x**2 + np.where(usable, height, 0.0) - approach + matrix[:, at] @ q
        added = usable & ~active & (gap < 0)
        active[at[q < 0]] = False
        active |= added
        if not (q < 0).any() and not added.any():
            break
    else:
        raise AssertionError("the grid's active set did not settle")
    whole = np.zeros(n)
    whole[at] = q
    floors = [profile.floor_after(number) for number in range(-n_ridge, n_ridge)]
    forces = {
        land.start: whole[(x > land.start) & (x < land.stop)].sum() * dx
        for land in segments + floors
    }
    return approach, forces


def surface_above(found, x):
    """Height of the body's surface above the ridges' tops, of a kink's first 500 orders."""
    intervals, solved = found.pressing.intervals, found.pressing.coefficients
    series = -np.arange(500) / math.pi * found.pressing.kinks.series(500)
    series[:, : solved.shape[1]] = solved
    total = 0.5 * x**2 - found.approach
    for i, (centre, w) in enumerate(zip(intervals.centre, intervals.half_width, strict=True)):
        twice = intervals.mirrored and not (intervals.straddles and i == 0)
        for way in (1.0, -1.0) if twice else (1.0,):
            s = (way * x - centre) / w
            tau = np.arccosh(np.maximum(np.abs(s), 1.0))
            theta = np.arccos(np.clip(s, -1.0, 1.0))
            n = np.arange(1, series.shape[1])
            powers = np.exp(-n * tau[:, None]) * np.cos(n * theta[:, None]) / n
            total += math.pi * series[i, 0] * (math.log(2 / w) - tau)
            total += math.pi * powers @ series[i, 1:]
    return total


def worst_penetration(found):
    """Deepest penetration of any land where it is not in contact, sampled finely."""
    profile, pressing = found.profile, found.pressing
    ends = {
        land.start: (low, high)
        for land, low, high in zip(
            found.segments, pressing.intervals.left, pressing.intervals.right, strict=True
        )
    }
    clustered = 0.5 * (1 - np.cos(np.linspace(0, math.pi, 61)))
    deepest = 0.0
    for land in profile.segments(1.3 * math.sqrt(2 * found.W) + profile.pitch):
        low, high = ends.get(land.start, (land.stop, land.stop))
        x = np.concatenate(
            (land.start + (low - land.start) * clustered, high + (land.stop - high) * clustered)
        )
        x = x[((x < low) | (x > high)) & (x >= land.start) & (x <= land.stop)]
        if len(x):
            deepest = max(deepest, float(-(surface_above(found, x) + land.height(x)).min()))
    return deepest


def smallest_strength(found):
    """Smallest q sqrt(1 - s^2) over the mean of its interval; ends that a kink is near left out."""
    pressure = found.pressing.pressure(np.cos(np.linspace(0.02, math.pi - 0.02, 301)))
    mean = found.pressing.coefficients[:, 0] / found.pressing.intervals.half_width
    loaded = found.pressing.forces > 1e-5 * found.W
    return float((pressure.min(axis=1) / mean)[loaded].min())


@pytest.mark.parametrize("W", [1e-10, 1e-6, 1e-3, 0.1])
def test_pressed__over_a_wide_ridge_is_hertz(W):
    found = solve_contact(Profile(3.0, 1.0, offset=0.5), W)
    w = math.sqrt(2 * W)
    assert (found.status, found.Q, found.contact_fraction) == ("ok", 1, 1.0)
    # Tolerance: ends are asked for to 1e-8 of the width, and Newton's last step squares.
    np.testing.assert_allclose(found.pressing.intervals.right, w, rtol=1e-9)
    assert found.approach == pytest.approx(0.25 * w**2 + W * math.log(2 / w), rel=1e-12)
    s = np.linspace(-1, 1, 5)
    expected = w * (1 - s**2) / math.pi
    np.testing.assert_allclose(found.pressing.pressure(s)[0], expected, atol=1e-9 * w)


def test_pressed__a_narrow_ridge_alone_is_the_flat_punch_under_a_parabola():
    W, w = 1e-3, 0.5 * A
    found = solve_contact(Profile(A, B, offset=0.5), W, ridges=range(1))
    assert found.status == "ok"
    assert found.approach == pytest.approx(0.25 * w**2 + W * math.log(2 / w), rel=1e-12)  # rounding
    expected = (W - 0.5 * w**2) / math.pi
    np.testing.assert_allclose(found.pressing.singular, expected, rtol=1e-12)  # rounding


@pytest.mark.parametrize("W", [1e-8, 1e-5, 1e-4, 3e-4])
def test_pressed__two_ridges_are_covered_as_far_as_their_closed_form_says(W):
    """In t = x^2 two mirrored ridges are one punch: W = (beta^2 - alpha^2)/2 at a free end."""
    found = solve_contact(Profile(A, B), W, ridges=range(-1, 1))
    alpha = 0.5 * B
    beta = min(math.sqrt(alpha**2 + 2 * W), alpha + A)
    middle, half = 0.5 * (beta**2 + alpha**2), 0.5 * (beta**2 - alpha**2)
    assert (found.status, found.Q) == ("ok", 2)
    # Tolerance: ends to 1e-8 of the contact's width, which is W/alpha of them.
    np.testing.assert_allclose(found.pressing.intervals.right - alpha, beta - alpha, rtol=2e-8)
    assert found.approach == pytest.approx(0.5 * middle + 0.5 * W * math.log(2 / half), rel=1e-9)
    assert found.contact_fraction == pytest.approx((beta - alpha) / beta, rel=2e-8)
    # The groove's middle is at t = 0.
    tau = math.acosh(middle / half)
    assert found.penetrations[-1] == pytest.approx(
        0.5 * (half * math.sinh(tau) + W * tau), rel=1e-8
    )


@pytest.mark.parametrize("share", [0.98, 0.7, 0.3, 0.05])
@pytest.mark.parametrize("W", [1e-7, 1e-5])
def test_pressed__a_rounded_ridge_has_the_closed_load_of_its_width(share, W):
    """W = int x f'(x) / (pi sqrt(w^2 - x^2)) dx of x^2/2 + (|x| - c)^2/(2r), both ends free."""
    r = share * 0.5 * A
    c = 0.5 * A - r
    found = solve_contact(Profile(A, B, corner=r, offset=0.5), W, ridges=range(1))
    w = float(found.pressing.intervals.right[0])
    load = 0.5 * w**2
    if w > c:
        angle = math.asin(c / w)
        load += (w**2 * (0.5 * math.pi - angle) - c * w * math.cos(angle)) / (math.pi * r)
    assert found.status == "ok"
    # Discretisation: of a kink's series near the end.
    assert load == pytest.approx(W, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_pressed__is_what_a_grid_converges_to(shape):
    profile, W = Profile(A, B, **shape), 5e-3
    found = solve_contact(profile, W, rel_tol=1e-6)
    assert found.status == "ok"
    errors = []
    for n in (500, 1500):
        approach, forces = on_a_grid(profile, W, n)
        misses = [
            forces[land.start] - force
            for land, force in zip(found.segments, found.pressing.forces, strict=True)
        ]
        errors.append((abs(approach - found.approach), np.abs(misses).max()))
    # Discretisation: first order in the cell, which scatters as corners fall within cells.
    assert errors[0][0] < 4e-4
    assert errors[0][1] < 0.06 * W
    assert errors[1][0] < 0.6 * errors[0][0] or errors[1][0] < 3e-5
    assert errors[1][1] < 0.025 * W


@pytest.mark.slow
@pytest.mark.parametrize("shape", [{}, {"corner": 1e-3, "depth": 5e-4}])
@pytest.mark.parametrize("offset", [0.1, 0.37, 0.5])
def test_pressed__the_mirrored_offset_is_the_mirror_image(shape, offset):
    right, left = (press_on(5e-3, offset=way * offset, **shape) for way in (1.0, -1.0))
    assert right.status == left.status == "ok"
    assert right.Q == left.Q
    # Tolerance: of the ends, 1e-8.
    assert right.approach == pytest.approx(left.approach, rel=1e-8)
    assert right.contact_fraction == pytest.approx(left.contact_fraction, rel=1e-7)
    if offset < 0.5:
        np.testing.assert_allclose(right.pressing.forces, left.pressing.forces[::-1], rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_pressed__contact_only_grows_with_the_load(shape):
    """Exact: the charge that a load adds to a fixed set is positive everywhere."""
    found = solve_many_contacts(Profile(A, B, **shape), np.geomspace(1e-5, 1e-2, 16), rel_tol=1e-6)
    assert {one.status for one in found} == {"ok"}
    assert np.all(np.diff([one.Q for one in found]) >= 0)
    assert np.all(np.diff([one.approach for one in found]) > 0)
    for less, more in itertools.pairwise(found):
        held = dict(zip(more.segments, more.pressing.forces, strict=True))
        ends = dict(
            zip(
                more.segments,
                zip(more.pressing.intervals.left, more.pressing.intervals.right, strict=True),
                strict=True,
            )
        )
        for land, force, low, high in zip(
            less.segments,
            less.pressing.forces,
            less.pressing.intervals.left,
            less.pressing.intervals.right,
            strict=True,
        ):
            assert held[land] > force
            # Tolerance: of the ends.
            assert ends[land][0] <= low + 1e-5 * (high - low)
            assert ends[land][1] >= high - 1e-5 * (high - low)


def test_pressed__too_many_unknowns_are_said():
    found = solve_contact(Profile(1e-3, 1e-6), 0.1)
    assert found.status.startswith("not computed: ")
    assert "cap 4000" in found.status


def test_penetration__is_the_depth_at_which_the_floor_begins_to_touch():
    bare = solve_contact(Profile(A, B), 1e-3)
    depth = bare.penetrations[-1]
    for factor, touches in ((1.0001, False), (0.9999, True)):
        found = solve_contact(Profile(A, B, depth=factor * depth), 1e-3)
        assert any(land.ridge is None for land in found.segments) == touches


def profile_of(pitch, share, offset, depth, corner):
    a = share * pitch
    depth = math.inf if depth is None else depth * pitch**2
    return Profile(
        a,
        pitch - a,
        depth=depth,
        corner=0.0 if corner is None else min(corner * a, 2 * depth),
        offset=offset,
    )


@pytest.mark.slow
@settings(max_examples=40)
@given(
    pitch=st.floats(0.01, 0.2),
    share=st.floats(0.05, 0.9),
    offset=st.sampled_from([0.0, 0.5]) | st.floats(-0.5, 0.5),
    depth=st.none() | st.floats(0.02, 2.0),
    corner=st.none() | st.floats(1e-3, 0.49),
    log_W=st.floats(math.log(1e-7), math.log(2e-2)),
)
def test_pressed__ok_is_no_penetration_no_tension_and_balance(
    pitch, share, offset, depth, corner, log_W
):
    profile = profile_of(pitch, share, offset, depth, corner)
    W, rel_tol = math.exp(log_W), 1e-6
    found = solve_contact(profile, W, rel_tol=rel_tol)
    event(found.status.split(":")[0])
    if found.status != "ok":
        return
    assert found.pressing.load == pytest.approx(W, rel=1e-10)  # rounding
    # Tolerance: of the ends; strengths err by the root of it.
    assert smallest_strength(found) > -1e-3
    assert worst_penetration(found) < max(20 * rel_tol * W, 1e-14)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
def test_load_factor__makes_the_loads_whose_hertzian_contact_is_as_wide(nu):
    # Here a smooth contact has the half-width root of 2 W, Hertz's is c times the root of p/E.
    p_over_E = np.geomspace(1e-6, 0.02, 5)
    wide = np.sqrt(2 * load_factor(nu) * p_over_E)
    np.testing.assert_allclose(wide, hertz.half_width(p_over_E, nu=nu), rtol=1e-14)  # algebra


@pytest.mark.parametrize(
    ("offset", "W", "Q"),
    [(3e-4, 2.557289883236868e-07, 2), (0.0938936392394375, 0.08736109751880411, 8)],
)
def test_pressed__a_round_corner_is_found_where_contact_begins_and_ends_at_its_kink(offset, W, Q):
    """On both corners at nearly no load; with an end 1e-8 of a ridge beyond the flat."""
    profile = Profile(0.0625, 0.05, corner=0.00625, offset=offset)
    found = solve_contact(profile, W, start=solve_contact(profile, 0.99 * W).covered)
    assert (found.status, found.Q) == ("ok", Q)
    assert worst_penetration(found) < 1e-9 * W + 1e-14  # tolerance
