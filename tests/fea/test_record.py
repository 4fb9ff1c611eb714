"""Warnings of doubtful rows that break no rule."""

import numpy as np
import pandas as pd
import pytest

from ridgebayes import ContactTable
from ridgebayes.contact.hertz import load_of_half_width
from ridgebayes.fea.record import Imported

A, B, NU = 0.04, 0.02, 0.49


def cautions(**columns):
    frame = pd.DataFrame({"a_over_R": A, "b_over_R": B, "nu": NU, **columns})
    return Imported(ContactTable.from_frame(frame), ()).cautions


@pytest.mark.parametrize(("times", "n"), [(4.99, 0), (5.01, 1), (0.201, 0), (0.199, 1)])
def test_cautions__name_loads_of_five_times_or_a_fifth_of_a_smooth_body_s(times, n):
    corner = B / 2 + A + B  # the second ridge's edge
    said = cautions(Q=[4], p_over_E=[times * float(load_of_half_width(corner, nu=NU))])
    assert len(said) == n
    assert all("check the units" in one and "a0.04_b0.02 Q = 4" in one for one in said)


def test_cautions__name_errors_above_a_fifth():
    load = load_of_half_width(B / 2 + (A + B) * np.arange(1, 4), nu=NU)
    (said,) = cautions(Q=[4, 6, 8], p_over_E=load, rel_se=[0.19, 0.21, 0.0])
    assert said.startswith("1 row, a0.04_b0.02 Q = 6")
    assert "rel_se is above 0.2" in said


def test_cautions__name_curves_that_begin_above_4():
    load = load_of_half_width(B / 2 + (A + B) * np.arange(1, 4), nu=NU)
    assert cautions(Q=[4, 6, 8], p_over_E=load) == []
    (said,) = cautions(Q=[6, 8], p_over_E=load[1:])
    assert "a0.04_b0.02 Q = 6" in said
    assert "lower Q are missing" in said
