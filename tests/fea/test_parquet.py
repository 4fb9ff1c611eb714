"""Parquet files: columns by type, and what is refused."""

import io
import sys

import pandas as pd
import pyarrow
import pyarrow.parquet
import pytest

import ridgebayes as rb
from ridgebayes.table import files
from tests.fea.tables import imported

ROWS = {
    "a_over_R": [0.03, 0.03],
    "b_over_R": [0.01, 0.01],
    "Q": [4, 6],
    "p_over_E": [0.001, 0.004],
}


@pytest.fixture
def read(tmp_path):
    def read_rows(rows, **options):
        path = tmp_path / "mine.parquet"
        pyarrow.parquet.write_table(pyarrow.table({**ROWS, **rows}), path)
        return imported(path, **options)

    return read_rows


@pytest.fixture
def refusal(read):
    def words(rows, **options):
        with pytest.raises(rb.InputError, match=r"mine\.parquet") as caught:
            read(rows, **options)
        return str(caught.value)

    return words


def test_parquet__numbers_come_back_as_they_are(read):
    found = read({"p [kPa]": [0.06, 0.24]}, mapping={"p": "p"}, E="60 kPa")
    assert found.table.column("p_over_E").tolist() == [0.001, 0.004]


@pytest.mark.parametrize(
    "kind", [pyarrow.int8(), pyarrow.uint64(), pyarrow.float32(), pyarrow.decimal128(25, 2)]
)
def test_parquet__whole_numbers_of_any_type_are_counts(read, kind):
    column = pyarrow.array([4, 6]).cast(kind)
    assert read({"Q": column}).table.column("Q").tolist() == [4, 6]


def test_parquet__text_may_be_encoded_as_a_dictionary(read):
    column = pyarrow.array(["s1", None]).dictionary_encode()
    assert read({"series": column}).table.frame["series"].tolist() == ["s1", ""]


@pytest.mark.parametrize("column", [["4", "6"], [True, False], [[4], [6]], [b"4", b"6"]])
def test_parquet__what_is_no_number_is_refused(refusal, column):
    assert "column 'Q'" in refusal({"Q": column})


def test_parquet__infinite_numbers_are_refused(refusal):
    words = refusal({"p_over_E": [0.001, float("inf")]})
    assert "mine.parquet, row 2, column 'p_over_E' = 'inf': expected a finite number" in words


def test_parquet__own_columns_of_lists_are_left_out_and_said(read):
    messages = "\n".join(read({"extra": [[1], [2]]}).messages)
    assert "column 'extra' ignored: its type is list" in messages


def test_parquet__a_contract_column_of_lists_is_refused(refusal):
    assert "column 'series', series: expected numbers or text" in refusal({"series": [[1], [2]]})


def test_parquet__absurdly_many_rows_are_refused(refusal, monkeypatch):
    monkeypatch.setattr(files, "MOST_CELLS", 7)
    assert "2 rows of 4 columns; expected at most 7 cells" in refusal({})


def test_parquet__rules_of_the_contract_name_the_row(refusal):
    assert "row 2, p_over_E = 0.0001: must rise" in refusal({"p_over_E": [0.001, 0.0001]})


def test_parquet__without_pyarrow_the_extra_is_named(tmp_path, monkeypatch):
    out = io.BytesIO()
    pd.DataFrame(ROWS).to_parquet(out)
    (tmp_path / "mine.parquet").write_bytes(out.getvalue())
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(rb.InputError, match=r"pip install 'ridgebayes\[parquet\]'"):
        imported(tmp_path / "mine.parquet")
