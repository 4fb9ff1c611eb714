"""Reader for series of deformed meshes: XDMF time series, PVD collections and lists of VTU files.

meshio reads the files after `ridgebayes.fea.mesh_files` has checked links, sizes and paths.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Run
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import parse_number
from ridgebayes.fea.mesh_files import is_beside, parse_xml, read_vtu, read_xdmf
from ridgebayes.fea.record import FARTHEST, HUGE, SHOWN
from ridgebayes.fea.rim import NEAR
from ridgebayes.runtime.text import clipped


def read_series(run: Run) -> ContactHistory:
    """Read a series of deformed meshes.

    Parameters
    ----------
    run : Run
        An ``.xdmf`` time series (with data in the file or in an HDF5 file in its folder), a
        ``.pvd`` with ``.vtu`` files in its folder, or several ``.vtu`` files. The points are those
        of the undeformed plane mesh below the mid-plane of the cylinder. The radius is by default
        the extent of the mesh at the mid-plane. The fact `field` is the name of the point data of
        displacements, in the units of the points, by default "displacement". `time` is the meaning
        of times and loads: "p_over_E" (default), or "line" for the line load 2 R p of the whole
        body. `loads` gives one load for each ``.vtu`` file, if there is no ``.pvd`` or its times
        are not loads.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a file cannot be parsed, has a document type, entities or an encoding other than UTF-8,
        refers to data outside of its folder, or has more than 2 GiB of data.
    """
    paths, where, time, loads = run.paths, run.where, run.facts.time, run.facts.loads
    field = run.facts.field or "displacement"
    if time not in (None, "p_over_E", "line"):
        raise InputError(f"--time {time}: expected p_over_E or line")
    kinds = {path.suffix.lower() for path in paths}
    words: Sequence[object] = loads
    if kinds == {".pvd"} and len(paths) == 1:
        paths, times = _read_pvd(run.path)
        words = words or times
    elif kinds <= {".xdmf", ".xmf"} and len(paths) == 1 and not loads:
        points, moved, words = read_xdmf(run.path, field)
        places = [f"{where}, state {k}" for k in range(1, len(moved) + 1)]
    elif kinds != {".vtu"}:
        raise InputError(f"{where}: expected one .xdmf with its times, one .pvd, or several .vtu")
    if not kinds <= {".xdmf", ".xmf"}:
        if not 2 <= len(paths) == len(words):
            counts = f"{len(paths)} .vtu with {len(words)} loads"
            raise InputError(f"{where}: {counts}; expected two or more .vtu, with a load each")
        points, moved = _read_vtus(paths, field)
        places = [str(path) for path in paths]
    load = _loads(words, places)
    nodes, R = _rim(points, run.R, where)
    most = np.array([np.abs(state).max() for state in moved], dtype=float)
    if not most.max() <= FARTHEST * R:
        size = f"{field!r} up to {most.max():.3g}; expected within {FARTHEST:g} R"
        raise InputError(f"{places[most.argmax()]}: {size}")
    undeformed = np.asarray(points, dtype=float)[nodes, :2]
    rim = f"{len(nodes)} of {len(points)} nodes are the rim"
    return ContactHistory(
        load,
        undeformed + np.array(moved, dtype=float)[:, nodes],
        undeformed=undeformed,
        R=R,
        digits=float(np.finfo(np.result_type(*moved)).eps * most.max()),
        load_is=time or "p_over_E",
        messages=[f"{where}: {len(moved)} states, {rim}"],
        files=(f"field={field}", *[path.name for path in paths if path != run.path][:SHOWN]),
    )


def _loads(words: Sequence[object], places: Sequence[str]) -> FloatArray:
    """Parse the load of each state."""
    loads = np.array([parse_number(str(word).strip()) for word in words])
    for k in np.flatnonzero(~((loads >= 0) & (loads <= HUGE)))[:1]:
        shown = clipped(str(words[k]))
        raise InputError(f"{places[k]}: load {shown}; expected a number from 0 to {HUGE:g}")
    return loads


def _read_pvd(path: Path) -> tuple[list[Path], list[str]]:
    """Return the files of a collection, which must lie in its folder, and their times."""
    listed = parse_xml(path).findall("Collection/DataSet")
    names = [item.get("file", "") for item in listed]
    times = [item.get("timestep", "") for item in listed]
    for name in names:
        if not (name.lower().endswith(".vtu") and is_beside(path, name)):
            raise InputError(f"{path}: file {clipped(name)}; expected a .vtu in the same folder")
    if len(set(times)) < len(times):
        raise InputError(f"{path}: a timestep stands twice; expected one file for each step")
    return [path.parent / name for name in names], times


def _read_vtus(paths: Sequence[Path], field: str) -> tuple[FloatArray, list[FloatArray]]:
    """Return the points of VTU files with the same mesh, and the displacements of each file."""
    states = [read_vtu(path, field) for path in paths]
    points = states[0][0]
    for path, (others, _) in zip(paths, states, strict=True):
        if not np.array_equal(others, points):
            raise InputError(f"{path}: points are not those of {paths[0]}; expected one mesh")
    return points, [moved for _, moved in states]


def _rim(points: FloatArray, R: float | None, where: str) -> tuple[IntArray, float]:
    """Return the nodes of the lower rim, and the radius."""
    if not (most := float(np.abs(points).max(initial=0.0))) <= HUGE:
        raise InputError(f"{where}: a point {most:.3g} away; expected coordinates within {HUGE:g}")
    if not len(points) or (points[:, 2:] != points[0, 2:]).any():
        raise InputError(f"{where}: no points, or points with different z; expected a plane mesh")
    lowest = points[np.argmin(points[:, 1])]
    R = R if R is not None else float(np.abs(points[:, 0] - lowest[0]).max())
    centre = lowest[:2] + np.array([0.0, R])
    away = np.hypot(*(points[:, :2] - centre).T)
    if not (R >= 1 / HUGE and away.max() <= R * (1 + NEAR)):
        raise InputError(
            f"{where}: a node {away.max():.6g} from ({centre[0]:.4g}, {centre[1]:.4g}), and "
            f"R = {R:.6g}; expected a disk, undeformed, its lowest node below its centre; or --R"
        )
    on = (away >= R * (1 - NEAR)) & (points[:, 1] <= centre[1] + NEAR * R)
    return np.flatnonzero(on), R
