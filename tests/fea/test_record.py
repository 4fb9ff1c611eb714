"""Warnings of doubtful rows that break no rule."""

import re

import numpy as np
import pandas as pd
import pytest

from ridgebayes import ContactTable
from ridgebayes.contact.hertz import load_of_half_width
from ridgebayes.fea.record import Imported

A, B, NU = 0.04, 0.02, 0.49


@pytest.mark.parametrize(
    ("Q", "times", "rel_se", "said"),
    [
        ([4, 6, 8], 4.99, 0.0, "^$"),
        ([4], 5.01, 0.0, "a0.04_b0.02 Q = 4 .*check the units"),
        ([4], 0.201, 0.0, "^$"),
        ([4], 0.199, 0.0, "a0.04_b0.02 Q = 4 .*check the units"),
        ([4, 6, 8], 1.0, [0.19, 0.21, 0.0], "^1 row, a0.04_b0.02 Q = 6 .*rel_se is above 0.2"),
        ([6, 8], 1.0, 0.0, "a0.04_b0.02 Q = 6 .*lower Q are missing"),
    ],
)
def test_cautions__name_doubtful_rows(Q, times, rel_se, said):
    """Loads are multiples of a smooth body's, whose contact reaches the next ridge."""
    load = times * load_of_half_width(B / 2 + (A + B) * (np.array(Q) / 2 - 1), nu=NU)
    columns = {"a_over_R": A, "b_over_R": B, "nu": NU, "Q": Q, "p_over_E": load, "rel_se": rel_se}
    table = ContactTable.from_frame(pd.DataFrame(columns))
    assert re.search(said, "".join(Imported(table, ()).cautions))
