"""X-Y reports of Abaqus/Viewer: tables of blanks, whose names hold single blanks."""

import pytest

import ridgebayes as rb
from tests.fea.tables import imported

REPORT = (
    "\n     X     a_over_R     b_over_R     Q     LOAD PI: P N: 1\n"
    "----------------------------------------------------------------\n\n"
    "    0.     0.03     10.E-03     4.     0.001\n    1.     0.03     10.E-03     6.     0.004\n\n"
)


@pytest.mark.parametrize(
    "text",
    [
        REPORT,
        "\ufeff" + REPORT.replace("\n", "\r\n"),
        "X;a_over_R;b_over_R;Q;LOAD\n\n\n0;0.03;0.01;4;0.001\n1;0.03;0.01;6;0.004\n",
    ],
)
def test_read_columns__a_report_of_curves_is_a_table(tmp_path, text):
    path = tmp_path / "curves.rpt"
    path.write_bytes(text.encode())
    header = "LOAD PI: P N: 1" if "PI" in text else "LOAD"
    found = imported(path, {"p_over_E": header})
    assert found.table.column("p_over_E").tolist() == [0.001, 0.004]
    path.write_bytes(text.replace("0.03", "-.03").encode())
    with pytest.raises(rb.InputError, match=r"curves\.rpt.*\(line [45]\).* = -0\.03"):
        imported(path, {"p_over_E": header})
