"""Figures of a scene: what is drawn is the solution, and all of the text can be read."""

import math

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_rgba

from ridgebayes.checks.plan_check import CHECK_COLUMNS
from ridgebayes.contact.contact_solution import solve_contact
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.drawing.style import as_bytes
from ridgebayes.report.figures.scenes import (
    plot_counts,
    plot_effects,
    plot_plan_check,
    plot_pressed,
)
from ridgebayes.scene.effects import plan, plan_table
from ridgebayes.scene.scene import Scene, Texture

A, B, W = 0.02, 0.03, 5.7e-3
PROFILES = {
    "plain": Profile(A, B),
    "offset": Profile(A, B, offset=0.2),
    "floored": Profile(A, B, depth=8e-4),
    "rounded": Profile(A, B, corner=6e-3),
}
TEXTURES = {
    "plain": {},
    "offset": {"offset": 0.2},
    "floored": {"groove_depth_over_R": 8e-4},
    "rounded": {"corner_radius_over_R": 6e-3},
}


def found(name):
    solution = solve_contact(PROFILES[name], W, rel_tol=1e-5)
    assert solution.status == "ok"
    return solution


def effects(relative=0.005, **texture):
    texture = Texture(a_over_R=A, b_over_R=B, **texture)
    return plan_table(plan(Scene(textures=(texture,), p_over_E=0.006, relative=relative)))


def check(**columns):
    rows = [
        (1, "ridges", 0.5, 0.5, True, 0.01),
        (1, "offset", 0.2, 0.1, True, 0.01),
        (1, "groove floor", 0.0, 0.0, False, 0.01),
        (1, "corner radius", 0.008, 0.004, False, 0.01),
        (2, "ridges", 0.2, 0.2, True, 0.1),
        (2, "offset", 3e-3, 1e-3, False, 0.1),
        (2, "groove floor", 0.7, 0.3, True, 0.1),
        (2, "corner radius", 0.02, 0.015, False, 0.1),
    ]
    names = ["scene", "effect", "estimate", "true_change", "simulated", "relative"]
    return pd.DataFrame(rows, columns=names).reindex(columns=CHECK_COLUMNS).assign(**columns)


def curves(name):
    texture = {"as planned": PROFILES[name], "ridges alone": PROFILES["plain"]}
    events = {key: reaching_loads(each, W_max=W, rel_tol=1e-5) for key, each in texture.items()}
    return {key: (each.W, each.Q.astype(float)) for key, each in events.items()}


@pytest.mark.parametrize("name", PROFILES)
def test_plot_pressed__has_no_text_that_is_clipped_or_lies_on_other_text(name, faults):
    figure = plot_pressed(found(name))
    assert len(figure.axes) == 2
    assert faults(figure) == ([], [])


@pytest.mark.parametrize("name", PROFILES)
def test_plot_counts__has_no_text_that_is_clipped_or_lies_on_other_text(name, faults):
    drawn = curves(name) | {"all that the scene gives": curves(name)["as planned"]}
    drawn["Hertz, no grooves"] = (np.array([2e-3]), np.array([4.0]))
    assert faults(plot_counts(drawn)) == ([], [])


@pytest.mark.parametrize("name", TEXTURES)
def test_plot_effects__has_no_text_that_is_clipped_or_lies_on_other_text(name, faults):
    assert faults(plot_effects(effects(**TEXTURES[name]), 0.005)) == ([], [])


@pytest.mark.parametrize("rows", [slice(0, 8), slice(0, 4), slice(2, 3)])
def test_plot_plan_check__has_no_text_that_is_clipped_or_lies_on_other_text(rows, faults):
    assert faults(plot_plan_check(check().iloc[rows])) == ([], [])


@pytest.mark.parametrize("name", PROFILES)
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
    groove = profile.ridge(0).stop + 0.5 * B
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
    solution = solve_contact(Profile(A, B, corner=6e-3, offset=offset), W, rel_tol=1e-5)
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


def test_plot_counts__steps_up_at_each_load():
    drawn = curves("offset")
    (axes,) = plot_counts(drawn).axes
    top = 1.05 * max(loads[-1] for loads, _ in drawn.values())
    for line, (loads, Q) in zip(axes.lines, drawn.values(), strict=True):
        x, y = line.get_data()
        np.testing.assert_array_equal(x, [0, *loads, top])
        np.testing.assert_array_equal(y[1:], [*Q, Q[-1]])
        assert y[0] < y[1]
        assert line.get_drawstyle() == "steps-post"
    styles = {(line.get_color(), line.get_linestyle()) for line in axes.lines}
    assert len(styles) == len(drawn)
    (legend,) = axes.figure.legends
    assert [text.get_text() for text in legend.get_texts()] == list(drawn)


def test_plot_counts__of_one_event_is_a_step_from_what_was_there():
    (axes,) = plot_counts({"one": (np.array([1e-3]), np.array([4.0]))}).axes
    np.testing.assert_array_equal(axes.lines[0].get_ydata(), [2, 4, 4])


def test_plot_effects__bars_are_the_table_and_filled_where_simulated():
    table = effects(offset=0.1, groove_depth_over_R=8e-4)
    known = table[table["estimated_rel_change"].notna()]
    (axes,) = plot_effects(table, 0.005).axes
    assert [label.get_text() for label in axes.get_yticklabels()] == known["effect"].tolist()
    sized = known[known["estimated_rel_change"] > 0]
    assert [text.get_text() for text in axes.texts] == ["0"] * (len(known) - len(sized))
    for bar, row in zip(axes.patches, sized.to_dict("records"), strict=True):
        assert bar.get_width() == max(row["estimated_rel_change"], 1e-6)
        assert (bar.get_facecolor()[3] > 0) == row["simulated"]
        assert bar.get_edgecolor() == to_rgba("#0072B2")
    assert known["simulated"].nunique() == 2
    (wanted,) = axes.lines
    assert list(wanted.get_xdata()) == [0.005, 0.005]
    assert axes.get_xlim()[1] > known["estimated_rel_change"].max()
    (axes,) = plot_effects(table, None).axes
    assert not axes.lines


def test_plot_plan_check__dots_are_the_table():
    frame = check()
    left, right = plot_plan_check(frame).axes
    markers = {"ridges": "D", "offset": "o", "groove floor": "s", "corner radius": "^"}
    least = 1e-6  # smaller ones lie on the edge
    for name, marker in markers.items():
        own = frame[frame["effect"] == name]
        for simulated in (True, False):
            rows = own[own["simulated"] == simulated]
            (line,) = [
                line
                for line in left.lines
                if line.get_marker() == marker
                and (line.get_markerfacecolor() != "none") == simulated
            ]
            np.testing.assert_array_equal(line.get_xdata(), rows["true_change"].clip(least))
            np.testing.assert_array_equal(line.get_ydata(), rows["estimate"].clip(least))
        off = own[~own["simulated"]]
        (line,) = [line for line in right.lines if line.get_marker() == marker]
        np.testing.assert_array_equal(line.get_xdata(), off["relative"])
        # Rounding.
        share = (off["true_change"] / off["relative"]).clip(least)
        np.testing.assert_allclose(line.get_ydata(), share, rtol=1e-14)
    same, ten_times = [line for line in left.lines if line.get_marker() == "None"]
    np.testing.assert_array_equal(same.get_xdata(), same.get_ydata())
    np.testing.assert_array_equal(10 * ten_times.get_xdata(), ten_times.get_ydata())


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_figures__of_the_same_input_are_the_same_bytes_whatever_the_user_has_set(kind):
    solution, table, drawn = found("floored"), effects(), curves("offset")

    def drawings():
        figures = (
            plot_pressed(solution),
            plot_effects(table, 0.005),
            plot_counts(drawn),
            plot_plan_check(check()),
        )
        return [as_bytes(figure, kind) for figure in figures]

    first = drawings()
    with matplotlib.rc_context({"font.size": 20, "svg.hashsalt": None, "axes.grid": False}):
        assert drawings() == first
