"""Tables of any columns become the contract's: units, shapes of tables, and what is refused."""

import pickle
import re

import numpy as np
import pandas as pd
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.record import FileError
from ridgebayes.table.table import read_table
from tests.fea.tables import imported

LONG = (
    "Ridge width [mm],Groove width (um),Q,Load (N/mm),Note\n"
    "0.24,80,4,0.0021,x\n0.24,80,6,0.0087,y\n0.1,80,4,0.003,z\n"
)
MAP = {"a": "Ridge width", "b": "Groove width", "line": "Load"}
BODY = {"R": "8 mm", "E": "60 kPa", "nu": "0.49"}
CONTRACT = "a_over_R,b_over_R,Q,p_over_E\n0.03,0.01,4,0.001\n0.03,0.01,6,0.004\n"


@pytest.fixture
def read(tmp_path):
    def read_text(text, mapping=None, name="mine.csv", **options):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return imported(path, mapping, **options)

    return read_text


@pytest.fixture
def refusal(read):
    def words(*args, **options):
        with pytest.raises(InputError) as caught:
            read(*args, **options)
        text = str(caught.value)
        assert "mine." in text
        assert "\n\n" not in text
        return text

    return words


def column(found, name):
    return found.table.column(name).tolist()


# --- units ------------------------------------------------------------------------------------


def test_read_columns__line_loads_are_over_2RE_and_lengths_over_R(read):
    found = read(LONG, MAP, values=BODY)
    # Equality: the decimals' quotients are exact, 0.24 mm / 8 mm is the number 0.03.
    assert column(found, "a_over_R") == [0.03, 0.03, 0.0125]
    assert column(found, "b_over_R") == [0.01, 0.01, 0.01]
    # 0.0021 N/mm = 2.1 N/m; over 2 x 0.008 m x 60,000 Pa.
    assert column(found, "p_over_E") == [2.1 / 960, 8.7 / 960, 3.0 / 960]
    assert column(found, "nu") == [0.49] * 3


def test_read_columns__pressures_are_over_E(read):
    text = "a_over_R,b_over_R,Q,Pressure [Pa],E [kPa]\n.03,.01,4,90,60\n.03,.01,6,360,60\n"
    assert column(read(text, {"p": "Pressure", "E": "E"}), "p_over_E") == [0.0015, 0.006]


def test_read_columns__lower_ends_and_offsets_convert_as_loads_and_widths_do(read):
    text = "a,b,offset,R,Q,p,p_lower,E\n3,1,0.5,100,4,90,80,60000\n"
    found = read(text)
    assert column(found, "p_over_E_lower") == [80 / 60000]
    assert column(found, "offset_over_R") == [0.005]


def test_read_columns__an_explicit_unit_stands_after_the_header(read):
    text = LONG.replace(" [mm]", "").replace(" (um)", "").replace(" (N/mm)", "")
    mapping = {"a": "Ridge width;mm", "b": "Groove width;um", "line": "Load;N/mm"}
    found = read(text, mapping, values=BODY)
    assert column(found, "a_over_R") == [0.03, 0.03, 0.0125]
    assert column(found, "p_over_E") == [2.1 / 960, 8.7 / 960, 3.0 / 960]
    assert "all units converted" in found.messages


def test_read_columns__numbers_without_any_unit_are_one_system(read):
    text = "w,g,Q,load\n0.24,0.08,4,0.0021\n"
    found = read(text, {"a": "w", "b": "g", "line": "load"}, values={"R": 8, "E": "0.06"})
    assert column(found, "p_over_E") == [0.0021875]
    assert "no units given; one consistent system assumed" in found.messages
    assert "all units converted" not in found.messages


@pytest.mark.parametrize(
    ("values", "bare"),
    [({"R": "8", "E": "60 kPa"}, "R"), ({"R": "8 mm", "E": "60"}, "E")],
)
def test_read_columns__units_on_some_only_are_refused(refusal, values, bare):
    text = refusal(LONG, MAP, values=values)
    assert " in mm, b ('Groove width (um)') in um, " in text
    assert f", but {bare} without a unit; expected units on all columns" in text
    assert "on none" in text


def test_read_columns__a_column_in_percent_is_divided_by_100(read):
    text = "a_over_R,b_over_R,Q,p/E [%]\n.03,.01,4,0.25\n"
    assert column(read(text, {"p_over_E": "p/E"}), "p_over_E") == [0.0025]


def test_read_columns__units_after_an_underscore_are_units(read):
    text = "a_mm,b_um,Q,line_N_per_mm,R_mm,E_kPa\n0.24,80,4,0.00096,8,60\n"
    units = {"a": "mm", "b": "um", "line": "N_per_mm", "R": "mm", "E": "kPa"}
    found = read(text, {key: f"{key}_{unit}" for key, unit in units.items()})
    assert [column(found, name)[0] for name in ("a_over_R", "b_over_R", "p_over_E")] == [
        0.03,
        0.01,
        0.001,
    ]


@pytest.mark.parametrize("header", ["a_per_mm", "ridge mm", "load_N_mm"])
def test_read_columns__a_unit_without_brackets_is_not_passed_over(refusal, header):
    text = f"{header},b,Q,p_over_E\n240,0.08,4,0.001\n"
    assert "may be its unit" in refusal(text, {"a": header, "b": "b"}, values={"R": 8})


def test_read_columns__a_unit_of_another_dimension_is_refused(refusal):
    assert "'N/mm' is no unit of pressure" in refusal(
        LONG, {"a": "Ridge width", "b": "Groove width", "p": "Load"}, values=BODY
    )


def test_read_columns__large_tables_divide_as_small_ones_do(read):
    # Over 10,000 distinct rows are divided as floats: within 4 units of the last place.
    line = np.linspace(1e-3, 2e-3, 12_000).round(9)
    text = "a,b,R,E,series,Q,line\n" + "".join(
        f"0.24,0.08,8,0.06,{i},4,{p!r}\n" for i, p in enumerate(line.tolist())
    )
    found = read(text)
    np.testing.assert_allclose(found.table.column("p_over_E"), line / 0.96, rtol=1e-15)


# --- what is what -----------------------------------------------------------------------------


SPECIMENS = "specimen,a/R,b/R,Q,p/E\n"


@pytest.mark.parametrize("labels", ["112", "122"])
def test_read_columns__specimens_are_series(read, labels):
    rows = (".03,.01,4,.001", ".03,.01,6,.004", ".05,.01,4,.002")
    text = SPECIMENS + "\n".join(f"{one},{row}" for one, row in zip(labels, rows, strict=True))
    found = read(text)
    assert column(found, "series") == list(labels)
    assert found.known["series"] == "specimen"


def test_read_columns__contract_columns_need_no_mapping(read, tmp_path):
    found = read(CONTRACT)
    own = read_table(tmp_path / "mine.csv").frame.drop(columns="source")
    pd.testing.assert_frame_equal(found.table.frame.drop(columns="source"), own)


def test_read_columns__guesses_are_said_aloud(read):
    text = "Ridge width (mm),Groove width (mm),Q,Line load / N/mm\n0.24,0.08,4,0.0021\n"
    text = text.replace("Line load / N/mm", "Line load [N/mm]")
    found = read(text, values=BODY)
    assert column(found, "a_over_R") == [0.03]
    assert "a: column 'Ridge width (mm)' in mm, guessed from its header" in found.messages


def test_read_columns__two_columns_of_one_meaning_are_refused(refusal):
    text = "a_over_R,b_over_R,Q,Pressure [kPa],p [kPa],p [Pa]\n.03,.01,4,1,1,1000\n"
    assert "could each be p" in refusal(text, values={"E": "60 kPa"})


def test_read_columns__a_column_and_a_value_of_one_meaning_are_refused(refusal):
    text = CONTRACT.replace("Q", "nu,Q").replace("01,", "01,0.4,")
    assert "nu is given as a value, and as column 'nu'" in refusal(text, values={"nu": "0.49"})


def test_read_columns__a_header_that_is_not_there_is_named_with_those_that_are(refusal):
    words = refusal(LONG, {**MAP, "a": "Ridge"}, values=BODY)
    assert "no column 'Ridge'" in words
    assert "'Ridge width [mm]'" in words


def test_read_columns__a_header_that_is_nearly_there_is_proposed(read):
    with pytest.raises(FileError, match=r"no column 'Rigde widht'.*did you mean 'Ridge") as told:
        read(LONG, {**MAP, "a": "Rigde widht"}, values=BODY)
    assert told.value.mapping == {"a": "Ridge width [mm]"}


@pytest.mark.parametrize("key", ["A", "p_over_R", "gap", "Q=", "x Q=4"])
def test_read_columns__unknown_keys_are_refused(refusal, key):
    assert "expected " in refusal(LONG, {key: "Q"})


def test_read_columns__own_columns_survive_in_long_tables(read):
    found = read(LONG, MAP, values=BODY)
    assert found.table.frame["Note"].tolist() == ["x", "y", "z"]
    assert "kept as they are: 'Note'" in found.messages


def test_read_columns__an_own_column_that_clashes_is_left_out_and_said(read):
    text = (
        CONTRACT.replace("p_over_E", "p_over_E,p").replace("1\n", "1,60\n").replace("4\n", "4,90\n")
    )
    found = read(text, {"p": "p"}, values={"E": 6000})
    assert column(found, "p_over_E") == [0.01, 0.015]
    assert "column 'p_over_E' ignored: the mapping uses another column" in found.messages


def test_read_columns__source_names_file_digest_mapping_and_keeps_the_files_own(read):
    text = LONG.replace("Note", "source")
    source = column(read(text, MAP, values=BODY), "source")
    pattern = r"import columns: mine\.csv sha256=[0-9a-f]{16} a='Ridge width \[mm\]'.*E=60 kPa.*; x"
    assert re.fullmatch(pattern, source[0])
    assert source[1].endswith("; y")


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"R": "0 mm"}, "above 0"),
        ({"R": "8 kPa"}, "length"),
        ({"R": "1e400"}, "above 0"),
        ({"nu": "half"}, "a number"),
        ({"Q": "4"}, "value 'Q'"),
        ({"radius": "8"}, "value 'radius'"),
    ],
)
def test_read_columns__bad_values_are_refused(refusal, values, words):
    assert words in refusal(LONG, MAP, values={**BODY, **values})


# --- bad cells --------------------------------------------------------------------------------


def test_read_columns__bad_cells_name_line_column_value_and_rule(refusal):
    text = refusal(LONG.replace("0.0087", "-1").replace("0.1,", ","), MAP, values=BODY)
    assert "line 4, column 'Ridge width [mm]' = '': expected not empty" in text
    text = refusal(LONG.replace("0.0087", "-1"), MAP, values=BODY)
    assert text.endswith("line 3, column 'Load (N/mm)' = '-1': expected above 0")


def test_read_columns__rules_of_the_contract_name_lines_of_the_file(refusal):
    words = refusal("\n" + CONTRACT + "\n0.03,0.01,8,0.002\n")
    assert "(line 6): p_over_E = 0.002: must rise with Q along a curve" in words


# --- what strangers write ---------------------------------------------------------------------


def test_read_columns__units_may_stand_in_cells(read):
    text = "Steg;Nut;Kanten;Kraft\n0,24 mm;80 µm;4;2,1 N/m\n0,1 mm;80 µm;4;3 N/m\n"
    found = read(text, values=BODY)
    assert found.table.textures == ((0.03, 0.01), (0.0125, 0.01))
    assert column(found, "p_over_E") == [2.1 / 960, 3.0 / 960]


def test_read_columns__one_cell_in_another_unit_is_refused(refusal):
    text = "Steg;Nut;Kanten;Kraft\n0,24 mm;80 µm;4;2,1 N/m\n100 µm;80 µm;4;3 N/m\n"
    assert "line 3, column 'Steg [mm]' = '100 µm'" in refusal(text, values=BODY)


def test_read_columns__compression_may_be_negative_throughout(read, refusal):
    text = "Ridge [mm],Groove [mm],Q,Force [N/mm]\n0.24,0.08,4,-0.0021\n0.24,0.08,6,-0.0087\n"
    found = read(text, values=BODY)
    assert column(found, "p_over_E") == [2.1 / 960, 8.7 / 960]
    assert any("sign turned" in line for line in found.messages)
    mixed = text.replace("-0.0087", "0.0087")
    assert "line 2, column 'Force [N/mm]' = '-0.0021': expected above 0" in refusal(
        mixed, values=BODY
    )


def test_read_columns__forces_are_over_the_length_of_the_body(read, refusal):
    text = "Ridge [mm],Groove [mm],Q,Force [N]\n0.24,0.08,4,0.042\n"
    assert "--thickness '? mm'" in refusal(text, values=BODY)
    found = read(text, values={**BODY, "thickness": "20 mm"})
    assert column(found, "p_over_E") == [2.1 / 960]


def test_read_columns__groove_widths_may_be_given_as_pitch_and_R_as_diameter(read):
    text = "Land [mm],Pitch [mm],Diameter [mm],Q,p/E\n0.24,0.32,16,4,0.002\n"
    assert read(text).table.textures == ((0.03, 0.01),)


def test_read_columns__of_two_loads_one_is_asked_for(read):
    text = "a/R,b/R,Q,Load [N/mm],Load [kPa]\n0.03,0.01,4,0.0021,1\n"
    with pytest.raises(FileError, match=r"could each be") as told:
        read(text, values=BODY)
    assert told.value.mapping == {"load": "Load [N/mm]"}


@pytest.mark.parametrize(
    ("header", "counts", "options", "Q"),
    [
        ("Ridges in contact", (4, 6), {}, [4, 6]),
        ("Segments", (4, 6), {}, [4, 6]),
        ("Edges per side", (2, 3), {}, [4, 6]),
        ("Contacts", (4, 6), {"count_is": "ridges"}, [4, 6]),
        ("Contacts", (2, 3), {"count_is": "per-side"}, [4, 6]),
    ],
)
def test_read_columns__counts_in_other_terms_become_edges(read, header, counts, options, Q):
    text = f"a/R,b/R,{header},p/E\n.03,.01,{counts[0]},.002\n.03,.01,{counts[1]},.005\n"
    found = read(text, **options)
    assert column(found, "Q") == Q
    assert any(line.startswith("counts of ") for line in found.messages)


@pytest.mark.parametrize(("counts", "likely"), [("46", "edges"), ("23", "per-side")])
def test_read_columns__what_contacts_count_is_asked_for(read, counts, likely):
    text = f"a/R,b/R,Contacts,p/E\n.03,.01,{counts[0]},.002\n.03,.01,{counts[1]},.005\n"
    with pytest.raises(FileError, match="expected --count-is") as told:
        read(text)
    assert told.value.options == {"count_is": likely}


def test_read_columns__repeats_sorted_by_Q_are_no_increments(refusal):
    text = "a_over_R,b_over_R,Q,p_over_E\n" + "".join(
        f".03,.01,{Q},{p}\n" for Q, p in ((4, 0.002), (4, 0.0019), (6, 0.005), (6, 0.0049))
    )
    assert "each Q must stand once in a curve" in refusal(text)


@pytest.mark.parametrize(
    ("counts", "term", "said"),
    [
        ("0", "Ridges in contact", "1 row: expected Q of 4 or more in some row, got a count of 0"),
        (
            "0202",
            "Ridges in contact",
            "4 rows: expected Q of 4 or more in some row, got a count of 2",
        ),
        # These repeat while loads rise.
        (
            "2222",
            "Ridges in contact",
            "4 rows: expected Q of 4 or more in some row, got a count of 2",
        ),
        ("11", "Edges per side", "2 rows: expected Q of 4 or more in some row, got a count of 1"),
    ],
)
def test_read_columns__counts_that_are_all_under_4_are_refused(refusal, counts, term, said):
    rows = "".join(f".03,.01,{Q},{0.001 * i}\n" for i, Q in enumerate(counts, start=1))
    assert refusal(f"a/R,b/R,{term},p/E\n{rows}").endswith(
        f"mine.csv: column '{term}', {said} at most: that many touch at any load"
    )


def test_read_columns__wide_tables_of_counts_under_4_are_refused(refusal):
    assert "mine.csv: Q, 1 row: expected Q of 4" in refusal("a/R,b/R,Q=0,Q=2\n.03,.01,,.1\n")


def test_read_columns__counts_under_4_do_not_hide_other_bad_cells(refusal):
    said = refusal("a/R,b/R,Q,p/E\n.03,.01,2,x1\n")
    assert "line 2, column 'p/E' = 'x1': expected a finite number" in said
    assert "of 4" not in said


def test_read_columns__odd_counts_under_4_are_told_by_their_lines(refusal):
    rows = "".join(f".03,.01,3,{0.001 * i}\n" for i in range(1, 4))
    assert "Q, 3 rows: must be even" in refusal(f"a/R,b/R,Q,p/E\n{rows}")


def test_read_columns__columns_of_repeats_that_are_all_empty_are_refused(refusal):
    text = "a/R,b/R,Q,Load 1 [kPa],Load 2 [kPa]\n.03,.01,4,,\n.03,.01,6,,\n"
    said = refusal(text, values=BODY)
    assert "mine.csv: columns 'Load 1 [kPa]', 'Load 2 [kPa]': expected a number in some" in said


REPEATS = "Specimen,Repeat,a/R,b/R,Q,p/E\n"


def test_read_columns__repeats_and_specimens_make_one_series(read):
    rows = [f"S{s},{n},.03,.01,{Q},.00{s}{n}{Q}" for s in (1, 2) for n in (1, 2) for Q in (4, 6)]
    found = read(REPEATS + "\n".join(rows))
    assert column(found, "series") == [f"S{s}, {n}" for s in (1, 2) for n in (1, 2) for _ in "46"]
    assert "series: Specimen, Repeat, joined" in found.messages


def test_read_columns__a_number_for_each_row_is_no_series(read):
    rows = [f"{n},.03,.01,{Q},.00{Q}" for n, Q in enumerate((4, 6, 8), start=1)]
    text = "Test no,a/R,b/R,Q,p/E\n" + "\n".join(rows)
    found = read(text)
    assert column(found, "series") == ["", "", ""]
    assert found.table.frame["Test no"].tolist() == [1, 2, 3]
    assert "series" not in found.known
    assert column(read(text, {"series": "Test no"}), "series") == ["1", "2", "3"]


def test_read_columns__columns_of_loads_are_repeats(read):
    text = "a/R,b/R,Q,Force 1 (N),Force 2 (N)\n.03,.01,4,.024,.036\n.03,.01,6,.096,\n"
    found = read(text, values=BODY | {"thickness": "20 mm"})
    assert column(found, "series") == ["1", "2", "1"]
    # F / (L 2 R E) = F / 19.2 N.
    np.testing.assert_allclose(column(found, "p_over_E"), [0.00125, 0.001875, 0.005])
    assert any("1 empty cells: not measured" in line for line in found.messages)


MEANS = "a/R,b/R,Edges,Force mean (N),Force sd (mN)"


@pytest.mark.parametrize(
    ("header", "cells", "rel_se"),
    [
        ("", ("", ""), [0.125, 0.05]),
        (",n", (",4", ",25"), [0.0625, 0.01]),
        (",n,rel_se", (",4,.1", ",25,0"), [np.hypot(0.0625, 0.1), 0.01]),
    ],
)
def test_read_columns__a_deviation_beside_a_mean_is_its_error(read, header, cells, rel_se):
    rows = (".03,.01,4,.024,3", ".03,.01,6,.1,5")
    lines = [MEANS + header, *(row + more for row, more in zip(rows, cells, strict=True))]
    found = read("\n".join(lines), values=BODY | {"thickness": "20 mm"})
    np.testing.assert_allclose(column(found, "rel_se"), rel_se)


@pytest.mark.parametrize(
    ("load_se", "header", "load"),
    [
        ("0.0048 N", "Force [N]", ".024"),
        ("4.8 mN", "P [N/mm]", ".0012"),
        ("0.24 N/m", "Force [N]", ".024"),
        ("15 Pa", "Force [N]", ".024"),
        ("0.00025", "p/E", ".00125"),
    ],
)
def test_read_columns__an_error_of_all_loads_is_a_share_of_each(read, load_se, header, load):
    values = BODY | {"thickness": "20 mm", "load_se": load_se}
    mapping = {"line": "P"} if header.startswith("P") else {}
    text = f"a/R,b/R,Q,{header},rel_se\n.03,.01,4,{load},0\n.03,.01,6,{4 * float(load)},.12\n"
    found = read(text, mapping, values=values)
    # A fifth of the first load, a twentieth of the second: in quadrature with its own.
    np.testing.assert_allclose(column(found, "rel_se"), [0.2, 0.13])


def test_read_columns__an_error_of_all_loads_is_that_of_brackets(read):
    rows = "".join(f".03,.01,{Q},{p}\n" for Q, p in ((2, 1), (4, 2), (4, 3), (6, 4), (6, 5)))
    found = read("a/R,b/R,Q,p [kPa]\n" + rows, values=BODY | {"load_se": "0.2 kPa"})
    np.testing.assert_allclose(column(found, "rel_se"), [0.1, 0.05])


@pytest.mark.parametrize("load_se", ["0 N", "-1 N", "0.05 mm", "x", "1 N N"])
def test_read_columns__an_error_that_is_none_is_refused(refusal, load_se):
    text = "a/R,b/R,Q,Force [N]\n.03,.01,4,.024\n"
    said = refusal(text, values=BODY | {"thickness": "20 mm", "load_se": load_se})
    assert f"--load-se '{load_se}': expected a number above 0 and a unit of loads" in said


EMPTY = "a/R,b/R,Q,p/E,why\n.03,.01,4,.001,\n.03,.01,6,,slipped\n.03,.01,8,.009,\n"


def test_read_columns__rows_without_a_load_are_left_out_if_asked(read, refusal):
    found = read(EMPTY, skip_empty=True)
    assert column(found, "Q") == [4, 8]
    assert "1 rows without a load left out: slipped" in found.messages
    said = refusal(EMPTY)
    assert "line 3, column 'p/E' = '': expected a load; --skip-empty leaves out rows" in said


def test_read_columns__a_load_that_is_broken_is_not_offered_to_be_left_out(read):
    with pytest.raises(FileError) as caught:
        read(EMPTY.replace(".009", "oops").replace(",,slipped", ",.005,slipped"))
    assert "skip_empty" not in caught.value.options
    with pytest.raises(FileError) as caught:
        read(EMPTY.replace(",,slipped", ",n/a,slipped"))
    assert {"skip_empty", "empty"} <= caught.value.options.keys()


@pytest.mark.parametrize(
    "rows",
    [
        ".03,.01,4,x1\n",
        ".03,.01,4,x1\n.03,.01,4,x2\n.03,.01,4,x3\n",
        ".03,.01,4,.1\n.03,.01,4,.2\n.03,.01,4,.3\n.02,.01,4,x1\n",
    ],
)
def test_read_columns__runs_without_any_load_name_its_cells(refusal, rows):
    said = refusal(f"a/R,b/R,Q,p/E\n{rows}")
    assert "column 'p/E'" in said
    assert "'x1'" in said
    assert "expected a finite number" in said


def test_read_columns__points_where_the_user_says_comma_are_refused_by_cell(refusal):
    said = refusal("a/R,b/R,Q,p/E\n.03,.01,4,0.0021\n.03,.01,6,0.0087\n", decimal="comma")
    assert "column 'p/E', 2 cells: expected a finite number, with a comma" in said
    assert "line 2 = '0.0021', line 3 = '0.0087'" in said


# --- wide tables ------------------------------------------------------------------------------

WIDE = "a_over_R,b_over_R,{0}4{1},{0}6{1},{0}8{1}\n.03,.01,1,4,\n.02,.01,2,,9\n"


@pytest.mark.parametrize(
    ("before", "after", "mapping", "scale"),
    [
        ("Q=", " [kPa]", {}, 60),
        ("Q=", " [kPa]", {"Q": "*"}, 60),
        ("p Q=", " [kPa]", {}, 60),
        ("Force at ", " [kPa]", {"p": "Force at *"}, 60),
        ("Force at ", "", {"p": "Force at *;kPa"}, 60),
        ("line Q", " [N/mm]", {}, 0.96),
    ],
)
def test_read_columns__wide_tables_have_a_row_for_each_Q_that_was_reached(
    read, before, after, mapping, scale
):
    found = read(WIDE.format(before, after), mapping, values={"E": "60 kPa", "R": "8 mm"})
    assert column(found, "Q") == [4, 6, 4, 8]
    # rtol 1e-15: one division beside the exact quotient.
    np.testing.assert_allclose(
        found.table.column("p_over_E"), np.array([1, 4, 2, 9]) / scale, rtol=1e-15
    )
    assert "2 empty cells: not reached" in found.messages


def test_read_columns__plain_loads_of_wide_tables_are_p_over_E_unless_there_is_an_E(read, refusal):
    assert column(read(WIDE.format("Q=", "")), "p_over_E") == [1, 4, 2, 9]
    assert "p/E, pressure, line load or force" in refusal(WIDE.format("Q=", ""), values={"E": "60"})


def test_read_columns__wide_tables_may_have_lower_ends(read):
    text = "a_over_R,b_over_R,Q=4,Q=6,low Q=6\n.03,.01,0.002,0.008,0.007\n.02,.01,,0.009,\n"
    found = read(text, {"p_over_E_lower": "low Q=*"})
    assert column(found, "Q") == [4, 6, 6]
    np.testing.assert_array_equal(found.table.column("p_over_E_lower"), [np.nan, 0.007, np.nan])


def test_read_columns__words_alone_in_wide_cells_are_told_by_cell(refusal):
    said = refusal("a/R,b/R,Q=4,Q=6\n.03,.01,x1,\n")
    assert "line 2, column 'Q=4' = 'x1': expected a finite number" in said


def test_read_columns__one_Q_in_two_columns_is_refused(refusal):
    text = "a_over_R,b_over_R,Q=4,Q4\n.03,.01,0.002,0.001\n"
    assert "'Q=4', 'Q4' could each be" in refusal(text)


# --- increments -------------------------------------------------------------------------------


def history(words, *, n=8):
    return (
        "a_over_R,b_over_R,p_over_E,"
        + words[0]
        + "\n"
        + "".join(f".03,.01,{i / 1000},{words[1](i)}\n" for i in range(1, n))
    )


def test_read_columns__gaps_tell_the_load_within_an_increment(read):
    text = history(("gap Q=4,gap Q=6", lambda i: f"{7 - 2 * i},{11 - 2 * i}"))
    found = read(text, values={"R": 100})
    # Straight gaps: 0 at 3.5 and 5.5; 1e-12 of rounding in the extrapolation.
    np.testing.assert_allclose(found.table.column("p_over_E"), [0.0035, 0.0055], rtol=1e-12)
    assert column(found, "Q") == [4, 6]


def test_read_columns__brackets_keep_the_increment(read):
    text = history(("gap Q=4,gap Q=6", lambda i: f"{7 - 2 * i},{11 - 2 * i}"))
    found = read(text, values={"R": 100}, brackets=True)
    assert column(found, "p_over_E_lower") == [0.003, 0.005]
    assert column(found, "p_over_E") == [0.004, 0.006]


@pytest.mark.parametrize(
    ("header", "cell"),
    [
        ("status Q=4", lambda i: "open" if i < 4 else "Closed"),
        ("status Q=4", lambda i: int(i >= 4)),
        ("pressure Q=4", lambda i: 0 if i < 4 else 0.3),
    ],
)
def test_read_columns__status_and_pressure_bracket_the_load(read, header, cell):
    found = read(history((header, cell)))
    assert column(found, "p_over_E_lower") == [0.003]
    assert column(found, "p_over_E") == [0.004]


def test_read_columns__each_texture_and_series_is_a_run_of_its_own(read):
    one = history(("status Q=4", lambda i: int(i >= 4)))
    other = "\n".join(line.replace(".03", ".05") for line in one.splitlines()[1:])
    found = read(one + other.replace(",1", ",0", 1))
    assert found.table.textures == ((0.03, 0.01), (0.05, 0.01))
    assert "status Q=4: column 'status Q=4'" in found.messages


def test_read_columns__corners_in_the_wrong_order_are_refused(refusal):
    text = history(("status Q=6,status Q=4", lambda i: f"{int(i > 2)},{int(i > 4)}"))
    words = refusal(text)
    assert "Q = 6 is touched at p/E = 0.003, before Q = 4; expected inner corners first" in words


def test_read_columns__increments_that_failed_are_left_out(read):
    text = history(("status Q=4,status", lambda i: f"{int(i >= 3)},{'ok' if i != 3 else 'cut'}"))
    found = read(text)
    assert column(found, "p_over_E") == [0.004]
    assert "1 increments ignored: their status is not 'ok'" in found.messages


def test_read_columns__codes_of_contact_programs_are_refused(refusal):
    text = history(("status Q=4", lambda i: min(i, 3)))
    words = refusal(text)
    assert "6 cells: expected open or 0, closed or 1" in words
    assert "line 3 = '2', line 4 = '3', line 5 = '3' and 3 more" in words


# --- files ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["mine.csv", "mine.tsv", "mine.xlsx", "mine.parquet"])
@pytest.mark.parametrize("protocol", range(2, 6))
def test_read_columns__a_pickle_in_disguise_is_not_opened(refusal, name, protocol):
    class Bomb:
        def __reduce__(self):
            return pytest.fail, ("unpickled",)

    assert "a pickle" in refusal(pickle.dumps(Bomb(), protocol), name=name)


@pytest.mark.parametrize("name", ["mine.xls", "mine.xlsm", "mine.xlsb"])
def test_read_columns__workbooks_with_macros_are_refused_by_suffix(refusal, name):
    assert "macros" in refusal(b"PK\x03\x04", name=name)


@pytest.mark.parametrize("name", ["mine.pkl", "mine.json", "mine.ods", "mine.feather"])
def test_read_columns__other_suffixes_are_refused(refusal, name):
    assert "a suffix of .csv" in refusal(CONTRACT, name=name)


@pytest.mark.parametrize(
    ("name", "content"),
    [("mine.csv", b"PK\x03\x04"), ("mine.csv", b"PAR1"), ("mine.xlsx", CONTRACT.encode())],
)
def test_read_columns__a_suffix_that_lies_is_refused(refusal, name, content):
    assert "a suffix that tells the format" in refusal(content, name=name)


@pytest.mark.parametrize("name", ["mine.csv", "mine.xlsx", "mine.parquet"])
def test_read_columns__an_empty_file_is_refused(refusal, name):
    assert "empty" in refusal(b"", name=name)


def test_read_columns__a_sheet_of_a_text_file_is_refused(refusal):
    assert "--sheet" in refusal(CONTRACT, sheet="one")


@pytest.mark.parametrize(
    ("cell", "number"),
    [("0.12D-02", 0.0012), ("0.48-002", 0.0048), (".19d-01", 0.019), ("0.314+001", 3.14)],
)
def test_read_columns__exponents_of_fortran_are_read_and_said(read, cell, number):
    found = read(f"a_over_R b_over_R Q p_over_E\n.03 .01 4 {cell}\n.03 .02 4 1.0E-03\n")
    np.testing.assert_allclose(found.table.column("p_over_E"), [number, 0.001], rtol=1e-15)
    assert f"1 number with an exponent of Fortran's, such as '{cell}' = {number:g}" in " ".join(
        found.messages
    )


@pytest.mark.parametrize("cell", ["12-120", "0.5-20", "1.5-2000", "1.5E-", "D-02"])
def test_read_columns__ranges_are_no_exponents(refusal, cell):
    words = refusal(f"a_over_R,b_over_R,Q,p_over_E\n.03,.01,4,{cell}\n.03,.02,4,1.0E-03\n")
    assert f"= {cell!r}: expected a finite number" in words


FIXED = (
    "  INC ridge_mm groove_mm edges   uy_mm load_N/mm\n"
    "    1    0.240    0.080     4 -0.9500-0.0012480\n"
    "    2    0.240    0.080     6 -1.8500-0.0048000\n"
)


def test_read_columns__columns_that_touch_are_parted_before_signs(read):
    found = read(FIXED, values={"R": "8 mm", "E": "60 kPa"})
    np.testing.assert_allclose(found.table.column("p_over_E"), [0.0013, 0.005], rtol=1e-12)
    assert any("line 2: columns run together" in line for line in found.messages)


def test_read_columns__columns_that_touch_otherwise_are_told(refusal):
    words = refusal(FIXED.replace("2    0.240    0.080", "2    0.2400.080"))
    assert "line 2: columns run together" in words
    assert "expected blanks between columns" in words
