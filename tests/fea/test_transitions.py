"""Loads of corners from gaps whose zeros are known."""

import numpy as np
import pandas as pd
import pytest

from ridgebayes import InputError
from ridgebayes.fea.transitions import transitions_of

LOAD = np.array([0.1, 0.2, 0.3, 0.4, 0.5])


def straight(zero, load=LOAD):
    """A gap that closes at a load, and is held open by nothing after it."""
    return np.maximum(zero - load, 0.0)[:, None]


SMOOTH = "Q = 4: the gap before contact is not smooth enough: bracketed"


@pytest.mark.parametrize(
    ("gap", "options", "bracket", "messages"),
    [
        (straight(0.37)[:, 0], {"brackets": True}, [0.3, 0.4], []),
        (straight(0.05)[:, 0], {}, [0.0, 0.1], []),  # contact from the first increment on
        (
            [0.2, 0.1, 0.0, 0.1, 0.0],
            {"brackets": True},
            [0.2, 0.3],
            ["Q = 4: contact is lost again at p/E = 0.4"],
        ),
        ([0.05, 0.3, 0.2, -0.1, -0.2], {}, [0.3, 0.4], [SMOOTH]),  # grows, then closes at 0.5
        ([0.5, 0.4, 0.3, -0.1, -0.2], {}, [0.3, 0.4], [SMOOTH]),  # straight on: at 0.6
        # Straight on: at 1.2; a parabola: 0.3.
        ([0.9, 0.1, 0.09, -0.1, -0.1], {"gap_error": 1.0}, [0.3, 0.4], [SMOOTH]),
        (straight(0.37)[:, 0], {"gap_error": np.inf}, [0.3, 0.4], [SMOOTH]),
        # An unknown gap is no end of a bracket.
        ([np.inf, np.inf, np.nan, -np.inf, -np.inf], {}, [0.2, 0.4], []),
    ],
)
def test_transitions_of__without_a_smooth_gap_a_load_is_in_its_increment(
    gap, options, bracket, messages
):
    gap = np.array(gap)[:, None]
    rows, said = transitions_of(LOAD, gap, np.array([4]), **options)
    columns = ["p_over_E_lower", "p_over_E", "rel_se"]
    assert rows[columns].iloc[0].tolist() == pytest.approx([*bracket, 0.0], rel=1e-12)
    assert said == messages


def test_transitions_of__a_curved_gap_is_off_by_no_more_than_three_errors():
    for power in (0.8, 1.3, 2.0):
        gap = np.maximum(0.37**power - LOAD**power, 0.0)[:, None]
        rows, _ = transitions_of(LOAD, gap, np.array([4]))
        off = abs(rows["p_over_E"].iloc[0] - 0.37) / 0.37
        # The error is what a parabola adds to a straight line; the rest is of third order.
        assert 0.3 * rows["rel_se"].iloc[0] < off < 3 * rows["rel_se"].iloc[0]


def test_transitions_of__cut_backs_repeats_and_unloading_change_nothing():
    load = np.array([0.1, 0.2, 0.15, 0.2, 0.3, 0.3, 0.25, 0.4, np.nan, -0.1, 0.5])
    gap = straight(0.37, np.where(np.isnan(load), 9.0, load))  # the NaN would be in contact
    rows, messages = transitions_of(load, gap, np.array([4]))
    expected, _ = transitions_of(LOAD, straight(0.37), np.array([4]))
    assert rows["p_over_E"].iloc[0] == pytest.approx(expected["p_over_E"].iloc[0], rel=1e-12)
    assert messages == [
        "2 increments ignored: no load above 0",
        "2 increments ignored: they repeat a load",
        "2 increments ignored: the load decreases or was cut back",
    ]


def test_transitions_of__contact_seen_only_while_unloading_does_not_count():
    load = np.array([0.1, 0.2, 0.3, 0.25, 0.4])
    gap = np.array([[0.3], [0.2], [0.1], [-0.1], [0.05]])
    with pytest.raises(InputError, match=r"no corner is reached.*0\.4.*Q = 4: not reached"):
        transitions_of(load, gap, np.array([4]))


def test_transitions_of__without_increments_says_so():
    with pytest.raises(InputError, match="no increment is left"):
        transitions_of(np.zeros(3), straight(0.37, np.zeros(3)), np.array([4]))


def test_transitions_of__two_corners_in_one_increment_are_one_row():
    load = np.array([0.1, 0.2])
    gap = np.array([[0.1, 0.2], [-0.1, -0.01]])
    rows, messages = transitions_of(load, gap, np.array([4, 6]), brackets=True)
    assert rows["Q"].tolist() == [4]
    assert messages == ["Q = 6 ignored: reached in the same increment as Q = 4"]


def test_transitions_of__a_body_that_lies_on_a_corner_to_rounding_touches_it():
    load, far = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), [0.25, 0.15, 0.05]
    above, below = (
        transitions_of(load, np.array([[*far, e, e, -0.01]]).T, np.array([4]))[0]
        for e in (1e-16, -1e-16)
    )
    pd.testing.assert_frame_equal(above, below)
    assert above["p_over_E"].iloc[0] == pytest.approx(0.35, rel=1e-12)


def test_transitions_of__a_gap_within_one_printed_digit_is_closed():
    gap = np.array([[0.03], [0.02], [0.01], [3e-7], [2e-7]])  # rests 3e-7 above the corner
    rows, _ = transitions_of(LOAD, gap, np.array([4]), gap_error=5e-7, digits=1e-6)
    np.testing.assert_allclose(rows["p_over_E"], [0.4], rtol=1e-12)  # rounding
    # A gap of 0.01 falls by 0.1 a unit of load.
    np.testing.assert_allclose(rows["rel_se"], [5e-7 / 0.1 / 0.4], rtol=1e-6)
    with pytest.raises(InputError, match="no corner is reached"):
        transitions_of(LOAD, gap, np.array([4]))
