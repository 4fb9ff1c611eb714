"""The contract of a friction table: one message that lists every bad cell."""

import pandas as pd
import pytest

import ridgebayes as rb

GOOD = {"a_over_R": [0.022, None], "b_over_R": [0.02, None], "p_over_E": 0.01, "mu": [0.8, 1.1]}


def test_read__fills_defaults_and_keeps_own_columns(tmp_path):
    table = rb.read_friction_table(pd.DataFrame(GOOD | {"skin": ["dry", "wet"], "subject": [1, 2]}))
    assert len(table) == 2
    frame = table.frame
    assert frame["mu_se"].tolist() == [0, 0]
    assert frame["role"].tolist() == ["calibration"] * 2
    assert frame["subject"].tolist() == ["1", "2"]
    assert list(frame)[-1] == "skin"
    assert table.is_fitted.all()
    for suffix in (".csv", ".parquet"):
        table.write(tmp_path / f"t{suffix}")
        again = rb.read_friction_table(str(tmp_path / f"t{suffix}"))
        assert again.digest() == table.digest()
        assert rb.read_friction_table(again) is again
    other = rb.read_friction_table(pd.DataFrame(GOOD | {"mu": [0.8, 1.2]}))
    assert other.digest() != table.digest()


def test_read__one_message_lists_every_bad_cell(tmp_path):
    path = tmp_path / "t.csv"
    path.write_text(
        "a_over_R,b_over_R,p_over_E,mu,mu_se,role\n"
        "0.02,,0.01,0.5,0,\n"
        ",0.02,0.01,0.5,0,\n"
        "-1,0.02,0,0.5,-0.1,calibration\n"
        "0.02,0.02,0.01,-0.5,inf,fit\n"
        ',,"1,5",,0,held-out\n'
    )
    with pytest.raises(rb.InputError) as error:
        rb.read_friction_table(path)
    words = str(error.value)
    assert "10 values in 5 rows break the rules" in words
    for cell in (
        "row 1 (line 2): b_over_R = (empty): must be finite and > 0; of a smooth surface",
        "row 2 (line 3): a_over_R = (empty)",
        "row 3 (line 4): a_over_R = '-1'",
        "row 3 (line 4): p_over_E = '0': must be finite and > 0",
        "row 3 (line 4): mu_se = '-0.1': must be finite and >= 0",
        "row 4 (line 5): mu = '-0.5': must be finite and > 0",
        "row 4 (line 5): mu_se = 'inf'",
        "row 4 (line 5): role = 'fit': must be 'calibration' or 'held-out'",
        "row 5 (line 6): p_over_E = '1,5': must be a number, with a point for decimals",
        "row 5 (line 6): mu = (empty): must not be empty or NaN",
    ):
        assert cell in words


def test_read__refuses_what_is_no_table(tmp_path):
    with pytest.raises(rb.InputError, match="missing columns p_over_E, mu"):
        rb.read_friction_table(pd.DataFrame({"a_over_R": [1.0], "b_over_R": [1.0]}))
    with pytest.raises(rb.InputError, match="no rows below the header"):
        rb.read_friction_table(pd.DataFrame(GOOD).head(0))
    with pytest.raises(rb.InputError, match="expected a path, a FrictionTable"):
        rb.read_friction_table(3)
