"""Tables of any columns become the contract's: units, shapes of tables, and what is refused."""

import pickle
import re

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb

LONG = (
    "Ridge width [mm],Groove width (um),Q,Load (N/mm),Note\n"
    "0.24,80,4,0.0021,x\n0.24,80,6,0.0087,y\n0.1,80,4,0.003,z\n"
)
MAP = {"a": "Ridge width", "b": "Groove width", "line": "Load"}
BODY = {"R": "8 mm", "E": "60 kPa", "nu": "0.49"}
SLICE = BODY | {"thickness": "20 mm"}
CONTRACT = "a_over_R,b_over_R,Q,p_over_E\n0.03,0.01,4,0.001\n0.03,0.01,6,0.004\n"
RATIOS = "a/R,b/R,Q,p/E\n"
# 0.0021 N/mm = 2.1 N/m; over 2 x 0.008 m x 60,000 Pa.
P_OVER_E = [2.1 / 960, 8.7 / 960, 3.0 / 960]


def column(table, name):
    return table.table.column(name).tolist()


def without_units(text):
    return text.replace(" [mm]", "").replace(" (um)", "").replace(" (N/mm)", "")


UNITS = {"mapping": {"a": "Ridge width;mm", "b": "Groove width;um", "line": "Load;N/mm"}}
UNDERSCORES = {"a": "a_mm", "b": "b_um", "line": "line_N_per_mm", "R": "R_mm", "E": "E_kPa"}


# Equality: quotients of decimals are exact, 0.24 mm / 8 mm is the number 0.03.
@pytest.mark.parametrize(
    ("text", "columns", "given"),
    [
        (LONG, {"p_over_E": P_OVER_E, "a_over_R": [0.03, 0.03, 0.0125]}, BODY | {"mapping": MAP}),
        (without_units(LONG), {"p_over_E": P_OVER_E, "b_over_R": [0.01] * 3}, BODY | UNITS),
        (without_units(LONG), {"b_over_R": [10.0] * 3}, {"mapping": MAP, "R": "8", "E": "60"}),
        (LONG, {"Note": ["x", "y", "z"], "nu": [0.49] * 3}, BODY | {"mapping": MAP}),
        (
            "a_over_R,b_over_R,Q,Pressure [Pa],E [kPa]\n.03,.01,4,90,60\n.03,.01,6,360,60\n",
            {"p_over_E": [0.0015, 0.006]},
            {"mapping": {"p": "Pressure", "E": "E"}},
        ),
        (
            "a,b,offset,R,Q,p,p_lower,E\n3,1,0.5,100,4,90,80,60000\n",
            {"p_over_E_lower": [80 / 60000], "offset_over_R": [0.005]},
            {},
        ),
        (RATIOS.replace("E", "E [%]") + ".03,.01,4,0.25\n", {"p_over_E": [0.0025]}, {}),
        (f"T,{RATIOS}°C,%,%,-,%\n21,3,1,4,0.25\n", {"a_over_R": [0.03]}, {}),
        (
            "a/D,Groove/diameter,Q,p/E\n.015,.005,4,0.002\n",
            {"a_over_R": [0.03], "b_over_R": [0.01]},
            {},
        ),
        (
            "a_mm,b_um,Q,line_N_per_mm,R_mm,E_kPa\n0.24,80,4,0.00096,8,60\n",
            {"a_over_R": [0.03], "b_over_R": [0.01], "p_over_E": [0.001]},
            {"mapping": UNDERSCORES},
        ),
        (
            "Steg [mm];Nut;Kanten;Kraft\n0,24 mm;80 µm;4;2,1 N/m\n0,1;80 µm;4;3 N/m\n",
            {"a_over_R": [0.03, 0.0125], "p_over_E": P_OVER_E[::2]},
            BODY,
        ),
        (
            "Ridge [mm],Groove [mm],Q,Force [N/mm]\n0.24,0.08,4,-0.0021\n0.24,0.08,6,-0.0087\n",
            {"p_over_E": P_OVER_E[:2]},
            BODY,
        ),
        (
            "Ridge [mm],Groove [mm],Q,Force [N]\n0.24,0.08,4,0.042\n",
            {"p_over_E": P_OVER_E[:1]},
            SLICE,
        ),
        *(
            (
                f"{width} [mm],Pitch [mm],Diameter [mm],Q,p/E\n{mm},0.32,16,4,0.002\n",
                {"a_over_R": [0.03], "b_over_R": [0.01]},
                {},
            )
            for width, mm in (("Land", 0.24), ("Groove", 0.08))
        ),
        (
            "Ridge [mm],Groove [mm],Q,Force [N],R [mm]\n0.3,0.5,4,0.041,9\n",
            {"a_over_R": [1 / 30], "b_over_R": [1 / 18]},
            {name: SLICE[name] for name in ("E", "thickness")},
        ),
        (
            CONTRACT.replace("E\n", "E,p\n").replace("1\n", "1,60\n").replace("4\n", "4,90\n"),
            {"p_over_E": [0.01, 0.015]},
            {"mapping": {"p": "p"}, "E": "6000"},
        ),
    ],
)
def test_import__units_convert_exactly(read, text, columns, given):
    table = read(text, **given)
    for name, values in columns.items():
        assert column(table, name) == values


def test_import__large_tables_divide_as_small_ones_do(read):
    # Over 10,000 distinct rows are divided as floats: within 4 units of the last place.
    line = np.linspace(1e-3, 2e-3, 12_000).round(9)
    text = "a,b,R,E,series,Q,line\n" + "".join(
        f"0.24,0.08,8,0.06,{i},4,{p!r}\n" for i, p in enumerate(line.tolist())
    )
    np.testing.assert_allclose(read(text).table.column("p_over_E"), line / 0.96, rtol=1e-15)


def test_import__contract_columns_need_no_mapping(read, tmp_path):
    frame = read(CONTRACT).table.frame.drop(columns="source")
    plain = rb.read_table(tmp_path / "mine.csv").frame.drop(columns="source")
    pd.testing.assert_frame_equal(frame, plain)


def test_import__source_names_file_digest_mapping_and_keeps_the_files_own(read):
    source = column(read(LONG.replace("Note", "source"), MAP, **BODY), "source")
    pattern = r"import columns: mine\.csv sha256=[0-9a-f]{16} a='Ridge width \[mm\]'.*E=60 kPa.*; x"
    assert re.fullmatch(pattern, source[0])
    assert source[1].endswith("; y")


REPEATS = [f"S{s},{n},.03,.01,{Q},.00{s}{n}{Q}\n" for s in (1, 2) for n in (1, 2) for Q in (4, 6)]
NUMBERED = "Test no,a/R,b/R,Q,p/E\n1,.03,.01,4,.004\n2,.03,.01,6,.006\n"
FORCES = "a/R,b/R,Q,Force 1 (N),Force 2 (N)\n.03,.01,4,.024,.036\n.03,.01,6,.096,\n"


@pytest.mark.parametrize(
    ("args", "series", "said"),
    [
        (
            ["specimen,a/R,b/R,Q,p/E\n1,.03,.01,4,.001\n2,.03,.01,6,.004\n2,.05,.01,4,.002\n"],
            ["1", "2", "2"],
            "series: column 'specimen', guessed",
        ),
        (
            ["Specimen,Repeat," + RATIOS + "".join(REPEATS)],
            [f"S{s}, {n}" for s in (1, 2) for n in (1, 2) for _ in "46"],
            "series: Specimen, Repeat, joined",
        ),
        (
            ["lab,a/R,b/R,Q,p/E\nA,.03,.01,4,.001\nA,.03,.01,6,.004\nB,.03,.01,4,.002\n"],
            list("AAB"),
            "column 'lab'",
        ),
        ([NUMBERED], ["", ""], "'Test no' is not taken as series: it numbers the rows"),
        ([NUMBERED, {"series": "Test no"}], ["1", "2"], "series: column 'Test no'"),
        ([FORCES], ["1", "2", "1"], "1 empty cells: not measured"),
    ],
)
def test_import__specimens_and_repeats_are_series(read, args, series, said):
    table = read(*args, **(SLICE if "Force" in args[0] else {}))
    assert column(table, "series") == series
    assert any(said in line for line in table.messages)
    if "Force" in args[0]:  # F / (L 2 R E) = F / 19.2 N
        np.testing.assert_allclose(column(table, "p_over_E"), [0.00125, 0.001875, 0.005])


@pytest.mark.parametrize(
    ("header", "counts", "options"),
    [
        ("Ridges in contact", (4, 6), {}),
        ("Segments", (4, 6), {}),
        ("Edges per side", (2, 3), {}),
        ("Contacts", (4, 6), {"count_is": "ridges"}),
        ("Contacts", (2, 3), {"count_is": "per-side"}),
    ],
)
def test_import__counts_in_other_terms_become_edges(read, header, counts, options):
    text = f"a/R,b/R,{header},p/E\n.03,.01,{counts[0]},.002\n.03,.01,{counts[1]},.005\n"
    table = read(text, **options)
    assert column(table, "Q") == [4, 6]
    assert any(line.startswith("counts of ") for line in table.messages)


@pytest.mark.parametrize(
    ("header", "cells", "rel_se"),
    [
        ("Force sd (mN)", ("", ""), [0.125, 0.05]),
        ("SEM (mN)", ("", ""), [0.125, 0.05]),
        ("Force sd (mN),n", (",4", ",25"), [0.0625, 0.01]),
        ("Force sd (mN),Anzahl Messungen", (",4", ",25"), [0.0625, 0.01]),
        ("Standard error (mN),n", (",4", ",25"), [0.125, 0.05]),
        ("SEM (%)", ("", ""), [0.03, 0.05]),
        *((f"{sd},n", (",4", ",25"), [0.015, 0.01]) for sd in ("sd (%)", "CV [%]", "Rel. sd [%]")),
        ("Force sd (mN),n,rel_se", (",4,.1", ",25,0"), [np.hypot(0.0625, 0.1), 0.01]),
    ],
)
def test_import__an_error_beside_a_mean_is_that_of_the_load(read, header, cells, rel_se):
    lines = [f".03,.01,4,.024,3{cells[0]}", f".03,.01,6,.1,5{cells[1]}"]
    text = "\n".join([f"a/R,b/R,Edges,Force mean (N),{header}", *lines])
    np.testing.assert_allclose(column(read(text, **SLICE), "rel_se"), rel_se)


@pytest.mark.parametrize(
    ("header", "cell", "said"),
    [
        ("error (N)", ".01", "kept as they are: 'error (N)'"),
        ("SD (N),Sample", ".01,1", "repeats with an sd of their own"),
        ("SD (N)", "", "2 rows without an error of their own: rel_se is 0"),
        ("R (mm),Diameter (mm)", "8,8", "column 'Diameter (mm)' is 50 % off R + R"),
    ],
)
def test_import__columns_that_say_more_of_loads_are_spoken_of(read, header, cell, said):
    rows = [f".03,.01,{Q},{load},{cell}" for Q, load in ((4, 0.024), (6, 0.096))]
    rows += [row[:-1] + "2" for row in rows if "Sample" in header]
    given = {key: text for key, text in SLICE.items() if key != "R" or "R (" not in header}
    table = read("\n".join([f"a/R,b/R,Q,force (N),{header}", *rows]), **given)
    assert any(message.startswith(said) for message in (*table.messages, *table.doubts))


def test_import__a_length_that_no_load_needs_is_kept_whatever_its_unit(read):
    table = read("a/R,b/R,Q,p/E,R (foo),D (mm)\n.03,.01,4,.001,8,20\n.03,.01,6,.004,8,20\n")
    assert "kept as they are: 'R (foo)', 'D (mm)'" in table.messages
    assert table.doubts == ()


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
def test_import__an_error_of_all_loads_is_a_share_of_each(read, load_se, header, load):
    loads = (float(load) / 2, load, 4 * float(load))  # the first touches two edges: left out
    rows = (
        f".03,.01,{Q},{p},{se}\n" for Q, p, se in zip((2, 4, 6), loads, (0, 0, 0.12), strict=True)
    )
    text = f"a/R,b/R,Q,{header},rel_se\n" + "".join(rows)
    mapping = {"line": "P"} if header.startswith("P") else {}
    # A fifth of the first load, a twentieth of the second: in quadrature with its own.
    table = read(text, mapping, load_se=load_se, **SLICE)
    np.testing.assert_allclose(column(table, "rel_se"), [0.2, 0.13])


def test_import__an_error_of_all_loads_is_that_of_brackets(read):
    rows = "".join(f".03,.01,{Q},{p}\n" for Q, p in ((2, 1), (4, 2), (4, 3), (6, 4), (6, 5)))
    table = read("a/R,b/R,Q,p [kPa]\n" + rows, load_se="0.2 kPa", **BODY)
    np.testing.assert_allclose(column(table, "rel_se"), [0.1, 0.05])


EMPTY = "a/R,b/R,Q,p/E,why\n.03,.01,4,.001,\n.03,.01,6,,slipped\n.03,.01,8,.009,\n"


def test_import__rows_without_a_load_are_left_out_if_asked(read, refusal):
    table = read(EMPTY, skip_empty=True)
    assert column(table, "Q") == [4, 8]
    assert "1 row without a load left out: slipped" in table.messages
    said = refusal(EMPTY)
    assert "line 3, column 'p/E' = '': expected a load; --skip-empty leaves out rows" in said
    refusal(EMPTY.replace(".009", "oops").replace(",,slipped", ",.005,slipped"))
    assert "skip_empty" not in refusal.error.options
    refusal(EMPTY.replace(",,slipped", ",n/a,slipped"))
    assert {"skip_empty", "empty"} <= refusal.error.options.keys()


# --- what is refused ----------------------------------------------------------------------------


def rows(*cells, header=RATIOS):
    """Rows of one texture, of Q and load."""
    return header + "".join(f".03,.01,{cell}\n" for cell in cells)


def history(header, cells):
    lines = (f".03,.01,{i / 1000},{cells(i)}\n" for i in range(1, 8))
    return f"a_over_R,b_over_R,p_over_E,{header}\n" + "".join(lines)


def counts(term, *numbers):
    header = RATIOS.replace("Q", term)
    return rows(*(f"{Q},{0.001 * i}" for i, Q in enumerate(numbers, start=1)), header=header)


PRESSURES = "a_over_R,b_over_R,Q,Pressure [kPa],p [kPa],p [Pa]\n.03,.01,4,1,1,1000\n"
TWO_LOADS = "a/R,b/R,Q,Load [N/mm],Load [kPa]\n0.03,0.01,4,0.0021,1\n"
OUTER_FIRST = history("status Q=6,status Q=4", lambda i: f"{int(i > 2)},{int(i > 4)}")
OF_MEAN = RATIOS.replace("E", "E,sd,n")
UNDER_4 = "rows, a count of 2 at most: expected Q of 4 or more in some row"
CELLS = "Steg;Nut;Kanten;Kraft\n0,24 mm;80 µm;4;2,1 N/m\n100 µm;80 µm;4;3 N/m\n"
FIXED = (
    "  INC ridge_mm groove_mm edges   uy_mm load_N/mm\n"
    "    1    0.240    0.080     4 -0.9500-0.0012480\n"
    "    2    0.240    0.080     6 -1.8500-0.0048000\n"
)


@pytest.mark.parametrize(
    ("text", "mapping", "facts", "said"),
    [
        (LONG, MAP, {"R": "8", "E": "60 kPa"}, "but R without a unit; expected units on all col"),
        (LONG, MAP, {"R": "8 mm", "E": "60"}, " in mm, b ('Groove width (um)') in um, "),
        (LONG, {**MAP, "a_over_R": "Q"}, BODY, "could all be a; expected one"),
        (LONG, {**MAP, "p": "Load"}, BODY, "could all be line; expected one"),
        (LONG, {"a": "Ridge width", "b": "Groove width", "p": "Load"}, BODY, "no unit of pressure"),
        (RATIOS + ".03,.01,4,.002 ± .0001\n", {}, {}, "expected a finite number, with a point"),
        ("a/R,b/R,Q,load (g)\n.03,.01,4,3\n", {}, BODY, "'g' is no unit of loads (gf is one)"),
        (RATIOS.replace(",", ";") + ".03;.01;4;2,5\n", {}, {"decimal": "comma"}, "= '.01'"),
        (LONG, {**MAP, "a": "Ridge"}, BODY, "no column 'Ridge'; the columns are 'Ridge width"),
        (f"R [mm],{LONG}", MAP, BODY, "R is given as '8 mm', and as column 'R [mm]': expected one"),
        (f"Diameter [mm],{LONG}", MAP, BODY, "R is given as '8 mm', and as column 'Diameter"),
        (PRESSURES, {}, {"E": "60 kPa"}, "'p [kPa]', 'p [Pa]' could all be p"),
        (f"edges,,edges,,{RATIOS[:-7]},p/E\n4,,4,,.03,.01,1\n", {}, {}, "below each other"),
        (TWO_LOADS, {}, BODY, "'Load [N/mm]', 'Load [kPa]' could all be load"),
        ("a/R,b/R,Q,force (N),force (N)\n.03,.01,4,1,2\n", {}, BODY, "'force #5 [N]' could all"),
        (
            "a/R,b/R,p Q=4 [kPa],p Q=6 [Pa]\n.03,.01,1,4000\n",
            {},
            BODY,
            "p [Pa], p [kPa]; expected a load for each Q in one unit",
        ),
        ("a/R,b/R,Q=4,p [kPa]\n.03,.01,1,4\n", {"load": "p"}, BODY, "also column 'p [kPa]'; exp"),
        ("a/R,b/R,Q=4,Q4\n.03,.01,.1,.2\n", {}, {}, "'Q=4', 'Q4' could all be load Q=4"),
        (
            CONTRACT.replace("Q", "nu,Q"),
            {},
            {"nu": "0.4"},
            "nu is given as '0.4', and as column 'nu'",
        ),
        (LONG, MAP, BODY | {"R": "0 mm"}, "above 0"),
        (LONG, MAP, BODY | {"R": "8 kPa"}, "a finite number above 0 and a unit of length"),
        (LONG, MAP, BODY | {"E": "60 kPa ± 5 %"}, "a unit of pressure; its error is common to all"),
        (LONG, MAP, BODY | {"R": "1e400"}, "above 0"),
        (LONG, MAP, BODY | {"nu": "half"}, "nu = 'half': expected a finite"),
        (LONG, MAP, BODY | {"Q": "4"}, "value 'Q'"),
        (LONG, MAP, BODY | {"radius": "8"}, "value 'radius'"),
        (LONG.replace("0.1,", ","), MAP, BODY, "line 4, column 'Ridge width [mm]' = '': exp"),
        (
            LONG.replace("0.0087", "-1"),
            MAP,
            BODY,
            "line 3, column 'Load (N/mm)' = '-1': expected a",
        ),
        (f"\n{CONTRACT}\n0.03,0.01,8,0.002\n", {}, {}, "(line 6), p_over_E = 0.002: must"),
        (CELLS, {}, BODY, "line 3, column 'Steg [mm]' = '100 µm': expected a number in the unit"),
        (CELLS.replace("100 µm", "0,1"), {}, BODY, "= '0,1': expected a number in the unit of the"),
        ("a/R,b/R,Q,Force [N]\n.03,.01,4,.042\n", {}, BODY, "--thickness '? mm'"),
        (rows("4,.002", "4,.0019", "6,.005"), {}, {}, "has it too; repeats need a label each"),
        (counts("Ridges in contact", 0, 2, 0, 2), {}, {}, f"mine.csv: Q, 4 {UNDER_4}"),
        (counts("Ridges in contact", 2, 2, 2, 2), {}, {}, f"mine.csv: Q, 4 {UNDER_4}"),
        (counts("Edges per side", 1, 1), {}, {}, "Q, 2 rows, a count of 1 at most"),
        ("a/R,b/R,Q=0,Q=2\n.03,.01,,.1\n", {}, {}, "mine.csv: Q, 1 row, a count of 2"),
        (rows("2,x1"), {}, {}, "line 2, column 'p/E' = 'x1': expected a finite number"),
        (rows("4,1,.1,0", header=OF_MEAN), {}, {}, "column 'n' = '0': expected above 0"),
        (rows("4,1,.1,", header=OF_MEAN), {}, {}, "column 'n' = '': expected a number bes"),
        (rows(*(f"3,.00{i}" for i in (1, 2, 3))), {}, {}, "Q, 3 cells: must be even"),
        (
            "a/R,b/R,Q,Load 1 [kPa],Load 2 [kPa]\n.03,.01,4,,\n",
            {},
            BODY,
            "columns 'Load 1 [kPa]', 'Load 2 [kPa]': expected a number in some cell",
        ),
        (rows("4,x1", "4,x2", "4,x3"), {}, {}, "'p/E', 3 cells: expected a finite number"),
        (
            rows("4,1.5"),
            {},
            {"decimal": "comma"},
            "= '1.5': expected a finite number, with a comma",
        ),
        ("a/R,b/R,Q=4,Q=6\n.03,.01,x1,\n", {}, {}, "column 'Q=4' = 'x1': expected a finite numb"),
        (CONTRACT, {}, {"sheet": "one"}, "--sheet"),
        *((LONG, {key: "Q"}, {}, "expected ") for key in ("A", "p_over_R", "gap", "x Q=4")),
        *(
            (f"{header},b,Q,p_over_E\n240,0.08,4,0.001\n", {"a": header}, {"R": "8"}, "be its unit")
            for header in ("a_per_mm", "ridge mm", "load_N_mm")
        ),
        *(
            ("a/R,b/R,Q,Force [N]\n.03,.01,4,.024\n", {}, SLICE | {"load_se": text}, "load_se = ")
            for text in ("0 N", "-1 N", "0.05 mm", "x", "1 N N")
        ),
        *(
            (rows(f"4,{cell}", "6,1.0E-03"), {}, {}, f"= {cell!r}: expected a finite number")
            for cell in ("12-120", "0.5-20", "1.5-2000", "1.5E-", "D-02")
        ),
        (
            FIXED.replace("2    0.240    0.080", "2    0.2400.080"),
            {},
            {},
            "line 2: columns run together, such as '    1    0.240",
        ),
        (OUTER_FIRST, {}, {}, "Q = 6 is touched at p/E = 0.003, before Q = 4; expected inner corn"),
        (
            history("gap Q=4", str),
            {},
            {},
            "a gap of a corner: expected the status of corners, open",
        ),
        (
            history("status Q=4", lambda i: min(i, 3)),
            {},
            {},
            "open or 0, closed or 1, or an empty cell; --closed-is says which codes are contact: "
            "line 3 = '2', line 4 = '3', line 5 = '3' and 3 more",
        ),
    ],
)
def test_import__what_breaks_a_rule_is_refused(refusal, text, mapping, facts, said):
    assert said in refusal(text, mapping, **facts)


@pytest.mark.parametrize(("numbers", "likely"), [((4, 6), "edges"), ((2, 3), "per-side")])
def test_import__what_contacts_count_is_asked_for(refusal, numbers, likely):
    assert "expected --count-is" in refusal(counts("Contacts", *numbers))
    assert refusal.error.options == {"count_is": likely}


@pytest.mark.parametrize("header", ["Fx (N),Fz (N)", "half load (N),note"])
def test_import__no_doubtful_load_is_proposed(refusal, header):
    refusal(f"a/R,b/R,Q,{header}\n.03,.01,4,.1,1\n", {}, **BODY)
    assert refusal.error.mapping == {"load": "?"}


@pytest.mark.parametrize(
    ("cell", "number"),
    [("0.12D-02", 0.0012), ("0.48-002", 0.0048), (".19d-01", 0.019), ("0.314+001", 3.14)],
)
def test_import__exponents_of_fortran_are_read_and_said(read, cell, number):
    table = read(f"a_over_R b_over_R Q p_over_E\n.03 .01 4 {cell}\n.03 .02 4 1.0E-03\n")
    np.testing.assert_allclose(table.table.column("p_over_E"), [number, 0.001], rtol=1e-15)
    said = f"1 number with an exponent of Fortran's, such as '{cell}' = {number:g}"
    assert said in table.messages


def test_import__columns_that_touch_are_parted_before_signs(read):
    table = read(FIXED, R="8 mm", E="60 kPa")
    np.testing.assert_allclose(table.table.column("p_over_E"), [0.0013, 0.005], rtol=1e-12)
    assert any("line 2: columns run together" in line for line in table.messages)


# --- wide tables and increments -----------------------------------------------------------------

WIDE = "a_over_R,b_over_R,{0}4{1},{0}6{1},{0}8{1}\n.03,.01,1,4,\n.02,.01,2,,9\n"


@pytest.mark.parametrize(
    ("before", "after", "mapping", "scale"),
    [
        ("Q=", " [kPa]", {}, 60),
        ("p Q=", " [kPa]", {}, 60),
        ("Force at ", " [kPa]", {"p": "Force at *"}, 60),
        ("Force at ", "", {"p": "Force at *;kPa"}, 60),
        ("line Q", " [N/mm]", {}, 0.96),
        ("Q=", "", {}, 1),
    ],
)
def test_import__wide_tables_have_a_row_for_each_Q_that_was_reached(
    read, refusal, before, after, mapping, scale
):
    text = WIDE.format(before, after)
    table = read(text, mapping, **({} if scale == 1 else BODY))
    assert column(table, "Q") == [4, 6, 4, 8]
    # rtol 1e-15: one division beside the exact quotient.
    expected = np.array([1, 4, 2, 9]) / scale
    np.testing.assert_allclose(table.table.column("p_over_E"), expected, rtol=1e-15)
    assert "2 empty cells: not reached" in table.messages
    if scale == 1:
        assert "p/E, pressure, line load or force" in refusal(text, E="60")


@pytest.mark.parametrize(
    ("text", "lower"),
    [
        (history("status Q=4", lambda i: "open" if i < 4 else "Closed"), 0.003),
        (history("STAT Q=4", lambda i: int(i >= 4)), 0.003),
        # An increment that is cut or unknown is no end of an interval.
        (
            history("status Q=4,status", lambda i: f"{int(i > 2)},{'cut' if i == 3 else 'ok'}"),
            0.002,
        ),
        (history("status Q=4", lambda i: {3: ""}.get(i, int(i > 3))), 0.002),
        (history("Q", lambda i: 3 if i == 3 else 2 + 2 * (i > 3)), 0.002),
    ],
)
def test_import__the_status_of_corners_gives_intervals(read, text, lower):
    table = read(text)
    assert column(table, "Q") == [4]
    assert column(table, "p_over_E") == [0.004]
    assert column(table, "p_over_E_lower") == [lower]


def test_import__each_texture_is_a_run_of_its_own(read):
    first = history("status Q=4", lambda i: int(i >= 4))
    other = "\n".join(line.replace(".03", ".05") for line in first.splitlines()[1:])
    table = read(first + other.replace(",1", ",0", 1))
    assert table.table.textures == ((0.03, 0.01), (0.05, 0.01))
    assert any("status Q=4" in text for text in table.messages)


# --- files --------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["mine.csv", "mine.tsv", "mine.xlsx", "mine.parquet"])
@pytest.mark.parametrize("protocol", range(2, 6))
def test_import__a_pickle_in_disguise_is_not_opened(refusal, name, protocol):
    class Bomb:
        def __reduce__(self):
            return pytest.fail, ("unpickled",)

    assert "a pickle" in refusal(pickle.dumps(Bomb(), protocol), name=name)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        *((f"mine.{suffix}", b"PK\x03\x04", "macros") for suffix in ("xls", "xlsm", "xlsb")),
        *((f"mine.{end}", CONTRACT, "a suffix of .csv") for end in ("pkl", "json", "ods")),
        ("mine.csv", b"PK\x03\x04", "the content is .xlsx; expected a .csv"),
        ("mine.csv", b"PAR1", "the content is .parquet; expected a .csv"),
        ("mine.xlsx", CONTRACT, "not a readable Excel file"),
        *((f"mine.{suffix}", b"", "empty") for suffix in ("csv", "xlsx", "parquet")),
    ],
)
def test_import__files_that_are_no_tables_are_refused(refusal, name, content, said):
    assert said in refusal(content, name=name)


# X-Y report of Abaqus/Viewer: a table of blanks, whose names hold single blanks.
REPORT = (
    "\n     X     a_over_R     b_over_R     Q     LOAD PI: P N: 1\n"
    "----------------------------------------------------------------\n\n"
    "    0.     0.03     10.E-03     4.     0.001\n    1.     0.03     10.E-03     6.     0.004\n\n"
)


@pytest.mark.parametrize(
    "text",
    [
        REPORT,
        REPORT.replace("P N: 1", "P   ").replace("---", f"{'N: 1':>60}\n---", 1),
        "\ufeff" + REPORT.replace("\n", "\r\n"),
        "X;a_over_R;b_over_R;Q;LOAD\n\n\n0;0.03;0.01;4;0.001\n1;0.03;0.01;6;0.004\n",
    ],
)
def test_read_columns__a_report_of_curves_is_a_table(read, refusal, text):
    mapping = {"p_over_E": "LOAD PI: P N: 1" if "PI" in text else "LOAD"}
    assert column(read(text, mapping, name="mine.rpt"), "p_over_E") == [0.001, 0.004]
    said = refusal(text.replace("0.03", "-.03"), mapping, name="mine.rpt")
    assert re.search(r"mine\.rpt.*\(line [456]\).* = -0\.03", said)
