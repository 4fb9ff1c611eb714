"""Figures of a scene: what is drawn is the solution, and all of the text can be read."""

import numpy as np
import pytest
from matplotlib.colors import to_rgba

import ridgebayes as rb
from ridgebayes.drawing.scenes import plot_counts, plot_effects

A, B = 0.02, 0.03
TEXTURES = {
    "plain": {},
    "offset": {"offset": 0.2},
    "floored": {"groove_depth_over_R": 8e-4},
    "rounded": {"corner_radius_over_R": 6e-3},
}


def effects(relative=0.005, **texture):
    texture = {"a_over_R": A, "b_over_R": B, **texture}
    (plan,) = rb.plan(rb.Scene(textures=(texture,), p_over_E=0.006, relative=relative))
    return plan.to_dataframe()


CURVES = {
    "as planned": (np.array([0.9e-3, 1.7e-3, 3.3e-3, 5.2e-3]), np.array([3.0, 4.0, 5.0, 6.0])),
    "ridges alone": (np.array([1.2e-3, 4.6e-3]), np.array([4.0, 6.0])),
}


def test_plot_counts__has_no_text_that_is_clipped_or_lies_on_other_text(faults):
    drawn = CURVES | {"all that the scene gives": CURVES["as planned"]}
    drawn["Hertz, no grooves"] = (np.array([2e-3]), np.array([4.0]))
    assert faults(plot_counts(drawn)) == ([], [])


@pytest.mark.slow
@pytest.mark.parametrize("name", TEXTURES)
def test_plot_effects__has_no_text_that_is_clipped_or_lies_on_other_text(name, faults):
    assert faults(plot_effects(effects(**TEXTURES[name]), 0.005)) == ([], [])


def test_plot_counts__steps_up_at_each_load():
    drawn = CURVES
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
