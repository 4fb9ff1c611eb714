"""Each rule of the contact table is broken once, and every file comes back as it was written."""

import re
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import ridgebayes as rb
from ridgebayes.errors import OutputError
from ridgebayes.table.columns import NAMES, REQUIRED
from ridgebayes.table.rules import as_numbers, as_text, row_codes

HEADER = "a_over_R,b_over_R,Q,p_over_E"
GOOD = "0.032,0.01,4,0.00097\n0.032,0.01,6,0.0037\n"


def csv_file(folder: Path, text: str | bytes, name: str = "fea.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refusal(source) -> str:
    with pytest.raises(rb.InputError) as caught:
        rb.read_table(source)
    return str(caught.value)


def sweep(n_texture: int = 3) -> pd.DataFrame:
    k = np.tile([1, 2, 3], n_texture)
    a = np.repeat(0.012 + 0.01 * np.arange(n_texture), 3)
    return pd.DataFrame({"a_over_R": a, "b_over_R": 0.02, "Q": 2 + 2 * k, "p_over_E": 1e-3 * k**2})


# --- what is filled, kept and derived -------------------------------------------------------


def test_from_frame__fills_every_default_in_canonical_order() -> None:
    frame = rb.ContactTable.from_frame(sweep(1)).frame
    assert tuple(frame.columns) == NAMES
    first = frame.iloc[0].to_dict()
    assert np.isnan(first.pop("p_over_E_lower"))
    assert first == {
        "a_over_R": 0.012,
        "b_over_R": 0.02,
        "Q": 4,
        "p_over_E": 0.001,
        "rel_se": 0.0,
        "kind": "transition",
        "nu": 0.5,
        "offset_over_R": 0.0,
        "texture": "a0.012_b0.02",
        "series": "",
        "role": "calibration",
        "solver": "",
        "status": "ok",
        "source": "",
    }
    assert frame["Q"].dtype == np.int64


def test_from_frame__empty_cells_take_the_default_and_empty_labels_the_geometry() -> None:
    frame = sweep(1).assign(
        nu=[0.49, np.nan, 0.49],
        texture=["", "mine", None],
        kind="",
        role=None,
        status=["", "ok", "ok"],
        rel_se=np.nan,
    )
    got = rb.read_table(frame).frame
    assert got["nu"].tolist() == [0.49, 0.5, 0.49]
    assert got["texture"].tolist() == ["a0.012_b0.02", "mine", "a0.012_b0.02"]
    assert set(got["kind"]) == {"transition"}
    assert set(got["role"]) == {"calibration"}
    assert set(got["status"]) == {"ok"}
    assert set(got["rel_se"]) == {0.0}


def test_frame__is_a_copy_both_ways() -> None:
    mine = sweep(1)
    table = rb.read_table(mine)
    mine.loc[0, "p_over_E"] = 9.0
    theirs = table.frame
    theirs.loc[0, "p_over_E"] = 9.0
    assert table.frame["p_over_E"].iloc[0] == 0.001
    with pytest.raises(ValueError, match="read-only"):
        table.column("p_over_E")[0] = 9.0


def test_roles_and_status__part_the_rows_without_losing_one() -> None:
    frame = sweep(3).assign(
        role=["calibration"] * 3 + ["held-out"] * 6,
        status=["ok"] * 8 + ["did not converge"],
    )
    frame.loc[8, "p_over_E"] = np.nan
    table = rb.read_table(frame)
    assert [len(part) for part in (table.calibration, table.held_out, table.left_out)] == [3, 5, 1]
    assert len(table) == 9
    assert table.left_out.column("status").tolist() == ["did not converge"]
    assert table.calibration.textures == ((0.012, 0.02),)
    assert repr(table) == "ContactTable(table: 9 rows, 3 textures)"


def test_textures_and_labels__stand_in_order_of_first_appearance() -> None:
    frame = sweep(3).iloc[::-1].assign(texture=[*["rough"] * 2, "rough too", *[""] * 6])
    table = rb.read_table(frame)
    assert [a for a, _ in table.textures] == pytest.approx([0.032, 0.022, 0.012])
    assert table.labels == ("rough", "a0.022_b0.02", "a0.012_b0.02")


def test_from_frame__accepts_what_the_contract_allows() -> None:
    rows = pd.DataFrame(
        {
            "a_over_R": 0.02,
            "b_over_R": 0.02,
            "Q": [5, 2, 2, 6, 6, 6],
            "p_over_E": [0.01, 0.001, 0.002, 0.004, 0.004, np.nan],
            "offset_over_R": [0.003, 0, 0, 0, 0, 0],
            "kind": ["transition", "count", "count", "transition", "transition", "transition"],
            "series": ["", "", "", "coarse", "fine", "fine"],
            "status": ["ok", "ok", "ok", "ok", "ok", "overlap"],
            "p_over_E_lower": [0.01, 0, np.nan, 0.003, np.nan, 0.1],
        }
    )
    assert len(rb.read_table(rows)) == 6


@pytest.mark.parametrize(
    ("column", "other"),
    [
        ("a_over_R", 0.5),
        ("b_over_R", 0.5),
        ("nu", 0.3),
        ("offset_over_R", 0.01),
        ("source", "other"),
        ("solver", "other"),
        ("series", "other"),
    ],
)
def test_curve__is_told_apart_by_each_of_its_columns(column: str, other: object) -> None:
    first = rb.read_table(sweep(1).iloc[[0]]).frame.assign(texture="")
    assert len(rb.read_table(pd.concat([first, first.assign(**{column: other})]))) == 2
    assert "identical row of one curve twice" in refusal(pd.concat([first, first]))


@pytest.mark.parametrize("dtype", ["Float64", object, "category", str])
def test_from_frame__takes_numbers_of_any_pandas_dtype(dtype) -> None:
    frame = sweep(1)
    assert rb.read_table(frame.astype(dtype)).digest() == rb.read_table(frame).digest()


def test_as_text__spells_whole_numbers_alike() -> None:
    assert as_text(pd.Series([1.0, 2.5])).tolist() == ["1", "2.5"]
    assert as_text(pd.Series([1, 2])).tolist() == ["1", "2"]


def test_row_codes__agree_with_a_dictionary_of_rows() -> None:
    rng = np.random.default_rng(5)
    a, b, c = rng.integers(0, 4, (3, 200))
    words = pd.Series(c).map(str)
    known: dict = {}
    slow = [known.setdefault(row, len(known)) for row in zip(a, b, words, strict=True)]
    assert row_codes(a, b, words).tolist() == slow


@pytest.mark.parametrize("cell", [True, "1_000", "0x1", "１", 1j, "1e", "0,5", 10**400, [1]])
def test_as_numbers__takes_nothing_for_a_number_that_is_none(cell) -> None:
    _, _, text = as_numbers(pd.Series([cell, 1.0], dtype=object))
    assert text.tolist() == [True, False]
    _, _, text = as_numbers(pd.Series([str(cell), "1."], dtype=str))
    assert text.tolist() == [cell != 10**400, False]  # a number with many digits


# --- every rule, broken ----------------------------------------------------------------------

NUMBER = "must be a number, with a point for decimals"
ABOVE_0, RISE = "must be finite and > 0", "must rise with Q along a curve:"
# Columns beside the required ones, rows, and the message: of the first row if it names none.
CELLS = [
    ("", "0.01;0.02,0.01,4,0.001", f"a_over_R = '0.01;0.02': {NUMBER}"),
    ("", '0.01,0.01,4,"1,5"', f"p_over_E = '1,5': {NUMBER}"),
    ("", "0.01,nan,4,0.001", f"b_over_R = 'nan': {ABOVE_0}"),
    (
        "rel_se",
        "0.01,0.01,4,0.001,NaN\n0.01,0.01,6,0.002,",
        "rel_se = 'NaN': must be finite and >= 0",
    ),
    ("", "0.01,0.01,4,1e999", f"p_over_E = '1e999': {ABOVE_0}"),
    ("", "0.01,0.000,4,0.001", f"b_over_R = '0.000': {ABOVE_0}"),
    ("", ",0.01,4,0.001", "a_over_R = (empty): must not be empty or NaN"),
    ("", "0.01,0.01,,0.001", "Q = (empty): must not be empty or NaN"),
    ("", "0.01,0.01,4,", "p_over_E = (empty): must not be empty or NaN where status is 'ok'"),
    ("", "0.01,0.01,5,0.001", "Q = '5': must be even where offset_over_R is 0"),
    ("", "0.01,0.01,4.5,0.001", "Q = '4.5': must be an integer of at most 2^53"),
    ("", "0.01,0.01,2,0.001", "Q = '2': must be at least 4 for a transition"),
    ("kind", "0.01,0.01,0,0.001,count", "Q = '0': must be at least 2 for a count"),
    (
        "p_over_E_lower",
        "0.01,0.01,4,0.001,0.002",
        "p_over_E_lower = '0.002': must not be above p_over_E of its row",
    ),
    (
        "p_over_E_lower",
        "0.01,0.01,4,0.001,-1e-9",
        "p_over_E_lower = '-1e-9': must be finite and >= 0",
    ),
    ("rel_se", "0.01,0.01,4,0.001,-0.1", "rel_se = '-0.1': must be finite and >= 0"),
    ("nu", "0.01,0.01,4,0.001,0.51", "nu = '0.51': must be from 0 to 0.5"),
    ("nu", "0.01,0.01,4,0.001,-0.1", "nu = '-0.1': must be from 0 to 0.5"),
    ("offset_over_R", "0.01,0.01,5,0.001,inf", "offset_over_R = 'inf': must be finite"),
    ("kind", "0.01,0.01,4,0.001,Count", "kind = 'Count': must be 'transition' or 'count'"),
    ("role", "0.01,0.01,4,0.001,heldout", "role = 'heldout': must be 'calibration' or 'held-out'"),
    (
        "status",
        "0.01,0.01,4,0.001, OK",
        "status = ' OK': expected exactly 'ok', or a description of the failure",
    ),
    (
        "texture",
        "0.01,0.01,4,0.001,x\n0.01,0.02,4,0.001,x",
        "row 2 (line 3): texture = 'x': one label names one texture, and row 1 gives it to another "
        "(a_over_R, b_over_R)",
    ),
    (
        "source",
        '0.01,0.01,4,0.001,"two\nlines"',
        "source = 'two\\nlines': must be text on one line",
    ),
    ("note", '0.01,0.01,4,0.001,"two\nlines"', "note = 'two\\nlines': must be text on one line"),
    (
        "",
        "0.01,0.01,4,0.003\n0.01,0.01,6,0.002",
        f"row 2 (line 3): p_over_E = '0.002': {RISE} row 1 has a lower Q",
    ),
    (
        "",
        "0.01,0.01,6,0.002\n0.02,0.01,4,0.001\n\n0.01,0.01,4,0.003",
        f"p_over_E = '0.002': {RISE} row 3 has a lower Q",
    ),
    (
        "",
        "0.01,0.01,4,0.002\n0.01,0.01,6,0.002",
        f"row 2 (line 3): p_over_E = '0.002': {RISE} row 1 has a lower Q and this load; of one "
        "load step, keep the lowest Q",
    ),
    (
        "",
        "0.01,0.01,4,0.002\n0.01,0.01,4,0.0021",
        "row 2 (line 3): Q = '4': each Q must stand once in a curve, and row 1 has it too",
    ),
    ("", f"0.01,0.01,4,{70 * '9'}x", f"p_over_E = '{57 * '9'}...': {NUMBER}"),
]


@pytest.mark.parametrize(("extra", "rows", "said"), CELLS)
def test_read_table__names_file_row_column_value_and_rule(extra, rows, said, tmp_path) -> None:
    path = csv_file(tmp_path, f"{HEADER},{extra}".rstrip(",") + f"\n{rows}\n")
    said = said if said.startswith("row ") else f"row 1 (line 2): {said}"
    headline, *lines = refusal(path).split("\n  ")
    assert headline == f"{path}: 1 value in 1 row breaks the rules of the table"
    assert lines == [f"{path}, {said}"]


def test_read_table__lists_every_bad_cell_in_the_order_of_the_file(tmp_path: Path) -> None:
    path = csv_file(tmp_path, f"{HEADER}\nx,0.01,2,0.001\n0.01,0.01,4,0.001\n0.01,-1,4,\n")
    headline, *lines = refusal(path).split("\n  ")
    assert headline.endswith("4 values in 2 rows break the rules of the table")
    found = [re.search(r"row (\d) .*?: (\w+) =", line).groups() for line in lines]
    assert sorted(found) == [("1", "Q"), ("1", "a_over_R"), ("3", "b_over_R"), ("3", "p_over_E")]
    assert [row for row, _ in found] == ["1", "1", "3", "3"]


def test_read_table__shows_twenty_and_counts_the_rest() -> None:
    frame = pd.DataFrame({name: np.full(33, -1.0) for name in REQUIRED})
    headline, *lines = refusal(frame.assign(Q=np.arange(4, 70, 2))).split("\n  ")
    assert headline == "table: 99 values in 33 rows break the rules of the table"
    assert len(lines) == 21
    assert lines[-1] == "... and 79 more"
    assert lines[0] == "table, row 1: a_over_R = -1.0: must be finite and > 0"


# Rows are counted by position, whatever the index; a column that is not there is never blamed.
@pytest.mark.parametrize(
    ("cells", "said"),
    [
        ({"b_over_R": [0.1, 0.1, np.nan]}, "row 3: b_over_R = nan: must not be empty or NaN"),
        ({"b_over_R": [0.1, 0.1, np.inf]}, f"row 3: b_over_R = inf: {ABOVE_0}"),
        ({"Q": [4, 6, 7]}, "row 3: Q = 7: must be even where offset_over_R is 0"),
        (
            {"a_over_R": [0.012, 0.012, 0.03], "texture": ["", "", "a0.012_b0.02"]},
            "row 3: texture = 'a0.012_b0.02': one label names one texture",
        ),
    ],
)
def test_from_frame__shows_cells_by_row(cells: dict, said: str) -> None:
    frame = sweep(1).set_index(pd.Index([7, 7, 7])).assign(**cells)
    for make in (rb.ContactTable.from_frame, rb.ContactTable):
        with pytest.raises(rb.InputError, match=re.escape(f"mine, {said}")):
            make(frame, where="mine")


# --- files that are no table -----------------------------------------------------------------

FILES = [
    (b"", "the file is empty"),
    (b"\n \n", "the file is empty"),
    (b"\xef\xbb\xbf", "the file is empty"),
    (HEADER.encode() + b"\n", "no rows below the header"),
    (
        HEADER.encode() + b",source\n0.01,0.01,4,0.001,caf\xe9\n",
        "line 2: byte 0xe9 is not UTF-8; expected UTF-8",
    ),
    (
        (HEADER + "\n" + GOOD).encode("utf-16"),
        "line 1: a zero byte: not a text file, or not UTF-8",
    ),
    (b"a_over_R\x00", "line 1: a zero byte: not a text file, or not UTF-8"),
    (
        b"a_over_R,Q,p_over_E,note\n1,4,1,x\n",
        "header: missing column b_over_R; the columns are 'a_over_R', 'Q', 'p_over_E', 'note'",
    ),
    (
        b"A,B,Q\n1,1,4\n",
        "header: missing columns a_over_R, b_over_R, p_over_E; the columns are 'A', 'B', 'Q'. "
        "ridgebayes import makes a table of other columns and units",
    ),
    (
        b"a_over_R;b_over_R;Q;p_over_E\n0,1;0,1;4;0,1\n",
        "header: missing columns a_over_R, b_over_R, Q, p_over_E; "
        "the columns are 'a_over_R;b_over_R;Q;p_over_E' (columns are separated by commas). "
        "ridgebayes import makes a table of other columns and units",
    ),
    (
        b"a_over_R,b_over_R,Q,p_over_E,Q\n1,1,4,1,4\n",
        "header: column 5 = 'Q': each column must stand once; "
        "the columns are 'a_over_R', 'b_over_R', 'Q', 'p_over_E', 'Q'",
    ),
    (
        b"a_over_R,b_over_R,Q,p_over_E,\n1,1,4,1,\n",
        "header: column 5 = '': must have a name, as text; "
        "the columns are 'a_over_R', 'b_over_R', 'Q', 'p_over_E', ''",
    ),
    (
        HEADER.encode() + b'\n0.01,0.01,4,"0.001\n',
        "line 2: not CSV: unexpected end of data",
    ),
]


@pytest.mark.parametrize(("content", "told"), FILES)
def test_read_table__says_what_is_wrong_with_a_file(content, told, tmp_path: Path) -> None:
    path = csv_file(tmp_path, content)
    assert re.sub(r"^, |^: ", "", refusal(path).removeprefix(str(path))) == told


@pytest.mark.parametrize("quoted", [False, True])
def test_read_table__names_every_row_of_another_length(quoted: bool, tmp_path: Path) -> None:
    last = '"0.01",0.01,6,0.004' if quoted else "0.01,0.01,6,0.004"
    path = csv_file(tmp_path, f"{HEADER}\n0.01,0.01,4\n0.01,0.01,4,0.001,9\n\n{last}\n")
    assert refusal(path).split("\n  ") == [
        f"{path}: 2 values in 2 rows break the rules of the table",
        f"{path}, row 1 (line 2): column p_over_E: '0.01,0.01,4': "
        "must have 4 cells as the header, has 3",
        f"{path}, row 2 (line 3): column beyond p_over_E: '0.01,0.01,4,0.001,9': "
        "must have 4 cells as the header, has 5",
    ]


@pytest.mark.parametrize(
    ("header", "row", "first"),
    [
        (HEADER, "0.01,0.01\r4,0.001,x", "column Q: '0.01,0.01': must have 4"),
        (f"{HEADER},note", '0.01,0.01,4,"0,001"', "column note: '0.01,0.01,4,0,001': must have 5"),
    ],
)
def test_read_table__counts_cells_not_commas(
    header: str, row: str, first: str, tmp_path: Path
) -> None:
    path = csv_file(tmp_path, f"{header}\n{row}\n")
    assert f"{path}, row 1 (line 2): {first} cells" in refusal(path)


def test_read_table__counts_rows_of_another_length_beyond_the_first_twenty(tmp_path: Path) -> None:
    assert refusal(csv_file(tmp_path, HEADER + 30 * "\n1")).endswith("\n  ... and 10 more")


def test_read_table__says_no_to_what_is_no_file(tmp_path: Path) -> None:
    gone, folder = tmp_path / "gone.csv", tmp_path / "folder.csv"
    folder.mkdir()
    assert refusal(gone) == f"{gone}: no such file"
    assert refusal(str(folder)) == f"{folder}: is a folder, not a table file"
    assert "a table file ends in .csv or .parquet, not '.xlsx'" in refusal(tmp_path / "t.xlsx")
    assert "a table file ends in .csv or .parquet, not 'no suffix'" in refusal(tmp_path / "t")
    assert ": cannot be read: File name too long" in refusal(tmp_path / (300 * "x" + ".csv"))


def test_read_table__refuses_a_parquet_file_that_is_none(tmp_path: Path) -> None:
    path = csv_file(tmp_path, HEADER, "t.parquet")
    assert refusal(path).startswith(f"{path}: not a readable Parquet file: ")


def test_parquet__without_pyarrow_says_what_to_install(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "t.parquet"
    table = rb.read_table(sweep(1))
    table.write(path)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    told = f"{path}: Parquet needs pyarrow: pip install 'ridgebayes[parquet]'"
    assert refusal(path) == told
    path.unlink()
    with pytest.raises(rb.InputError) as caught:
        table.write(path)
    assert str(caught.value) == told
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gone/t.csv", "cannot be written: "),
        ("gone/t.parquet", "cannot be written: "),
        ("t.json", r"ends in \.csv or \.parquet, not '\.json'"),
    ],
)
def test_write__refuses_what_cannot_be_written(name: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(rb.InputError, match=said):
        rb.read_table(sweep(1)).write(tmp_path / name)


def test_from_frame__refuses_columns_without_a_name_and_no_rows() -> None:
    told = refusal(sweep(1).assign(**{"x": 1}).rename(columns={"x": 7}))
    assert told.startswith("table, header: column 5 = 7: must have a name, as text")
    assert refusal(sweep(1).iloc[:0]) == "table: no rows below the header"


# --- what is written comes back ---------------------------------------------------------------


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_read_table__takes_every_line_ending_and_a_mark(
    ending: str, mark: bytes, tmp_path: Path
) -> None:
    text = f"{HEADER}\n{GOOD}\n".replace("\n", ending)
    table = rb.read_table(csv_file(tmp_path, mark + text.encode()))
    assert (
        table.digest() == rb.read_table(csv_file(tmp_path, f"{HEADER}\n{GOOD}".rstrip())).digest()
    )


def test_write__leaves_out_optional_columns_that_say_nothing(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    rb.read_table(sweep(1)).write(path)
    always = "a_over_R,b_over_R,Q,p_over_E,nu,texture,solver,status,source"
    assert path.read_text() == (
        f"{always}\n"
        "0.012,0.02,4,0.001,0.5,a0.012_b0.02,,ok,\n"
        "0.012,0.02,6,0.004,0.5,a0.012_b0.02,,ok,\n"
        "0.012,0.02,8,0.009000000000000001,0.5,a0.012_b0.02,,ok,\n"
    )
    rb.read_table(sweep(1).assign(rel_se=[0, 0, 0.01], kind=["transition"] * 3)).write(path)
    assert path.read_text().splitlines()[0] == always.replace("p_over_E,", "p_over_E,rel_se,")


def test_write__that_fails_leaves_the_old_file_and_no_part(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "t.csv"
    table = rb.read_table(sweep(1))
    table.write(path)
    before = path.read_bytes()

    def disk_full(_frame, part, **_options):
        part.write_text("half a table")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pd.DataFrame, "to_csv", disk_full)
    with pytest.raises(OutputError, match=r"t\.csv: cannot be written: No space left on device"):
        table.write(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_csv__own_columns_become_numbers_only_if_nothing_is_lost(tmp_path: Path) -> None:
    own = "id,code,force,note,gap,none\n"
    rows = "1,007,1.50,x,,\n2,12,-3e-4,,2,\n"
    lines = [f"{a},{b}" for a, b in zip(GOOD.splitlines(), rows.splitlines(), strict=True)]
    path = csv_file(tmp_path, f"{HEADER},{own}" + "\n".join(lines))
    frame = rb.read_table(path).frame
    assert frame["id"].tolist() == [1, 2]
    assert frame["id"].dtype == np.int64
    assert frame["code"].tolist() == ["007", "12"]
    assert frame["force"].tolist() == [1.5, -3e-4]
    assert frame["note"].tolist() == ["x", ""]
    assert np.isnan(frame["gap"].iloc[0])
    assert frame["none"].tolist() == ["", ""]


def test_csv__the_slow_way_reads_the_same(tmp_path: Path) -> None:
    """A quote sends a file that way."""
    fast = csv_file(tmp_path, f"{HEADER},rel_se,note\n0.032,0.01,4,0.00097,,7\n")
    slow = csv_file(tmp_path, f'{HEADER},rel_se,note\n0.032,0.01,4,0.00097," ",7\n', "slow.csv")
    assert rb.read_table(fast).digest() == rb.read_table(slow).digest()
    named = csv_file(tmp_path, f"{HEADER},rel_se,note\n0.032,0.01,4,0.00097,,nan\n", "nan.csv")
    assert rb.read_table(named).frame["note"].tolist() == ["nan"]


WORD = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), max_size=8)
WIDTH = st.floats(1e-300, 1e300)


@st.composite
def tables(draw) -> pd.DataFrame:
    n = draw(st.integers(1, 6))

    def column(cells):
        return draw(st.lists(cells, min_size=n, max_size=n))

    lower = column(st.none() | st.floats(0, 1))
    return pd.DataFrame(
        {
            "a_over_R": column(WIDTH),
            "b_over_R": column(WIDTH),
            "Q": [2 * q for q in column(st.integers(2, 2**40))],
            "p_over_E": [1.0 + load for load in column(st.floats(0, 1e6))],
            "p_over_E_lower": np.array(lower, dtype=float),
            "rel_se": column(st.floats(0, 10)),
            "kind": column(st.sampled_from(["transition", "count"])),
            "nu": column(st.floats(0, 0.5)),
            "offset_over_R": column(st.sampled_from([0.0, -0.25, 1e-9])),
            "series": [f"{i}{word}" for i, word in enumerate(column(WORD))],
            "role": column(st.sampled_from(["calibration", "held-out"])),
            "solver": column(WORD),
            "status": [
                word if word.strip().lower() != "ok" else "ok"
                for word in column(WORD | st.just("ok"))
            ],
            "source": column(WORD),
            "own number": column(st.floats(allow_nan=False, allow_infinity=False)),
            "own word": [f"w{word}" for word in column(WORD)],
        }
    )


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@given(frame=tables())
@settings(max_examples=25, deadline=None)
def test_write_then_read__is_identity(suffix: str, frame: pd.DataFrame, tmp_path_factory) -> None:
    path = tmp_path_factory.mktemp("t") / f"t.{suffix}"
    table = rb.read_table(frame)
    table.write(path)
    again = rb.read_table(path)
    pd.testing.assert_frame_equal(again.frame, table.frame, check_exact=True)
    assert again.digest() == table.digest()
    first = path.read_bytes()
    again.write(path)
    assert path.read_bytes() == first


@pytest.mark.slow
@given(frame=tables(), order=st.randoms(use_true_random=False))
@settings(max_examples=20, deadline=None)
def test_order_of_columns__does_not_matter(frame: pd.DataFrame, order) -> None:
    names = list(frame.columns)
    order.shuffle(names)
    assert rb.read_table(frame[names]).digest() == rb.read_table(frame).digest()


def test_digest__is_of_every_cell_and_the_order_of_rows() -> None:
    frame = sweep(2).assign(source="x", mine=[1, 2, 3, 4, 5, 6])
    digests = [rb.read_table(frame).digest(), rb.read_table(frame.iloc[::-1]).digest()]
    spelled_out = frame.assign(nu=0.5, rel_se=0.0)
    assert rb.read_table(spelled_out).digest() == digests[0]
    cells = {"p_over_E": 0.0011, "source": "y", "mine": 9, "nu": 0.4, "rel_se": 0.1}
    for name, cell in cells.items():
        changed = spelled_out.copy()
        changed.loc[0, name] = cell
        digests.append(rb.read_table(changed).digest())
    assert len(set(digests)) == len(digests) == 7
    assert rb.read_table(frame.assign(offset_over_R=-0.0)).digest() == digests[0]
    assert all(re.fullmatch("[0-9a-f]{64}", digest) for digest in digests)


def test_digest__is_the_same_on_every_machine() -> None:
    """Reference: typed in once; a change of it makes every stored fingerprint stale."""
    assert rb.read_table(sweep(1)).digest() == (
        "d1859b29cad14ef0cdf51bd6ab1c59104b5cbd885b103828f5bdc1805dec66bd"
    )


def test_parquet__keeps_an_index_another_program_stored(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    sweep(1).set_index("Q").to_parquet(path)
    assert rb.read_table(path).digest() == rb.read_table(sweep(1)).digest()


def test_read_table__a_lone_carriage_return_shifts_no_cell(tmp_path):
    path = csv_file(tmp_path, f"{HEADER},n\n\r,0.08,0.01,4,0.004\n0.256,0.1,4,0.001,x\n")
    assert "a_over_R = (empty)" in refusal(path)


def test_repeated__are_rows_to_fit_of_curves_with_the_loads_of_another_source_to_all_digits():
    one, other = sweep().assign(source="A"), sweep().assign(source="B")
    other.loc[[0, 4], "p_over_E"] *= 1 + 1e-15
    other.loc[1, "p_over_E"] *= 1.01
    other.loc[2, "nu"], other.loc[3, "role"] = 0.45, "held-out"
    table = rb.ContactTable.from_frame(
        pd.concat([one, other.fillna({"nu": 0.5, "role": "calibration"})])
    )
    assert len(rb.ContactTable.from_frame(one).repeated) == 0
    found = table.repeated
    assert set(found.column("source")) == {"B"}
    assert found.column("p_over_E").tolist() == other["p_over_E"].iloc[6:].tolist()


def repeats(loads):
    """Curves of one texture, a series each."""
    parts = [
        pd.DataFrame({"Q": 4 + 2 * np.arange(len(p)), "p_over_E": p, "series": f"{i}"})
        for i, p in enumerate(loads)
    ]
    frame = pd.concat(parts).assign(a_over_R=0.02, b_over_R=0.02)
    return rb.ContactTable.from_frame(frame).repeated.column("series").tolist()


def test_repeated__honest_repeats_of_few_digits_are_none():
    # Each load stands twice or more, and no curve is another's.
    assert (
        repeats([[0.0013, 0.0052, 0.012], [0.0013, 0.0055, 0.013], [0.0014, 0.0052, 0.013]]) == []
    )
    assert repeats([[0.0013], [0.0013]]) == []
    assert repeats([[0.0013, 0.0052], [0.0013, 0.0052]]) == []


def test_repeated__a_curve_within_another_is_one_whichever_comes_first():
    long, short = [0.0013, 0.0052, 0.012, 0.021], [0.0013, 0.0052, 0.012]
    assert repeats([long, short]) == ["1"] * 3
    assert repeats([short, long]) == ["0"] * 3
    assert repeats([short, short, short]) == ["1"] * 3 + ["2"] * 3


def test_read_table__takes_a_table_a_frame_or_a_path_and_nothing_else(tmp_path):
    table = rb.paper_sweep()
    assert rb.read_table(table) is table
    assert rb.read_table(table.to_dataframe()).digest() == table.digest()
    table.write(tmp_path / "t.csv")
    for path in (tmp_path / "t.csv", str(tmp_path / "t.csv")):
        assert rb.read_table(path).digest() == table.digest()
    with pytest.raises(rb.InputError, match="table: expected a path, a ContactTable or a"):
        rb.read_table([0.01, 0.02])
    with pytest.raises(rb.InputError, match=r"table: expected a pandas\.DataFrame, got str"):
        rb.ContactTable.from_frame("t.csv")
