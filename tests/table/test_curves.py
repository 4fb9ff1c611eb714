"""Curves travel as JSON and come back the same; their table has every row in order."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from ridgebayes.table.curves import COLUMNS, Curve, curves_to_frame

CURVE = Curve(
    a_over_R=0.1 + 0.2,
    b_over_R=5e-324,
    Q=(4, 6, 8),
    p_over_E=(0.1, np.nextafter(0.1, 1.0), math.nan),
    rel_se=(0.0, 0.0, 0.0),
    nu=1 / 3,
    offset_over_R=0.0,
    role="held-out",
    solver="half-plane",
    status=("ok", "ok", "not converged: at p/E = 0.1, “so”"),
    source="here",
    edges=0,
)


def test_plain__comes_back_from_json_to_the_last_bit():
    text = json.dumps(CURVE.to_dict(), allow_nan=False)
    again = Curve.from_dict(json.loads(text))
    assert again.p_over_E[:2] == CURVE.p_over_E[:2]
    assert math.isnan(again.p_over_E[2])
    no_load = {"p_over_E": ()}
    assert replace(again, **no_load) == replace(CURVE, **no_load)


def test_curves_to_frame__has_the_rows_of_each_curve_in_turn():
    other = replace(CURVE, Q=(10,), p_over_E=(0.5,), rel_se=(0.0,), status=("ok",), a_over_R=0.7)
    frame = curves_to_frame([CURVE, other])
    assert frame["Q"].tolist() == [4, 6, 8, 10]
    assert frame["a_over_R"].tolist() == [0.1 + 0.2] * 3 + [0.7]
    assert frame["status"].tolist() == [*CURVE.status, "ok"]
    assert frame["p_over_E"].isna().tolist() == [False, False, True, False]


@pytest.mark.parametrize(
    ("given", "column"),
    [
        ({"rel_se": (1e-3, 2e-3, 0.0)}, "rel_se"),
        ({"offset_over_R": 0.1}, "offset_over_R"),
        ({"edges": 24}, "edges"),
    ],
)
def test_curves_to_frame__leaves_out_what_no_curve_has(given, column):
    assert set(COLUMNS) - set(curves_to_frame([CURVE])) == {"rel_se", "offset_over_R", "edges"}
    frame = curves_to_frame([CURVE, replace(CURVE, **given)])
    (value,) = given.values()
    rows = list(value) if isinstance(value, tuple) else [value] * 3
    assert frame[column].tolist() == [0] * 3 + rows
