"""X-Y reports of Abaqus/Viewer: columns by name, and what is refused with its line."""

import re

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.abaqus_rpt import read_xy
from ridgebayes.fea.columns import read_columns


def xy(tmp_path, text):
    (tmp_path / "xy.rpt").write_bytes(text.encode() if isinstance(text, str) else text)
    return read_xy(tmp_path / "xy.rpt")


REPORT = """
                  X               XYData-2           XYData-3

                0.                 0.                -0.
               20.E-03             4.53294E-09      -28.0561E-06
                1.02             817.869E-06        -15.6511E-03


"""


@pytest.mark.parametrize(
    "text",
    [
        REPORT,
        "\ufeff" + REPORT.replace("\n", "\r\n"),
        REPORT.replace("XYData-3\n", "XYData-3\n" + "-" * 60 + "\n"),
        REPORT + "  Minimum   0.  0.  0.\n  Maximum  1. 1. 1.\n",
        "  X   XYData-2\n\n0. 0.\n20.E-03 4.53294E-09\n1.02 817.869E-06\n\n"
        "  X   XYData-3\n\n0. 0.\n20.E-03 -28.0561E-06\n1.02 -15.6511E-03\n",
    ],
)
def test_read_xy__reads_named_columns(tmp_path, text):
    frame = xy(tmp_path, text)
    assert list(frame.columns) == ["X", "XYData-2", "XYData-3"]
    np.testing.assert_allclose(
        frame.to_numpy(),
        [[0, 0, 0], [0.02, 4.53294e-9, -28.0561e-6], [1.02, 817.869e-6, -15.6511e-3]],
        rtol=1e-12,  # rounding
    )


def test_read_xy__the_index_is_the_line(tmp_path):
    frame = xy(tmp_path, REPORT)
    assert frame.index.name == "line"
    assert frame.index.tolist() == [4, 5, 6]


def test_read_xy__names_hold_blanks_and_are_wrapped(tmp_path):
    text = (
        "                                RF:RF2 PI:       U:U2 PI:\n"
        "                                PART-1-1         PART-1-1\n"
        "               X                N: 117047        N: 9\n\n"
        "               0.               1.E-03           2.E-03\n"
    )
    assert list(xy(tmp_path, text).columns) == [
        "X",
        "RF:RF2 PI: PART-1-1 N: 117047",
        "U:U2 PI: PART-1-1 N: 9",
    ]
    text = "     X     RF:RF2 PI: P N: 1     U:U2 PI: P N: 1\n\n    0.     1.     2.\n"
    assert list(xy(tmp_path, text).columns) == ["X", "RF:RF2 PI: P N: 1", "U:U2 PI: P N: 1"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no rows"),
        ("X F\n", "no rows"),
        ("1. 2.\n", "line 1: numbers before a header"),
        ("X F\n0. 1. 2.\n", "line 2: 3 values below the names"),
        ("X F\n0. 1.\n1.\n", "line 3: 1 values; expected 2"),
        ("X F\n0. nan\n", "line 2: 'nan': expected a finite number"),
        ("X F\n0. 1e999\n", "line 2: '1e999'"),
        ("X   F\n0,1   0,2\n", "line 2: '0,1': expected a finite number"),
        ("X F\n1_0 2\n", "line 2: '1_0'"),
        ("X  F  F\n0. 1. 2.\n", "'F' again in the header"),
        ("X F\n0. 1.\n\nX F\n0. 1.\n", "line 5: 'F' again; expected each name once"),
        ("X F\n0. 1.\n\nX G\n1. 1.\n", "line 5: another X"),
        ("X F\n0. 1.\n\nX G\n0. 1.\n1. 1.\n", "line 5: another X"),
        ("X F\n0. 1.\n".encode("utf-16"), "UTF-8"),
    ],
)
def test_read_xy__what_cannot_be_understood_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=rf"xy\.rpt.*{re.escape(message)}"):
        xy(tmp_path, text)


@pytest.mark.parametrize("separator", ["   ", ";", "\t", ","])
def test_read_columns__a_report_has_blanks_or_separators(tmp_path, separator):
    rows = ["a_over_R b_over_R Q p_over_E", "0.03 0.01 4 0.001", "0.03 0.01 6 0.004"]
    path = tmp_path / "xy.rpt"
    path.write_text("\n".join(row.replace(" ", separator) for row in rows) + "\n")
    assert read_columns(path).table.column("p_over_E").tolist() == [0.001, 0.004]


def test_read_columns__a_bad_cell_is_told_with_the_line_of_the_report(tmp_path):
    path = tmp_path / "curves.rpt"
    path.write_text(
        "\n  X   a_over_R  b_over_R  Q   p_over_E\n\n"
        " 1.       0.03      0.01  4.     0.001\n 2.      -0.03      0.01  6.     0.004\n"
    )
    with pytest.raises(InputError, match=r"curves\.rpt, row 2 \(line 5\): a_over_R = -0\.03"):
        read_columns(path)
