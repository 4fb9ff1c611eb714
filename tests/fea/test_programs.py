"""FEBio's logs, ANSYS's listings, CalculiX's .frd, collections of meshes: one run in each."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from ridgebayes.errors import InputError
from ridgebayes.fea.read import Given, import_files, recognise

WRITER = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("abaqus_writer.py"))))
RUN = WRITER.pressed(R=8.0, E=0.06)
MOVED = RUN["position"] - RUN["nodes"]
GIVEN = {"texture": (RUN["a"], RUN["b"]), "nu": "0.5", "E": "0.06"}


def write(folder, **texts):
    paths = [folder / name.replace("__", ".") for name in texts]
    for path, text in zip(paths, texts.values(), strict=True):
        path.write_text(text)
    return paths


def frame(paths, **given):
    return import_files(paths, Given(**GIVEN | given)).table.frame


def check(found, tolerance=6e-3):
    assert found["Q"].tolist() == RUN["Q"]
    # Second order in the increment; printed digits are far below.
    np.testing.assert_allclose(found["p_over_E"], RUN["load"], rtol=tolerance)
    assert (np.abs(found["p_over_E"] / RUN["load"] - 1) < 3 * found["rel_se"]).all()


# --- FEBio ---------------------------------------------------------------------------------------


def febio(values, data, n_step=None):
    """A log of rows by step, zeros before the first."""
    out = []
    for step, rows in enumerate([np.zeros_like(values[0]), *values]):
        out += [f"*Step  = {step}", f"*Time  = {step / 40:.6g}", f"*Data  = {data}"]
        out += [f"{i}," + ",".join(f"{v:.8g}" for v in row) for i, row in enumerate(rows, start=1)]
    return "\n".join(out) + "\n"


RIM = febio(RUN["position"], "x;y")
PLATE = febio(-RUN["force"][:, None, None], "Fy")
FEBIO = {"R": "8", "top": RUN["top"]}


@pytest.mark.parametrize("order", [1, -1])
def test_febio__finds_the_loads_of_two_logs_in_any_order(tmp_path, order):
    paths = write(tmp_path, rim__txt=RIM, plate__txt=PLATE)[::order]
    done = import_files(paths, Given(**GIVEN | FEBIO))
    check(done.table.frame)
    assert any("ignored, zeros, as before the first step" in text for text in done.messages)
    assert set(done.table.frame["solver"]) == {"febio"}


def test_febio__without_top_is_where_the_body_rests(tmp_path):
    found = frame(write(tmp_path, rim__txt=RIM, plate__txt=PLATE), R="8")
    np.testing.assert_allclose(found["p_over_E"], RUN["load"], rtol=2e-2)


@pytest.mark.parametrize(
    ("texts", "given", "message"),
    [
        (
            {"rim__txt": RIM},
            FEBIO,
            "data x, y, and Fy or Ry; .*import POSITIONS FORCES.*Fy or Ry missing",
        ),
        ({"plate__txt": PLATE}, FEBIO, "x missing"),
        (
            {"rim__txt": RIM, "again__txt": RIM, "plate__txt": PLATE},
            FEBIO,
            "x twice; expected once",
        ),
        ({"rim__txt": RIM, "plate__txt": PLATE}, {}, r"--R: missing"),
        (
            {"rim__txt": RIM + "7,1\n", "plate__txt": PLATE},
            FEBIO,
            r"rim\.txt, line \d+: .*node, x, y",
        ),
        (
            {"rim__txt": RIM.replace("0.1", "0,1", 1), "plate__txt": PLATE},
            FEBIO,
            "expected node, x, y",
        ),
        ({"rim__txt": "*Step = 1\n1,2\n", "plate__txt": PLATE}, FEBIO, "line 2: '1,2'; expected"),
    ],
)
def test_febio__what_cannot_be_understood_is_named(tmp_path, texts, given, message):
    with pytest.raises(InputError, match=message):
        frame(write(tmp_path, **texts), **given)


# --- ANSYS ---------------------------------------------------------------------------------------

PAGE = (
    "\n1\n\n PRINT {}\n\n  ***** POST1 NODAL {} LISTING *****\n\n"
    "  LOAD STEP={:6d}  SUBSTEP=     1\n"
)
NODES = range(1001, 1001 + len(RUN["nodes"]))


def listing(names, rows, columns, title="SOLUTION PER NODE", page=40):
    """A page a number of rows, of each step; values run together where they are negative."""
    out = []
    for step, values in enumerate(rows, start=1):
        for start in range(0, len(values), page):
            out.append(PAGE.format(title, "DEGREE OF FREEDOM", step))
            out.append("\n    NODE" + "".join(f"{name:>14}" for name in columns))
            for node, row in zip(names[start:], values[start : start + page], strict=False):
                out.append(f"{node:9d}" + "".join(f"{v:12.5E}" for v in row))
        out.append("\n MAXIMUM ABSOLUTE VALUES\n NODE       1001       1001\n VALUE   1.0 2.0\n")
    return "\n".join(out) + "\n"


def places(names, nodes):
    """A list of nodes."""
    head = "\n LIST ALL SELECTED NODES.\n\n    NODE        X             Y             Z\n"
    rows = zip(names, nodes.tolist(), strict=True)
    return head + "".join(f"{n:9d}{x:14.8f}{y:14.8f}{0.0:14.8f}\n" for n, (x, y) in rows)


PLACES = places(NODES, RUN["nodes"])
U = listing(NODES, MOVED, ("UX", "UY"))
FORCES = np.stack([0.25 * RUN["force"], 0.75 * RUN["force"]], axis=1)
REACTION = listing([900, 901], np.stack([0 * FORCES, -FORCES], axis=2), ("FX", "FY"))
CORNERS = [int(np.argmin(np.abs(RUN["nodes"][:, 0] - far))) for far in RUN["corners"][1:5]]


def status(low=1e-7):
    """Codes of all nodes: near contact where the rim is low, sliding or sticking on the tops."""
    height = RUN["position"][..., 1] - RUN["top"]
    on = np.abs(np.mod(RUN["position"][..., 0] - 0.12, 0.64) - 0.2) <= 0.2 + 1e-9
    code = np.where(height < 0.05, 1.0, 0.0)
    return np.where((height < low) & on, 2.0 + np.arange(height.shape[1]) % 2, code)[..., None]


def test_ansys__displacements_find_the_loads(tmp_path):
    paths = write(tmp_path, u__lis=U, f__lis=REACTION, n__lis=PLACES)
    done = import_files(paths, Given(**GIVEN, R="8", top=RUN["top"]))
    check(done.table.frame)
    assert any("34 increments" in line for line in done.messages)


def test_ansys__status_brackets_the_loads_and_near_contact_is_open(tmp_path):
    stat = listing(NODES, status(), ("STAT",))
    paths = write(tmp_path, s__lis=stat, f__lis=REACTION, n__lis=PLACES)
    found = frame(paths, R="8")
    assert found["Q"].tolist() == RUN["Q"]
    assert (found["p_over_E"] >= RUN["load"]).all()
    late = frame(paths, R="8", closed_is=(3,))
    assert (late["p_over_E"] >= found["p_over_E"]).all()
    early = frame(paths, R="8", closed_is=(1, 2, 3))
    assert early["p_over_E"].iloc[-1] < found["p_over_E"].iloc[-1]


def test_ansys__nodes_at_corners_need_no_places(tmp_path):
    nodes = [NODES[i] for i in CORNERS]
    code = np.array([np.array(RUN["load"]) <= p for p in RUN["force"] / (8 * 0.06)])
    code = np.hstack([2.0 + code, np.zeros((34, 1))])[..., None]  # 2 or 3
    stat = listing(nodes, code, ("STAT",))
    paths = write(tmp_path, s__lis=stat, f__lis=REACTION)
    with pytest.raises(InputError, match="have no place: expected a listing of NLIST") as error:
        frame(paths, R="8")
    assert error.value.mapping == {f"status Q={4 + 2 * i}": str(n) for i, n in enumerate(nodes)}
    corners = tuple(f"{key}={node}" for key, node in error.value.mapping.items())
    with pytest.raises(InputError, match="--symmetry: missing; expected half or full"):
        frame(paths, R="8", map=corners, closed_is=(3,))
    found = frame(paths, R="8", map=corners, closed_is=(3,), symmetry="half")
    load = RUN["force"] / (8 * 0.06)
    for row, reached in zip(found.itertuples(), RUN["load"], strict=True):
        above = np.flatnonzero(load >= reached)[0]
        # Six digits of a force are printed.
        assert row.p_over_E == pytest.approx(load[above], rel=1e-5)
        assert row.p_over_E_lower == pytest.approx(load[above - 1], rel=1e-5)


@pytest.mark.parametrize(
    ("texts", "message"),
    [
        (
            {"u__lis": U, "n__lis": PLACES},
            r"expected listings: ridgebayes import PRNSOL\.lis PRRSOL\.lis",
        ),
        ({"f__lis": REACTION}, "ignored, UY missing"),
        ({"u__lis": U, "f__lis": REACTION}, "no X and Y; expected NLIST beside"),
        ({"u__lis": U.replace("     UY", "     UZ"), "f__lis": REACTION}, "UY missing"),
        (
            {"u__lis": U.replace(" 1002", " x002", 1), "f__lis": REACTION, "n__lis": PLACES},
            "other n",
        ),
        (
            {"u__lis": U.replace("E-0", "Q-0", 1), "f__lis": REACTION, "n__lis": PLACES},
            "expected a finite number",
        ),
        (
            {"u__lis": U, "f__lis": REACTION[: REACTION.rindex("  901 ") + 9], "n__lis": PLACES},
            "has no end",
        ),
        (
            {"u__lis": U, "f__lis": REACTION[: REACTION.rindex("  901 ")], "n__lis": PLACES},
            "FY of other nodes",
        ),
    ],
)
def test_ansys__what_cannot_be_understood_is_named(tmp_path, texts, message):
    with pytest.raises(InputError, match=message):
        frame(write(tmp_path, **texts), R="8")


# --- CalculiX's .frd -----------------------------------------------------------------------------


def fixed(value):
    """A number of E12.5, the E left out of a long exponent as Fortran does."""
    text = f"{value:12.5E}"
    return text if len(text) <= 12 else f"{value:.5E}".replace("E", "")


def frd(form=1, tiny=0.0, run=RUN):
    width, n = 10 if form else 5, len(run["nodes"])
    out, still = ["    1C", "    2C"], (0.0, 0.0, 0.0)
    for k, force in enumerate(run["force"]):
        moved = {
            i: (*row, tiny) for i, row in enumerate(run["position"][k] - run["nodes"], start=1)
        } | {n + 1: still}
        forces = dict.fromkeys(moved, still) | {n + 1: (0.0, -force, 0.0)}
        for name, some in (("DISP", moved), ("FORC", forces)):
            head = f"  100CL{101 + k:5d}{k + 1:12.5E}{len(moved):12d}{'':20}{0:2d}{1:5d}"
            out.append(f"{head}{'':10}{form:2d}")
            out.append(f" -4  {name:8}    4    1")
            out += [f" -5  {c:8}    1    2    {i}    0" for i, c in enumerate(("D1", "D2", "D3"))]
            out.append(" -5  ALL         1    2    0    0    1ALL")
            for node, row in some.items():
                out.append(f" -1{node:{width}d}" + "".join(map(fixed, row)))
            out.append(" -3")
    return "\n".join([*out, " 9999", ""])


def read_frd(folder, text):
    (folder / "run.inp").write_text(WRITER.deck_text(RUN))
    return frame(write(folder, run__frd=text), surface="RIM", reaction="TOP")


@pytest.mark.parametrize(("form", "tiny"), [(1, 0.0), (0, -3.14159e-101)])
def test_frd__finds_the_loads_in_columns_that_touch(tmp_path, form, tiny):
    text = frd(form, tiny)
    assert not tiny or "-3.14159-101" in text
    check(read_frd(tmp_path, text))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("FORC", "STRE", r"fx, fy, fz missing"),
        (" -1         5", " -1         4", "node '4'; expected a whole number, each node once"),
        ("0.00000E+00", "0.0x000E+00", "expected a finite number"),
        (f"{'':10} 1\n -4", f"{'':10} 2\n -4", "format '2'; expected text"),
    ],
)
def test_frd__what_cannot_be_understood_is_named(tmp_path, old, new, message):
    text = frd()
    assert old in text
    with pytest.raises(InputError, match=message):
        read_frd(tmp_path, text.replace(old, new))


# --- collections of meshes -----------------------------------------------------------------------


def vtu(k):
    points = np.vstack([RUN["nodes"], 8.0 * np.column_stack([np.ones(1), np.zeros(1)])])
    moved = np.vstack([MOVED[k], np.zeros((1, 2))])

    def array(values, name):
        rows = "\n".join(f"{x!r} {y!r} 0.0" for x, y in values.tolist())
        head = f'<DataArray type="Float64" Name="{name}" NumberOfComponents="3" format="ascii">'
        return f"{head}\n{rows}\n</DataArray>"

    line = {"connectivity": "0 1", "offsets": "2", "types": "3"}  # of two nodes
    cells = "".join(
        f'<DataArray type="Int32" Name="{name}" format="ascii">{text}</DataArray>'
        for name, text in line.items()
    )
    return (
        '<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" byte_order="LittleEndian">'
        f'<UnstructuredGrid><Piece NumberOfPoints="{len(points)}" NumberOfCells="1">'
        f"<Cells>{cells}</Cells><Points>{array(points, 'Points')}</Points>"
        f"<PointData>{array(moved, 'U')}</PointData>"
        "</Piece></UnstructuredGrid></VTKFile>\n"
    )


def pvd(files):
    rows = "".join(
        f'<DataSet timestep="{2 * load!r}" group="" part="0" file="{name}"/>\n'
        for name, load in files
    )
    return f'<VTKFile type="Collection"><Collection>\n{rows}</Collection></VTKFile>\n'


LISTED = [(f"s{k}.vtu", float(load)) for k, load in enumerate(RUN["force"])]
SERIES = {"field": "U", "time": "line", "top": RUN["top"]}


def test_pvd__times_are_the_loads(tmp_path):
    for k, (name, _) in enumerate(LISTED):
        (tmp_path / name).write_text(vtu(k))
    paths = write(tmp_path, run__pvd=pvd(LISTED))
    found = frame(paths, **SERIES)
    check(found)
    with pytest.raises(InputError, match="--time: missing; expected line or p_over_E"):
        frame(paths, field="U", top=RUN["top"])
    loads = tuple(2 * load for _, load in LISTED)
    same = frame(write(tmp_path, run__pvd=pvd(enumerated(LISTED))), loads=loads, **SERIES)
    assert same["p_over_E"].tolist() == found["p_over_E"].tolist()


def enumerated(files):
    return [(name, float(k)) for k, (name, _) in enumerate(files)]


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ([("../s0.vtu", 0.1), ("s1.vtu", 0.2)], "expected a .vtu in the same folder"),
        ([("/etc/s0.vtu", 0.1)], "expected a .vtu in the same folder"),
        ([("s0.vtk", 0.1)], "expected a .vtu in the same folder"),
        ([("s0.vtu", 0.1), ("s1.vtu", 0.1)], "twice; expected one file a step"),
        ([("s0.vtu", -0.1), ("s1.vtu", 0.2)], "s0.vtu: no such file"),
        ([("s0.vtu", 0.1)], "1 .vtu with 1 loads; expected two or more"),
        ([("s0.vtu", 0.1), ("s1.vtu", 0.2)], "s0.vtu: no such file"),
    ],
)
def test_pvd__what_is_no_series_is_refused(tmp_path, files, message):
    with pytest.raises(InputError, match=message):
        frame(write(tmp_path, run__pvd=pvd(files)), **SERIES)


# --- any other program ---------------------------------------------------------------------------


def node_table(header, values, decimals=9):
    """A row for each node at each step."""
    rows = [header]
    for k, force in enumerate(RUN["force"]):
        for i, (x, value) in enumerate(zip(RUN["position"][k, :, 0], values[k], strict=True)):
            rows.append(f"{k},{i},{force:.9g},{x:.9f},{value:.{decimals}f}")
    return "\n".join(rows) + "\n"


GAP = RUN["position"][..., 1] - RUN["top"]


def test_nodes__gaps_of_any_program_find_the_loads(tmp_path):
    paths = write(tmp_path, n__csv=node_table("Step,Node,RF2,X,COPEN", GAP))
    found = import_files(paths, Given(**GIVEN, R="8"), program="nodes")
    check(found.table.frame)
    assert "34 steps of 241 nodes, by gap" in found.messages


def test_nodes__status_and_pressure_bracket_the_loads(tmp_path):
    text = node_table("Step,Node,RF2,X,CSTATUS", status()[..., 0], decimals=0)
    given = Given(**GIVEN, R="8", closed_is=(2, 3))
    found = import_files(write(tmp_path, n__csv=text), given, program="nodes").table.frame
    pressure = node_table("Inc,Node,F,Place,CPRESS", np.where(status()[..., 0] > 1, 0.5, 0.0))
    named = Given(**GIVEN, R="8", map=("load=F", "x=Place"))
    other = import_files(write(tmp_path, p__csv=pressure), named, program="nodes").table.frame
    assert found["Q"].tolist() == RUN["Q"]
    assert (found["p_over_E"] >= RUN["load"]).all()
    assert found["p_over_E"].tolist() == other["p_over_E"].tolist()


@pytest.mark.parametrize(
    ("change", "given", "message"),
    [
        (("COPEN", "Note"), {}, r"no column gap, pressure or status: .*--map 'gap=HEADER'"),
        (("RF2", "Note"), {}, "no column load"),
        (("COPEN", "CSTATUS"), {}, "expected open or 0, closed or 1"),
        (("\n0,1,", "\n0,0,"), {}, "a node twice in a step"),
        (("\n0,1,", "\n0,999,"), {}, "steps of other nodes"),
        (("\n0,1,", "\n0,1,9"), {}, "a step with several loads"),
        (("\n0,1,", "\n0,1,x"), {}, "line 3, column 'RF2' = .*: expected a finite number"),
        (("", ""), {"map": ("gap=Nothing",)}, "--map gap=Nothing: expected one of step, node, x"),
    ],
)
def test_nodes__what_cannot_be_understood_is_named(tmp_path, change, given, message):
    text = node_table("Step,Node,RF2,X,COPEN", GAP)
    paths = write(tmp_path, n__csv=text.replace(*change, 1))
    with pytest.raises(InputError, match=message):
        import_files(paths, Given(**GIVEN, R="8", **given), program="nodes")


# --- which program -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "text", "program"),
    [
        ("log.txt", RIM, "febio"),
        ("u.lis", U, "ansys"),
        ("n.txt", PLACES, "ansys"),
        ("run.frd", "    1C\n", "calculix"),
        ("run.pvd", pvd(LISTED), "series"),
    ],
)
def test_recognise__knows_its_programs(tmp_path, name, text, program):
    (tmp_path / name).write_text(text)
    assert recognise(tmp_path / name) == program


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("d3plot", "LS-DYNA is not read; export a table"),
        ("press.mphtxt", "COMSOL file is not read; export results as a table"),
        ("press.t16", "Marc post file"),
        ("press.odb", "Abaqus database is not read; write a field report"),
        ("press.rst", "ANSYS database is not read; list PRNSOL and PRRSOL"),
        ("press.xplt", "FEBio .* is not read; ask for log data"),
        ("press.op2", "Nastran"),
    ],
)
def test_recognise__names_programs_whose_files_are_not_read(tmp_path, name, message):
    (tmp_path / name).write_bytes(b"\0\1")
    with pytest.raises(InputError, match=message):
        recognise(tmp_path / name)
