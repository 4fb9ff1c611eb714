"""A run of known loads in the files of every program that is read, and what `import` makes of it.

The first file of a kind is the one that tests change.
"""

import functools
import os
import tempfile
from pathlib import Path

import meshio
import numpy as np

from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import Given
from tests.fea import abaqus_writer as writer
from tests.fea.abaqus_writer import pressed

RUN = pressed()
SETS = {"surface": "RIM", "reaction": "TOP"}
PAGE = (
    "\n1\n\n PRINT {}\n\n  ***** POST1 NODAL {} LISTING *****\n\n"
    "  LOAD STEP={:6d}  SUBSTEP=     1\n"
)


def with_z(plane):
    return np.column_stack([plane, np.zeros(len(plane))])


# --- CalculiX -------------------------------------------------------------------------------------


def sta(run, n_tail=0):
    """A status of increments at the times of `abaqus_writer.calculix_text`."""
    n = len(run["force"]) - n_tail
    rows = [f"     1 {k:10d}     1     9  {k:.6E}  {k:.6E}  0.100000E+00" for k in range(1, n + 1)]
    rows += [f"     1 {n + 1:10d}     {k}U   60  {n:.6E}  {n:.6E}  0.1E+00" for k in range(n_tail)]
    return "\n".join(["SUMMARY OF JOB INFORMATION", *rows, ""])


def fixed(value):
    """A number of E12.5, the E left out of a long exponent as Fortran does."""
    text = f"{value:12.5E}"
    return text if len(text) <= 12 else f"{value:.5E}".replace("E", "")


def frd(run, form=1, tiny=0.0):
    width, n = 10 if form else 5, len(run["nodes"])
    out, still = ["    1C", "    2C"], (0.0, 0.0, 0.0)
    for k, force in enumerate(run["force"]):
        rows = enumerate(run["position"][k] - run["nodes"], start=1)
        moved = {i: (*row, tiny) for i, row in rows} | {n + 1: still}
        forces = dict.fromkeys(moved, still) | {n + 1: (0.0, -force, 0.0)}
        for name, some in (("DISP", moved), ("FORC", forces)):
            head = f"  100CL{101 + k:5d}{k + 1:12.5E}{len(moved):12d}{'':20}{0:2d}{1:5d}"
            out += [f"{head}{'':10}{form:2d}", f" -4  {name:8}    4    1"]
            out += [f" -5  {c:8}    1    2    {i}    0" for i, c in enumerate(("D1", "D2", "D3"))]
            out += [" -5  ALL         1    2    0    0    1ALL"]
            out += [f" -1{i:{width}d}" + "".join(map(fixed, row)) for i, row in some.items()]
            out += [" -3"]
    return "\n".join([*out, " 9999", ""])


# --- FEBio, ANSYS, any program --------------------------------------------------------------------


def febio(values, data):
    """A log of rows by step, zeros before the first."""
    out = []
    for step, rows in enumerate([np.zeros_like(values[0]), *values]):
        out += [f"*Step  = {step}", f"*Time  = {step / 40:.6g}", f"*Data  = {data}"]
        out += [f"{i}," + ",".join(f"{v:.8g}" for v in row) for i, row in enumerate(rows, start=1)]
    return "\n".join(out) + "\n"


def plate(run):
    return febio(-run["force"][:, None, None], "Fy")


def interleaved(run):
    """Both logs in one file, record by record."""
    logs = (febio(run["position"], "x;y"), plate(run))
    steps = zip(*(log.split("*Step")[1:] for log in logs), strict=True)
    return "".join(f"*Step{at}*Data{force.split('*Data')[1]}" for at, force in steps)


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


def node_names(run):
    return range(1001, 1001 + len(run["nodes"]))


def places(run):
    """A list of nodes."""
    head = "\n LIST ALL SELECTED NODES.\n\n    NODE        X             Y             Z\n"
    rows = zip(node_names(run), run["nodes"].tolist(), strict=True)
    return head + "".join(f"{n:9d}{x:14.8f}{y:14.8f}{0.0:14.8f}\n" for n, (x, y) in rows)


def reactions(run):
    forces = np.stack([0.25 * run["force"], 0.75 * run["force"]], axis=1)
    return listing([900, 901], np.stack([0 * forces, -forces], axis=2), ("FX", "FY"))


def status(run, low=1e-7):
    """Codes of all nodes: near contact where the rim is low, sliding or sticking on the tops."""
    height = (run["position"][..., 1] - run["top"]) / run["R"]
    a, b = run["a"], run["b"]
    away = np.abs(run["position"][..., 0]) / run["R"]
    on = np.abs(np.mod(away - b / 2, a + b) - a / 2) <= a / 2 + 1e-9
    code = np.where(height < 0.006, 1.0, 0.0)
    return np.where((height < low) & on, 2.0 + np.arange(height.shape[1]) % 2, code)[..., None]


def node_table(run, header, values, decimals=9):
    """A row for each node at each step."""
    rows = [header]
    for k, force in enumerate(run["force"]):
        for i, (x, value) in enumerate(zip(run["position"][k, :, 0], values[k], strict=True)):
            rows.append(f"{k},{i},{force:.9g},{x:.9f},{value:.{decimals}f}")
    return "\n".join(rows) + "\n"


# --- deformed meshes ------------------------------------------------------------------------------


def points(run):
    """The rim to the mid-plane, and nodes inside; and the displacements of all."""
    outer = np.linspace(0.9, np.pi / 2, 8)[1:]
    angle = np.concatenate([-outer, outer]) if (run["nodes"][:, 0] < 0).any() else outer
    more = run["R"] * np.column_stack([np.sin(angle), -np.cos(angle)])
    inside = 0.5 * run["nodes"][::4]
    still = np.zeros((len(run["force"]), len(more) + len(inside), 2))
    moved = np.concatenate([run["position"] - run["nodes"], still], axis=1)
    return np.vstack([run["nodes"], more, inside]), moved


def line_loads(run):
    return run["force"] * (1 if (run["nodes"][:, 0] < 0).any() else 2)


def xdmf(run, data_format="HDF", times=None, name="displacement"):
    """Return an XDMF series, and the HDF5 file beside it."""
    at, moved = points(run)
    loads = line_loads(run) / (2 * run["R"] * run["E"]) if times is None else times
    here = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)  # the writer puts its .h5 into the current folder
        try:
            with meshio.xdmf.TimeSeriesWriter("run.xdmf", data_format=data_format) as series:
                series.write_points_cells(with_z(at), [("line", np.array([[0, 1]]))])
                for load, state in zip(loads, moved, strict=True):
                    series.write_data(float(load), point_data={name: with_z(state)})
            return {path.name: path.read_bytes() for path in sorted(Path().glob("run.*"))[::-1]}
        finally:
            os.chdir(here)


def vtus(run, dtype=float, **options):
    """Return a file of each state."""
    at, moved = points(run)
    files = {}
    with tempfile.TemporaryDirectory() as folder:
        for k, state in enumerate(moved):
            data = {"displacement": with_z(state).astype(dtype)}
            mesh = meshio.Mesh(with_z(at), [("line", np.array([[0, 1]]))], point_data=data)
            path = Path(folder) / f"{k}.vtu"
            meshio.vtu.write(path, mesh, **options)
            files[path.name] = path.read_bytes()
    return files


def pvd(names, loads):
    rows = "".join(
        f'<DataSet timestep="{load!r}" group="" part="0" file="{name}"/>\n'
        for name, load in zip(names, loads, strict=True)
    )
    return f'<VTKFile type="Collection"><Collection>\n{rows}</Collection></VTKFile>\n'


def pvd_files(run):
    states = vtus(run)
    return {"run.pvd": pvd(states, line_loads(run).tolist()), **states}


# --- kinds ----------------------------------------------------------------------------------------


def arrays(run):
    return run["force"], run["nodes"], run["position"]


def _of_deck(name, text):
    return lambda run: {name: text(run), "run.inp": writer.deck_text(run)}


def gaps(run):
    return run["position"][..., 1] - run["top"]


KINDS = {
    "calculix": _of_deck("run.dat", lambda run: writer.calculix_text(*arrays(run))),
    "frd": _of_deck("run.frd", frd),
    "abaqus-dat": _of_deck("run.dat", lambda run: writer.dat_text(*arrays(run))),
    "febio": lambda run: {"rim.txt": febio(run["position"], "x;y"), "plate.txt": plate(run)},
    "febio, interleaved": lambda run: {"log.txt": interleaved(run)},
    "ansys": lambda run: {
        "u.lis": listing(node_names(run), run["position"] - run["nodes"], ("UX", "UY")),
        "f.lis": reactions(run),
        "n.lis": places(run),
    },
    "ansys, status": lambda run: {
        "s.lis": listing(node_names(run), status(run), ("STAT",)),
        "f.lis": reactions(run),
        "n.lis": places(run),
    },
    "nodes": lambda run: {"n.csv": node_table(run, "Step,Node,RF2,X,COPEN", gaps(run))},
    "nodes, status": lambda run: {
        "n.csv": node_table(run, "Step,Node,RF2,X,CSTATUS", status(run)[..., 0], decimals=0)
    },
    "series": xdmf,
    "series, text": lambda run: xdmf(run, "XML"),
    "series, VTU": vtus,
    "series, PVD": pvd_files,
}
BRACKETS = ("ansys, status", "nodes, status")
_PROGRAMS = {"frd": "calculix"}


@functools.cache
def usual_files(kind):
    return KINDS[kind](RUN)


def given_of(kind, run, folder):
    """Return what a user gives beside the files."""
    full = bool((run["nodes"][:, 0] < 0).any())
    given = {"texture": (run["a"], run["b"]), "nu": "0.5", "E": f"{run['E']}"}
    given["symmetry"] = "full" if full else "half"
    if kind in ("calculix", "frd", "abaqus-dat"):
        return given | SETS | {"deck": folder / "run.inp"}
    if kind == "series, VTU":
        given |= {"loads": tuple(line_loads(run).tolist()), "time": "line"}
    if kind == "series, PVD":
        given["time"] = "line"
    if kind.startswith(("febio", "ansys", "nodes")):
        given["R"] = f"{run['R']}"
    if kind == "nodes, status":
        given["closed_is"] = (2, 3)
    return given if kind.startswith(("nodes", "ansys, s")) else given | {"top": run["top"]}


def paths_of(kind, files, folder):
    """Return the paths that a user names."""
    n = len(files) if kind.startswith(("febio", "ansys", "series, VTU")) else 1
    return [folder / name for name in list(files)[:n]]


def imported(folder, kind, change=None, *, run=RUN, files=None, program=None, **given):
    """Write the files of a kind, the first of them changed, and import them."""
    if files is None:
        files = usual_files(kind) if run is RUN else KINDS[kind](run)
    files = dict(files)
    if change is not None:
        first = next(iter(files))
        files[first] = change(files[first])
    for name, content in files.items():
        content = content if isinstance(content, bytes) else content.encode()
        (folder / name).write_bytes(content)
    program = program or _PROGRAMS.get(kind, kind.partition(",")[0])
    given = {key: v for key, v in (given_of(kind, run, folder) | given).items() if v is not None}
    return import_files(paths_of(kind, files, folder), Given(**given), program=program)
