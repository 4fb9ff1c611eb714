"""The figure of coverage: dots and lines are the table, and all of its text can be read."""

import itertools

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes import Noise
from ridgebayes.drawing import PROBS
from ridgebayes.drawing.coverage import plot_coverage
from ridgebayes.drawing.style import as_bytes
from ridgebayes.model.forms import FORMS

NOISES = [noise.name for noise in Noise.every()]


def table(forms, noises, probs=PROBS, *, widest=1.0):
    rng = np.random.default_rng(1)
    rows = itertools.product(forms, noises, probs)
    frame = pd.DataFrame(rows, columns=["form", "noise", "prob"])
    share = rng.beta(20 * frame["prob"], 20 * (1 - frame["prob"]))
    width = widest * frame["prob"] * rng.uniform(0.01, 0.1, len(frame))
    return frame.assign(share=share, share_se=0.04, mean_width=width)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("forms", "noises", "widest"),
    [
        (["hybrid"], ["iid"], 1.0),
        (["hybrid", "classic"], NOISES[:3], 0.1),
        pytest.param(list(FORMS), NOISES, 1.0, marks=pytest.mark.long),
        (list(FORMS), NOISES, 300.0),
    ],
)
def test_no_text_is_clipped_or_lies_on_other_text(forms, noises, widest, faults):
    frame = table(forms, noises)
    last = frame["form"] == forms[-1]
    frame.loc[last, "mean_width"] *= widest
    figure = plot_coverage(frame)
    assert len(figure.axes) == 2 * len(forms)
    assert faults(figure) == ([], [])


def test_dots_bars_and_lines_are_the_table():
    frame = table(["hybrid", "modified"], NOISES[:4])
    hybrid, modified, below, _ = plot_coverage(frame).axes
    assert (hybrid.get_title(), modified.get_title()) == ("Hybrid", "Modified")
    own = frame[frame["form"] == "hybrid"]
    claimed = [line for line in hybrid.lines if len(set(line.get_xdata())) == 1]
    assert [line.get_xdata()[0] for line in claimed if line.get_ydata()[0] == 0][:5] == list(PROBS)
    for prob, bars in zip(PROBS, hybrid.containers, strict=True):
        rows = own[own["prob"] == prob]
        dots, _, (lines,) = bars
        np.testing.assert_array_equal(dots.get_xdata(), rows["share"])
        np.testing.assert_array_equal(np.round(dots.get_ydata()), range(4))
        ends = np.array([segment[:, 0] for segment in lines.get_segments()])
        low, high = rows["share"] - 0.08, rows["share"] + 0.08  # two standard errors
        expected = np.column_stack([np.maximum(low, 0), np.minimum(high, 1)])
        np.testing.assert_allclose(ends, expected, rtol=1e-12)  # rounding
    widths = [line for line in below.lines if line.get_marker() == "o"]
    for prob, line in zip(PROBS, widths, strict=True):
        np.testing.assert_array_equal(line.get_xdata(), own[own["prob"] == prob]["mean_width"])


def test_what_is_not_there_is_left_blank():
    frame = table(["hybrid", "modified"], NOISES[:3])
    gone = (frame["form"] == "hybrid") & (frame["noise"] == NOISES[1])
    frame.loc[gone, ["share", "share_se"]] = np.nan
    frame.loc[gone, "mean_width"] = np.inf
    frame = frame[~((frame["form"] == "hybrid") & (frame["noise"] == NOISES[2]))]
    top, _, below, _ = plot_coverage(frame).axes
    assert [len(bars[0].get_xdata()) for bars in top.containers] == [1] * len(PROBS)
    dots = [line for line in below.lines if line.get_marker() == "o"]
    assert [len(line.get_xdata()) for line in dots] == [1] * len(PROBS)


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_equal_tables_give_equal_bytes_whatever_the_user_has_set(kind):
    import matplotlib

    frame = table(["hybrid"], NOISES[:2])
    first = as_bytes(plot_coverage(frame), kind)
    with matplotlib.rc_context({"font.size": 20, "svg.hashsalt": None, "axes.grid": False}):
        assert as_bytes(plot_coverage(frame), kind) == first


def test_no_rows_are_bad_input():
    with pytest.raises(rb.InputError, match="frame: no rows; expected at least one form"):
        plot_coverage(table([], []))
