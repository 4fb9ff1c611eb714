"""Excel workbooks: values are read; formulas, dates, bombs and document types are refused."""

import datetime
import io
import re
import sys
import zipfile

import openpyxl
import pytest

FILE_NAME = "mine.xlsx"
HEADER = ["a_over_R", "b_over_R", "Q", "p_over_E", "n"]
ROWS = [HEADER, [0.03, 0.01, 4, 0.001, "x"], [0.03, 0.01, 6, 0.004, None]]


def workbook(rows=ROWS, **more):
    book = openpyxl.Workbook()
    for i, (name, some) in enumerate({"loads": rows, **more}.items()):
        sheet = book.active if i == 0 else book.create_sheet()
        sheet.title = name
        for row in some:
            sheet.append(row)
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def changed(content, part, change):
    """Return the workbook with the members whose names hold `part` changed."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w", 8) as new:
        for name in old.namelist():
            data = old.read(name)
            new.writestr(name, change(data) if part in name else data)
    return out.getvalue()


def test_spreadsheet__values_come_back_as_they_are(read):
    found = read(workbook())
    assert found.table.column("p_over_E").tolist() == [0.001, 0.004]
    assert found.table.frame["n"].tolist() == ["x", ""]


def test_spreadsheet__a_header_may_stand_below_blank_rows_and_break_its_line(read):
    rows = [[], [], ["Ridge\nwidth  [mm]", *HEADER[1:]], [0.24, *ROWS[1][1:]], [None] * 5]
    found = read(workbook(rows), mapping={"a": "Ridge width"}, R="8 mm")
    assert found.table.column("a_over_R").tolist() == [0.03]


def test_spreadsheet__rows_that_a_filter_hides_are_read_and_said(read):
    hidden = changed(workbook(), "sheet1", lambda d: d.replace(b'r="3"', b'hidden="1" r="3"', 1))
    found = read(hidden)
    assert len(found.table) == 2
    assert any("sheet 'loads': hidden rows are read too" in line for line in found.messages)
    assert not any("hidden" in line for line in read(workbook()).messages)


@pytest.mark.parametrize("column", [1, 4])
@pytest.mark.parametrize("formula", ["=0.01", "=A2/8", "=SUM(A2:A3)"])
def test_spreadsheet__formulas_are_refused_with_their_cells(refusal, formula, column):
    rows = [HEADER, ROWS[1], [*ROWS[2]]]
    rows[2][column] = formula
    words = refusal(workbook(rows))
    assert f"cell {'ABCDE'[column]}3, column {HEADER[column]!r} = {formula!r}" in words
    assert "not formulas; no value is stored: open the file in Excel or LibreOffice" in words


def test_spreadsheet__a_formula_has_the_value_that_is_stored_of_it(read):
    def cached(data):
        return data.replace(b"<v>0.01</v>", b"<f>A2/3</f><v>0.01</v>", 1)

    found = read(changed(workbook(), "sheet1", cached)).table.frame
    assert found["b_over_R"].iloc[0] == 0.01


def test_spreadsheet__text_with_decimal_commas_stands_beside_numbers(read):
    rows = [HEADER, [0.03, 0.01, 4, "0,001234", "x"], [0.03, 0.01, 6, "0,0056", "y"]]
    assert read(workbook(rows)).table.column("p_over_E").tolist() == [0.001234, 0.0056]


def test_spreadsheet__shares_shown_in_per_cent_are_so_below_a_header_in_per_cent(read):
    # 0.03 shown as 3 %, twice, and 3 typed below a header in per cent.
    rows = [["a_over_R [%]", *HEADER[1:]], ROWS[1], [3, *ROWS[2][1:]]]
    book = openpyxl.load_workbook(io.BytesIO(workbook(rows)))
    book.active["A2"].number_format = book.active["B2"].number_format = "0.0%"
    book.save(out := io.BytesIO())
    table = read(out.getvalue()).table
    assert table.column("a_over_R").tolist() == [0.03, 0.03]
    assert table.column("b_over_R").tolist() == [0.01, 0.01]


def test_spreadsheet__cells_merged_downwards_have_the_value_above(read, refusal):
    rows = [
        HEADER,
        [0.03, 0.01, 4, 0.001, "x"],
        [None, None, 6, 0.004, "x"],
        [0.03, 0.02, 4, 0.0015, "x"],
        [None, None, 6, 0.005, "x"],
    ]
    found = read(workbook(rows))
    assert found.table.column("a_over_R").tolist() == [0.03] * 4
    assert found.table.column("b_over_R").tolist() == [0.01, 0.01, 0.02, 0.02]
    told = "columns 'a_over_R', 'b_over_R': 2 rows with empty cells have the value above"
    assert any(told in line for line in found.messages)
    # One width without the other, no first one, or one lost of a table that is full.
    for at, cells in ((2, [None, 0.01]), (1, [None, None])):
        broken = [[*cells, *one[2:]] if i == at else one for i, one in enumerate(rows)]
        assert "must not be empty" in refusal(workbook(broken))
    lost = [HEADER, *([0.03, 0.01, Q, Q / 4e3, "x"] for Q in (4, 6, 8, 10))]
    lost[3][0] = lost[3][1] = None
    assert "must not be empty" in refusal(workbook(lost))


@pytest.mark.parametrize(
    "cell",
    [datetime.date(2024, 3, 1), datetime.time(3, 4), True, "1 00", "x", "#DIV/0!", 1e-3j],
)
def test_spreadsheet__what_is_no_number_is_refused_with_its_cell(refusal, cell):
    if isinstance(cell, complex):
        content = changed(workbook(), "sheet1", lambda d: d.replace(b"0.004", b"1e400"))
    else:
        content = workbook([HEADER, ROWS[1], [0.03, 0.01, 6, cell, "x"]])
    words = refusal(content)
    assert "cell D3, column 'p_over_E' = " in words
    assert "expected " in words


def test_spreadsheet__rules_of_the_contract_name_rows_of_the_sheet(refusal):
    words = refusal(workbook([[], HEADER, ROWS[1], [0.03, 0.01, 6, 0.0001, "x"]]))
    assert "sheet 'loads', row 2 (line 4), p_over_E = 0.0001" in words


def test_spreadsheet__several_sheets_need_a_name(read, refusal):
    content = workbook(other=[*ROWS[:2]], empty=[])
    assert "2 sheets have cells: 'loads', 'other'; use --sheet (" in refusal(content)
    assert len(read(content, sheet="other").table) == 1
    assert "the sheets are 'loads', 'other', 'empty'" in refusal(content, sheet="third")
    assert "no sheet with cells in 'empty'" in refusal(content, sheet="empty")
    assert "fewer recognised headers: 'n'" in str(read(workbook(n=[["a", "z"], [1, 2]])).messages)
    visible, not_so = b'state="visible"', b'state="hidden"'
    hidden = changed(content, "workbook.xml", lambda d: d.replace(visible, not_so, 1))
    assert len(read(hidden).table) == 1  # the second
    assert len(read(hidden, sheet="loads").table) == 2


def test_spreadsheet__a_false_dimension_cuts_nothing_off(read):
    def smaller(data):
        return re.sub(rb'<dimension ref="[^"]*"', b'<dimension ref="A1:D2"', data)

    assert len(read(changed(workbook(), "sheet1", smaller)).table) == 2


@pytest.mark.parametrize(
    "inserted", [b'<!DOCTYPE x [<!ENTITY e "1">]>', b'<!DOCTYPE x SYSTEM "file:///etc/passwd">']
)
@pytest.mark.parametrize("part", ["sheet1", "styles", "workbook.xml", ".rels"])
def test_spreadsheet__document_types_are_refused(refusal, inserted, part):
    def with_type(data):
        return data.replace(b"?>", b"?>" + inserted, 1) if b"?>" in data else inserted + data

    assert "document type" in refusal(changed(workbook(), part, with_type))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda data: data.decode().encode("utf-16"), "XML as UTF-8"),
        (lambda data: data + b" " * 2**26, "bytes of sheets; expected at most"),
        (lambda data: data.replace(b'<row r="3"', b'<row r="2"'), "rising order"),
        *(
            (lambda data, v=v: data.replace(b"<v>4</v>", f"<v>{v}</v>".encode()), "a number")
            for v in ("1_0", "4١", "&#52;")  # numbers that only Python reads
        ),
        pytest.param(
            lambda data: data.replace(b'<row r="3"', b'<row r="99999999999"'),
            "more than",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_spreadsheet__sheets_that_a_parser_would_misread_are_refused(refusal, change, said):
    assert said in refusal(changed(workbook(), "sheet1", change))


def test_spreadsheet__macros_and_broken_archives_are_refused(refusal):
    out = io.BytesIO(workbook())
    with zipfile.ZipFile(out, "a") as archive:
        archive.writestr("xl/vbaProject.bin", b"x")
    assert "macros" in refusal(out.getvalue())
    assert "not a readable Excel file" in refusal(workbook()[:-200])


def test_spreadsheet__without_openpyxl_the_extra_is_named(refusal, monkeypatch):
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    assert "pip install 'ridgebayes[excel]'" in refusal(workbook())


def test_spreadsheet__all_sheets_of_a_header_are_read_one_after_the_other(read, refusal):
    again = [[0.03, 0.01, 4, 0.0011, "x"], [0.03, 0.01, 6, 0.0045, "y"]]
    first = [HEADER, [0.03, 0.01, 4, 0.001, "x"], [0.03, 0.01, 6, 0.004, "y"]]
    content = workbook(first, July=[[], HEADER, *again], notes=[["a", "b"], [1, 2]])
    found = read(content, sheet="all")
    assert found.table.column("series").tolist() == ["loads", "loads", "July", "July"]
    assert found.table.column("p_over_E").tolist() == [0.001, 0.004, 0.0011, 0.0045]
    assert "sheets ignored, with another header: 'notes'" in found.messages
    merged = workbook(first, July=[HEADER, again[0], [None, None, *again[1][2:]]])
    assert read(merged, sheet="all").table.frame["a_over_R"].tolist() == [0.03] * 4
    broken = workbook(first, July=[[], HEADER, [0.03, 0.01, 4, "oops", "x"]])
    assert "sheet 'July', cell D3, column 'p_over_E' = 'oops'" in refusal(broken, sheet="all")
