"""What CalculiX's .sta says: samples are lines of a run of CalculiX 2.20."""

import re

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.calculix_sta import read_sta

HEAD = """SUMMARY OF JOB INFORMATION
  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME
"""
CUT = (
    HEAD
    + """     1          1     1U   60  0.000000E+00  0.000000E+00  0.100000E+01
     1          1     2U   60  0.000000E+00  0.000000E+00  0.100000E+01
     1          1     3U   60  0.000000E+00  0.000000E+00  0.500000E+00
     1          1     4    14  0.250000E+00  0.250000E+00  0.250000E+00
     1          2     1    35  0.500000E+00  0.500000E+00  0.250000E+00
     1          3     1U   60  0.500000E+00  0.500000E+00  0.250000E+00
     1          3     2    40  0.750000E+00  0.750000E+00  0.250000E+00
     1          4     1U   60  0.750000E+00  0.750000E+00  0.250000E+00
     1          4     2U   60  0.750000E+00  0.750000E+00  0.250000E+00
"""
)


TIMES = np.array([0.25, 0.3, 0.5, 0.75])


def read(tmp_path, text, times=TIMES):
    (tmp_path / "run.sta").write_bytes(text.encode() if isinstance(text, str) else text)
    sure, said = read_sta(tmp_path / "run.sta", times)
    return times[sure].tolist(), said


@pytest.mark.parametrize("text", [CUT, "\ufeff" + CUT, CUT.replace("\n", "\r\n")])
def test_read_sta__counts_increments_cut_backs_and_the_tail(tmp_path, text):
    times, said = read(tmp_path, text)
    assert times == [0.25, 0.5, 0.75]
    assert said.endswith(
        "run.sta: 3 converged increments, the last at time 0.75, 4 cut-backs; it stopped after 2 "
        "attempts without convergence"
    )


def test_read_sta__steps_go_on_in_total_time(tmp_path):
    text = HEAD + "".join(f" {k} 1 1 5 0.{k}00000E+01 0.1E+01 0.1E+01\n" for k in (1, 2, 3))
    times, said = read(tmp_path, text, np.array([1.0, 1.5, 3.0]))
    assert times == [1.0, 3.0]
    assert said.endswith("3 converged increments, the last at time 3, 0 cut-backs")


def test_read_sta__a_time_is_told_in_the_digits_of_both_files(tmp_path):
    text = HEAD + "     1          1     1     5  0.123457E+00  0.123457E+00  0.123457E+00\n"
    assert read(tmp_path, text, np.array([0.1234568, 0.1234600, 0.0, 0.2]))[0] == [0.1234568]


def test_read_sta__a_run_that_never_converged_has_no_increments(tmp_path):
    times, said = read(tmp_path, "\n".join(CUT.split("\n")[:4]) + "\n")
    assert times == []
    assert "0 converged increments, 0 cut-backs; it stopped after 2" in said


def test_read_sta__a_line_without_an_end_is_not_read(tmp_path):
    text = CUT[: CUT.index("0.500000E+00  0.250000E+00\n     1          3") + 3]
    assert read(tmp_path, text)[0] == [0.25]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no increments; expected a .sta of CalculiX"),
        (HEAD, "no increments"),
        (HEAD + "1 1 1 5 0.1 0.1\n", "line 3: '1 1 1 5 0.1 0.1'; expected STEP, INC"),
        (HEAD + "1 1 1X 5 0.1 0.1 0.1\n", "line 3"),
        (HEAD + "1 1 1 5 0,1 0,1 0,1\n", "line 3: '0,1': expected a finite number"),
        (HEAD + "1 1 1 5 nan 0.1 0.1\n", "line 3: 'nan': expected a finite number"),
        (HEAD + "1 1 1 5 1e999 0.1 0.1\n", "line 3: '1e999'"),
        (HEAD + "1 2 1 5 0.2 0.1 0.1\n1 1 1 5 0.1 0.1 0.1\n", "line 4: step 1, increment 1 at"),
        (HEAD + "1 1 1 5 0.1 0.1 0.1\n1 1 1 5 0.1 0.1 0.1\n", "line 4: step 1, increment 1 at"),
        (CUT.encode("utf-16"), "UTF-8"),
    ],
)
def test_read_sta__what_cannot_be_understood_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=rf"run\.sta.*{re.escape(message)}"):
        read(tmp_path, text)
