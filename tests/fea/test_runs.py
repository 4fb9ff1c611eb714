"""A run of known loads in every program's files: its loads, files that say the same, and refusals.

Files are in the layout of each program, written from the run's numbers.
"""

import functools
import re

import numpy as np
import pytest

from ridgebayes import InputError
from ridgebayes.fea.read import recognise
from tests.fea import abaqus_writer as writer
from tests.fea import runs
from tests.fea.runs import BRACKETS, KINDS, RUN, imported, pressed

N = len(RUN["nodes"])
FORCE, NODES, POSITION = runs.arrays(RUN)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Read the files of a kind as they are, once."""
    return functools.cache(lambda kind: imported(tmp_path_factory.mktemp("run"), kind))


def put(old, new, count=1):
    """Return a change of a text by a pattern that has to be there."""

    def change(text):
        changed, n = re.subn(old, new, text, count=count, flags=re.M)
        assert n
        return changed

    return change


def loads_of(imported_run):
    return imported_run.table.frame["p_over_E"].to_numpy()


# --- loads ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("full", "R", "E"),
    [
        (False, 8.0, 0.06),
        pytest.param(True, 40.0, 2e5, marks=pytest.mark.slow),
        pytest.param(True, 1.0, 1.0, marks=pytest.mark.long),
    ],
)
def test_import__finds_the_loads(tmp_path, kind, full, R, E):
    run = pressed(full=full, R=R, E=E)
    frame = imported(tmp_path, kind, run=run).table.frame
    assert frame["Q"].tolist() == run["Q"] == [4, 6, 8]
    load = np.array(run["load"])
    if kind not in BRACKETS:
        # Second order in the increment; printed digits are far below.
        np.testing.assert_allclose(frame["p_over_E"], load, rtol=8e-3)
        assert (np.abs(frame["p_over_E"] / load - 1) < 3 * frame["rel_se"]).all()
        return
    # A face is closed once all of it lies on the ridge: later by its length, in depth times dp/dd.
    late = 0.9 / 240 * run["corners"][1:4] / R * (0.3 + 24 * 0.034)
    assert (frame["p_over_E"] >= load).all()
    assert (frame["p_over_E_lower"] < load + late).all()


def test_abaqus__printed_digits_are_errors_of_the_load(tmp_path):
    errors = [
        imported(tmp_path, "abaqus-dat", run=pressed(R=R)).table.frame["rel_se"][0]
        for R in (1.0, 1000.0)
    ]
    # Two decimals are printed of displacements of up to 34, in units of R / 1000: half of 0.01.
    # A gap closes with the depth d at a rate of 1, p/E = 0.00155 grows by 0.3 + 24 d, d = 0.0044.
    expected = 0.005 / 1000 * (0.3 + 24 * 0.0044) / 0.00155
    assert np.sqrt(errors[1] ** 2 - errors[0] ** 2) == pytest.approx(expected, rel=0.2)


def test_abaqus__rows_of_zeros_are_zeros(tmp_path):
    frames = []
    for least in (0.0, 1e-12):
        run = {**RUN, "position": POSITION.copy()}
        # Nodes about the second corner stay where they were, in the third increment before contact.
        held = np.abs(NODES[:, 0] - RUN["corners"][1]) < 0.01
        run["position"][1, held] = NODES[held] + least
        frames.append(imported(tmp_path, "abaqus-dat", run=run).table.frame)
    columns = ["p_over_E", "rel_se"]
    np.testing.assert_allclose(frames[0][columns], frames[1][columns], rtol=1e-6)  # 1e-12 of R
    moving = imported(tmp_path, "abaqus-dat").table.frame
    assert frames[0]["rel_se"][0] > 1.5 * moving["rel_se"][0]  # these nodes do count


def test_ansys__codes_say_what_is_closed_and_near_contact_is_open(tmp_path, whole):
    usual = loads_of(whole("ansys, status"))
    assert (loads_of(imported(tmp_path, "ansys, status", closed_is=(3,))) >= usual).all()
    near = loads_of(imported(tmp_path, "ansys, status", closed_is=(1, 2, 3)))
    assert near[-1] < usual[-1]


def test_ansys__nodes_at_corners_need_no_places(tmp_path):
    nodes = [1001, 1002, 1003, 1004]
    code = np.hstack([[np.array(RUN["load"]) <= p for p in FORCE], np.zeros((34, 1))])
    text = runs.listing(nodes, 2.0 + code[..., None], ("STAT",))
    files = {"s.lis": text, "f.lis": runs.reactions(RUN)}
    read = functools.partial(imported, tmp_path, "ansys, status", files=files, closed_is=(3,))
    with pytest.raises(InputError, match="have no place: expected NLIST") as error:
        read()
    assert error.value.mapping == {f"status Q={4 + 2 * i}": str(n) for i, n in enumerate(nodes)}
    corners = tuple(f"{key}={node}" for key, node in error.value.mapping.items())
    with pytest.raises(InputError, match="--symmetry: missing; expected half or full"):
        read(map=corners, symmetry=None)
    with pytest.raises(InputError, match="no results of node 7"):
        read(map=("status Q=4=7",))
    for row, load in zip(read(map=corners).table.frame.itertuples(), RUN["load"], strict=True):
        k = np.searchsorted(FORCE, load)
        # Six digits of a force are printed.
        assert (row.p_over_E_lower, row.p_over_E) == pytest.approx(FORCE[k - 1 : k + 1], rel=1e-5)


def test_pvd__loads_may_be_given_and_files_may_lie_in_folders_below(tmp_path, whole):
    files = runs.pvd_files(RUN)
    names, loads = list(files)[1:], runs.line_loads(RUN).tolist()
    files["run.pvd"] = runs.pvd([f"./{name}" for name in names], map(float, range(34)))
    read = imported(tmp_path, "series, PVD", files=files, loads=tuple(loads))
    np.testing.assert_array_equal(loads_of(read), loads_of(whole("series, PVD")))
    with pytest.raises(InputError, match="--time: missing; expected line or p_over_E"):
        imported(tmp_path, "series, PVD", files=files, time=None)


# --- files that say the same ----------------------------------------------------------------------

DAT = writer.dat_text(FORCE, NODES, POSITION)
TITLE = DAT[DAT.index("   THE FOLLOWING TABLE") : DAT.index("NOTE") + 5]
ABAQUS_PAGE = (
    "\n1\n\n   Abaqus 2023      Date 12-Jun-2026   Time 19:05:39\n   For use by someone\n"
    "\n 10 kN on a pad                    STEP    1  INCREMENT    1\n"
    " 2 mm thick                    TIME COMPLETED IN THIS STEP   0.00\n\n"
)
ANSYS_PAGE = (
    "\n1\n\n ***** ANSYS - ENGINEERING ANALYSIS SYSTEM  RELEASE 2021 R1          21.1     *****\n"
    " 00000000  VERSION=LINUX x64     15:08:00  FEB 01, 2021 CP=      1.234\n\n"
    "  ***** POST1 NODAL DEGREE OF FREEDOM LISTING *****\n\n"
)


def before_row(new):
    """Put text before a row in the middle of a table."""
    return put(rf"^(?= {100:10d} )", new)


def increment_twice(text):
    """Put a wrong increment before the one of its number."""
    head = r" {32}INCREMENT     "
    block = re.search(rf"(?s){head}5 SUMMARY.*?(?={head}6)", text)[0]
    wrong = re.sub(r"(\n +242 +0\.000 +)\S+", r"\g<1>9.0000E-01", block)
    wrong = re.sub(r"((?:MAXIMUM|MINIMUM) +0\.000 +)\S+", r"\g<1>9.0000E-01", wrong)
    assert wrong != block
    return text.replace(block, wrong + block)


def forces_of_nodes(total=""):
    """Forces of the driven node, with or without a total below, in place of totals."""
    return put(
        r" total force \(fx,fy,fz\)(.*)\n\n( +\S+ +\S+ +\S+\n)",
        lambda m: (
            f" forces (fx,fy,fz){m[1]}\n\n {N + 1} {'0. 5. 0.' if total else m[2].strip()}\n\n"
            + (m[0] if total else "")
        ),
        count=0,
    )


def levels(text):
    return re.split(r"(?=\n total force)", text)[1:]


def level_twice(text):
    first = levels(text)[3]
    return text.replace(first, re.sub(r"-?\d\.\d+E-0\d", "9.000000E-03", first) + first)


FALLING = put(r"(?s)(<Data.*/>\n)", lambda m: "".join(m[1].splitlines(True)[::-1]))
SAME = [
    ("calculix", lambda text: "".join(reversed(levels(text))), {}, ""),
    ("calculix", level_twice, {}, "1 increments printed again: the later one counts"),
    ("calculix", forces_of_nodes(), {}, ""),
    ("calculix", forces_of_nodes("total"), {}, ""),
    (
        "calculix",
        lambda text: (
            text + "\n displacements (vx,vy,vz) for set REST and time  0.1E+01\n\n 1 2 3\n"
        ),
        {},
        "not used: displacements of REST",
    ),
    (
        "calculix",
        lambda text: text + "\n displacements (vx,vy,vz) for set RIM and time  0.99E+02\n\n",
        {},
        "increment ignored, fy of TOP missing",
    ),
    ("frd", lambda _: runs.frd(RUN, form=0, tiny=-3.14159e-101), {}, ""),
    ("abaqus-dat", before_row(ABAQUS_PAGE), {}, ""),
    ("abaqus-dat", before_row("\n\n" + TITLE), {}, ""),
    ("abaqus-dat", before_row(ABAQUS_PAGE + TITLE), {}, ""),
    ("abaqus-dat", put("NODE SET RIM", "NODE SET\n   RIM", count=0), {}, ""),
    ("abaqus-dat", put(r"\n (MAXIMUM|MINIMUM|AT NODE).*", "", count=0), {}, ""),
    ("abaqus-dat", increment_twice, {}, "1 increments printed again: the later one counts"),
    (
        "abaqus-dat",
        lambda text: (
            text
            + put("P       1", "P       2 \n     THIS IS A LINEAR PERTURBATION STEP.\n")(
                text[text.index("                        S T E P") :]
            )
        ),
        {},
        "and 31 more: increment ignored, a perturbation step",
    ),
    ("ansys", put("^(?=     1150)", ANSYS_PAGE, count=0), {}, ""),
    ("ansys, status", put("^(?=     1150)", ANSYS_PAGE, count=0), {}, ""),
    ("febio", None, {}, "line 1: increment ignored, zeros, as before the first step"),
    ("series, PVD", FALLING, {}, "34 states"),
    ("nodes", put("COPEN", "Clearance"), {"map": ("gap=Clearance",)}, "34 steps of 241 nodes"),
]


@pytest.mark.parametrize(("kind", "change", "given", "message"), SAME)
def test_import__of_files_that_say_the_same_finds_the_same_loads(
    tmp_path, whole, kind, change, given, message
):
    read = imported(tmp_path, kind, change, **given)
    np.testing.assert_allclose(loads_of(read), loads_of(whole(kind)), rtol=1e-12)  # rounding
    assert any(message in line for line in read.messages)


def test_import__pressure_is_as_status(tmp_path, whole):
    pressure = np.where(runs.status(RUN)[..., 0] > 1, 0.5, 0.0)
    text = runs.node_table(RUN, "Inc,Node,F,Place,CPRESS", pressure)
    read = imported(tmp_path, "nodes", lambda _: text, map=("load=F", "x=Place"), top=None)
    np.testing.assert_array_equal(loads_of(read), loads_of(whole("nodes, status")))
    assert read.doubts == ()
    # Every eighth node: corners between nodes are touched before a node is.
    head, *rows = text.splitlines(keepends=True)
    coarse = head + "".join(row for i, row in enumerate(rows) if i % N % 8 == 0)
    rough = imported(tmp_path, "nodes", lambda _: coarse, map=("load=F", "x=Place"), top=None)
    fine = read.table.frame.set_index("Q")["p_over_E"]
    found = rough.table.frame.set_index("Q")["p_over_E_lower"]
    late = found.index[found >= fine.reindex(found.index)]
    assert len(late)
    assert all(f"Q = {Q}: load about " in rough.cautions[0] for Q in late)


@pytest.mark.parametrize(
    ("load", "given", "E"),
    [
        # p/E = 2 F / (2 R E L), with R = 8 mm and L = 1 mm.
        ("RF2 (N)", {"thickness": "1 mm"}, 125.0 * RUN["E"]),
        ("RF2", {"map": ("load=RF2;kPa",)}, RUN["E"]),
    ],
)
def test_nodes__units_in_headers_are_converted(tmp_path, load, given, E):
    small, header = pressed(n_level=12, n_node=121), f"Step,Node,{load},X (mm),COPEN (um)"
    run = small | {"position": 8 * small["position"]}
    text = runs.node_table(run, header, 8e3 * runs.gaps(small))
    given = {**given, "R": "0.8 cm", "E": f"{E:.9g} kPa"}
    loads = loads_of(imported(tmp_path, "nodes", lambda _: text, **given))
    expected = loads_of(imported(tmp_path, "nodes", run=small))
    np.testing.assert_allclose(loads, expected, rtol=1e-6)  # printed
    with pytest.raises(InputError, match=r"in um, but R without a unit; expected units"):
        imported(tmp_path, "nodes", lambda _: text, **given | {"R": "8"})


@pytest.mark.parametrize(
    ("old", "new"), [(r"\Z", "*SOLID SECTION\n20.\n"), ("^(2.*),0.$", r"\1,20.")]
)
def test_calculix__thickness_is_the_deck_s_and_other_materials_need_E(tmp_path, whole, old, new):
    deck = put(old, new, 0)(writer.deck_text(RUN))
    files = {"run.dat": writer.calculix_text(20 * FORCE, NODES, POSITION), "run.inp": deck}
    read = imported(tmp_path, "calculix", files=files)
    np.testing.assert_allclose(loads_of(read), loads_of(whole("calculix")), rtol=1e-6)  # printed
    files["run.inp"] = put("NEO HOOKE", "OGDEN")(deck)
    with pytest.raises(InputError, match="--E: missing"):
        imported(tmp_path, "calculix", files=files, E=None)


@pytest.mark.parametrize("total", [False, True])
def test_abaqus__rows_and_totals_of_several_nodes_are_the_same_load(tmp_path, whole, total):
    driven = [N + 1, N + 2, N + 3]
    files = {
        "run.dat": writer.dat_text(FORCE, NODES, POSITION, driven=driven, total=total),
        "run.inp": put(f"^{N + 1},$", f"{N + 1},{N + 2},{N + 3}")(writer.deck_text(RUN)),
    }
    read = imported(tmp_path, "abaqus-dat", files=files)
    # Five digits are printed of each.
    np.testing.assert_allclose(loads_of(read), loads_of(whole("abaqus-dat")), rtol=2e-4)
    if total:  # which counts before the rows
        change = put(r"TOTAL( +0\.000 +)(\S+)", lambda m: f"TOTAL{m[1]}{2 * float(m[2]):.4E}", 0)
        read = imported(tmp_path, "abaqus-dat", change, files=files)
        np.testing.assert_allclose(loads_of(read), 2 * loads_of(whole("abaqus-dat")), rtol=2e-4)


@pytest.mark.parametrize("order", [1, -1])
def test_febio__logs_come_in_any_order_and_tops_are_where_the_body_rests(tmp_path, order):
    files = dict(list(KINDS["febio"](RUN).items())[::order])
    read = imported(tmp_path, "febio", files=files, top=None)
    np.testing.assert_allclose(loads_of(read), RUN["load"], rtol=2e-2)
    assert set(read.table.frame["solver"]) == {"febio"}


# --- files that break off -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["calculix", "frd", "abaqus-dat"])
def test_import__of_a_file_cut_anywhere_is_refused_or_ends_earlier(tmp_path, whole, kind):
    full = loads_of(whole(kind))
    for cut in np.linspace(0.2, 0.999, 12):
        try:
            loads = loads_of(imported(tmp_path, kind, lambda t, cut=cut: t[: int(cut * len(t))]))
        except InputError:
            continue
        np.testing.assert_allclose(loads, full[: len(loads)], rtol=1e-12)


@pytest.mark.parametrize(
    ("kind", "change", "message"),
    [
        ("calculix", lambda text: text[:-300], r"increment ignored, vx, vy missing for \d"),
        ("calculix", lambda text: text.rstrip()[:-5], "vx, vy missing for 1 of 241 nodes"),
        ("ansys", put("^     1002", "    x1002"), "UX, UY missing for 1 of 241 nodes"),
        ("ansys", lambda text: text[: text.rindex("     1201")], "missing for 41 of 241 nodes"),
        (
            "abaqus-dat",
            put(rf"(?s)^ {N - 3:10d} .*?(?=   THE)", "\n\n"),
            "RIM with 237 of 241 nodes, and no",
        ),
    ],
)
def test_import__of_a_table_that_breaks_off_leaves_its_increment_out(
    tmp_path, kind, change, message
):
    read = imported(tmp_path, kind, change)
    assert any(re.search(message, line) for line in read.messages)
    assert "33 increments" in " ".join(read.messages)


def test_sta__increments_that_never_converged_are_left_out(tmp_path, whole):
    files = KINDS["calculix"](RUN) | {"run.sta": runs.sta(RUN, n_tail=3)}
    read = imported(tmp_path, "calculix", files=files)
    said = "\n".join(read.messages)
    assert "31 converged increments; it stopped after 3 attempts without convergence" in said
    assert "and 0 more" not in said
    assert "increment ignored, it did not converge" in said
    expected = loads_of(whole("calculix"))
    np.testing.assert_array_equal(loads_of(read), expected[: len(loads_of(read))])


# Lines of a run of CalculiX 2.20.
STA = (
    "SUMMARY OF JOB INFORMATION\n"
    "  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME\n"
    "     1          1     1U   60  0.000000E+00  0.000000E+00  0.100000E+01\n"
    "     1          1     2    14  0.100000E+01  0.250000E+00  0.250000E+00\n"
    "     1          2     1    35  0.200000E+01  0.500000E+00  0.250000E+00\n"
)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "run.sta: no increments; expected a .sta of CalculiX"),
        (STA[: STA.index("     1 ")], "run.sta: no increments"),
        (STA + "1 1 1 5 0.1 0.1\n", "run.sta, line 6: '1 1 1 5 0.1 0.1'; expected STEP, INC"),
        (STA + "1 1 1X 5 0.1 0.1 0.1\n", "run.sta, line 6"),
        (STA + "1 1 1 5 3,1 0,1 0,1\n", "run.sta, line 6: '3,1': expected a finite number"),
        (STA + "1 1 1 5 1e999 0.1 0.1\n", "run.sta, line 6: '1e999'"),
        (STA + "1 3 1 5 1.9 0.1 0.1\n", "time 1.9 after 2; expected times that do not fall"),
        # Two increments of 34; a last line without an end is not read, and times are rounded.
        *((t, "no corner") for t in (STA, STA.replace("\n", "\r\n"), STA + "     1       3")),
        (STA + "1 3 1 7 0.2E+01 0.5E+00 0.1E-05\n", "no corner"),
    ],
)
def test_sta__what_cannot_be_understood_is_named(tmp_path, text, message):
    files = KINDS["calculix"](RUN) | {"run.sta": text}
    with pytest.raises(InputError, match=re.escape(message)):
        imported(tmp_path, "calculix", files=files)


# --- refusals -------------------------------------------------------------------------------------


def row_of_50(new):
    return put(rf"^ {50:10d} .*", new)


BALANCE = runs.listing([7], [[[0, p]] for p in FORCE], ("FX", "FY"))
REFUSED = [
    ("calculix", put(r"(TOP and time +)0\.2000000E\+01", r"\1nan"), "'nan': expected a finite"),
    ("calculix", put(r"^( +3 .*)  0\.000000E\+00$", r"\1"), "expected node, vx, vy, vz"),
    ("calculix", put("^         3 ", "         2 "), "node '2'; expected a whole number, each"),
    ("calculix", put("^         3 ", "       3,5 "), "'3,5': expected a finite number"),
    ("calculix", put("^         3 ", "     1e999 "), "'1e999': expected a finite number"),
    ("calculix", put("^         3 ", "       1_0 "), "'1_0': expected a finite number"),
    ("calculix", put("^(         3 )", r"Q\n\1"), "'Q'; expected rows, a blank line"),
    ("calculix", lambda _: "", "no increment with displacements of RIM"),
    ("calculix", lambda _: "0.1;0.2\n", "no increment with displacements of RIM"),
    ("calculix", put("RIM", "ARC", count=0), "no increment with displacements of RIM"),
    ("calculix", put(r"^( +\S+ +\S+) +\S+$", r"\1"), "expected fx, fy, fz"),
    (
        "calculix",
        put(r"(force.*\n\n.*\n)", r"\1 0. 1. 0.\n"),
        "expected one total force an increment",
    ),
    ("frd", put("FORC", "STRE", count=0), "fy missing"),
    ("frd", put("^ -1         5", " -1         4"), "node '4'; expected a whole number, each node"),
    ("frd", put(r"0\.00000E\+00", "0.0x000E+00"), "expected a finite number"),
    ("frd", put(" 1\n -4", " 2\n -4"), "format '2'; expected text"),
    ("abaqus-dat", row_of_50("  50      1,5E-03  2.0E-03"), "'1,5E-03': expected a finite number"),
    ("abaqus-dat", row_of_50("  50      ********  2.0E-03"), r"'\*+': expected a finite number"),
    ("abaqus-dat", row_of_50("  50  TR  1.5E-03  2.0E-03"), "expected node, U1, U2$"),
    ("abaqus-dat", row_of_50("  50      1.5E-03"), "expected node, U1, U2"),
    ("abaqus-dat", row_of_50("  49      1.5E-03  2.0E-03"), "node '49'; .*, each node once"),
    ("abaqus-dat", row_of_50(" 900      1.5E-03  2.0E-03"), "node 900 is not in the deck's RIM"),
    ("abaqus-dat", row_of_50("  50      1.5E-03  9.0"), "MAXIMUM .* is not that of the rows"),
    ("abaqus-dat", put(" SUMMARY", " SHORT", count=0), "a table before its increment"),
    ("abaqus-dat", put("MAXIMUM +", "MAXIMUM 1. "), "expected U1, U2"),
    ("abaqus-dat", put("SET RIM", "SET PART_RIM", count=0), "the tables are .*U1 U2 of PART_RIM"),
    ("abaqus-dat", lambda _: "", "no increment with U1 and U2 of RIM"),
    ("abaqus-dat", lambda text: text.encode("utf-16"), "not UTF-8"),
    ("abaqus-dat", lambda text: text.encode() + b"\xff\n", "0xff is not UTF-8"),
    (
        "abaqus-dat",
        lambda text: put(rf"^ {7:10d} ", " notnode ", 0)(
            re.sub(r"\n (MAXIMUM|MINIMUM|AT NODE).*", "", text)
        ),
        "increment ignored, a table of RIM with 240 of 241 nodes, and no end",
    ),
    ("febio", lambda text: text + runs.febio(POSITION, "x;y"), "x, y stands twice in an increment"),
    (
        "febio",
        lambda _: runs.febio(POSITION * [1, -1], "x;y"),
        "not the lower side of a circle .* above the ridges",
    ),
    (
        "febio",
        lambda _: runs.febio(POSITION + np.array([0.5, 0.0]), "x;y"),
        "no surface nodes about x = .*, where the second ridge begins",
    ),
    (
        "nodes, status",
        put(r",0\.(?=\d{9},\d$)", ",1.", count=0),  # x from 1 on
        "before Q = 4; expected inner corners first",
    ),
    ("febio", lambda text: text + "7,1\n", r"rim\.txt, line \d+: .*node, x, y"),
    ("febio", put(r"0\.1", "0,1"), "expected node, x, y"),
    ("febio", lambda _: "*Step = 1\n1,2\n", "line 2: '1,2'; expected"),
    (
        "febio",
        put("x;y", "u;v", count=0),
        "and Fy or Ry; .*POSITIONS FORCES.*x, y missing",
    ),
    ("ansys", put("     UY", "     UZ", count=0), "UY missing"),
    ("ansys", put("FX|UX", "UZ", count=0), "UX, UY missing"),
    ("ansys", put("E-0", "Q-0"), "expected a finite number"),
    ("ansys", lambda text: text + BALANCE, "forces FY sum to .*, less than that of one node"),
    ("ansys", lambda text: text[: text.rindex("     1201") + 15], "is cut off"),
    ("ansys", lambda text: text.replace("     1201", "     5201"), "node 5201 has no X and Y"),
    ("series, PVD", put("0.vtu", "../0.vtu"), "expected a .vtu in the same folder"),
    ("series, PVD", put("0.vtu", "/etc/0.vtu"), "expected a .vtu in the same folder"),
    ("series, PVD", put("0.vtu", "0.vtk"), "expected a .vtu in the same folder"),
    ("series, PVD", put("0.vtu", "no.vtu"), "no.vtu: no such file"),
    ("series, PVD", put('step="', 'step="-'), "expected a number from 0"),
    (
        "series, PVD",
        put('step="[^"]*"', 'step="1.0"', count=0),
        "timestep '1.0' stands twice; expected a file each",
    ),
    (
        "series, PVD",
        put("(?s)<DataSet.*?</Coll", "</Coll"),
        "0 .vtu with 0 loads; expected two or more",
    ),
    ("nodes", put("COPEN", "Note"), r"no column gap, pressure or status: .*--map 'gap=HEADER'"),
    ("nodes", put("RF2", "Note"), "no column load"),
    ("nodes", put("COPEN", "CSTATUS"), "expected open or 0, closed or 1"),
    ("nodes", put("^0,1,", "0,0,"), "a node stands twice in a step"),
    ("nodes", put("^0,1,", "0,999,"), "the steps have different nodes"),
    ("nodes", put("^0,1,", "0,1,9"), "a step has several loads"),
    (
        "nodes",
        put("^0,1,", "0,1,x"),
        "line 3, column 'RF2' = .*: expected a finite number|a number",
    ),
]


@pytest.mark.parametrize(("kind", "change", "message"), REFUSED)
def test_import__of_what_cannot_be_understood_is_refused(tmp_path, kind, change, message):
    with pytest.raises(InputError, match=rf"(?s){tmp_path.name}.*({message})"):
        imported(tmp_path, kind, change)


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        ("calculix", {"E": "1.1"}, "the material has E = 1, and 1.1 was given"),
        ("calculix", {"nu": "0.49"}, "the material has nu = 0.5, and 0.49 was given"),
        ("calculix", {"R": "0.98"}, "off a circle of R = 0.98"),
        ("calculix", {"symmetry": "full"}, "--symmetry half"),
        ("calculix", {"texture": (0.06, 0.03)}, "no rigid nodes at the corners"),
        ("calculix", {"surface": "ARC"}, "no node set 'ARC'; the node sets are"),
        ("calculix", {"surface": "TOP"}, "no increment with displacements of TOP"),
        ("febio", {"R": None}, "--R: missing"),
        ("nodes", {"map": ("gap=Nothing",)}, "mapping gap=Nothing: no column"),
    ],
)
def test_import__of_what_contradicts_the_user_is_refused(tmp_path, kind, given, message):
    with pytest.raises(InputError, match=re.escape(message)):
        imported(tmp_path, kind, **given)


@pytest.mark.parametrize(
    ("kind", "first"),
    [("febio", "rim.txt"), ("febio", "plate.txt"), ("ansys", "u.lis"), ("ansys", "f.lis")],
)
def test_import__of_one_file_of_two_says_which_others_are_needed(tmp_path, kind, first):
    files = {first: KINDS[kind](RUN)[first]}
    with pytest.raises(InputError, match=r"missing|ridgebayes import \w"):
        imported(tmp_path, kind, files=files)


# --- which program --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "name", "program"),
    [
        ("febio", "rim.txt", "febio"),
        ("ansys", "u.lis", "ansys"),
        ("ansys", "n.lis", "ansys"),
        ("frd", "run.frd", "calculix"),
        ("calculix", "run.dat", "calculix"),
        ("abaqus-dat", "run.dat", "abaqus-dat"),
        ("series, PVD", "run.pvd", "series"),
    ],
)
def test_recognise__knows_its_programs(tmp_path, kind, name, program):
    (tmp_path / name).write_text(KINDS[kind](RUN)[name])
    assert recognise(tmp_path / name) == program


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("d3plot", "LS-DYNA is not read; export a table"),
        ("press.mphtxt", "COMSOL file is not read; export results as a table"),
        ("press.t16", "Marc post file"),
        ("press.odb", "Abaqus database is not read; print U and RF"),
        ("press.rpt", "Abaqus field report is not read; print U and RF"),
        ("press.rst", "ANSYS database is not read; list PRNSOL and PRRSOL"),
        ("press.xplt", "FEBio .* is not read; ask for log data"),
        ("press.op2", "Nastran"),
        ("loads.ods", "workbook of LibreOffice"),
    ],
)
def test_recognise__names_programs_whose_files_are_not_read(tmp_path, name, message):
    content = b"Field Output Report, written Mon Oct  3" if name.endswith("rpt") else b"\0\1"
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        recognise(tmp_path / name)
