"""Deformed meshes over load: XDMF time series, PVD collections and lists of VTU files.

meshio reads them, after `ridgebayes.fea.mesh_files` has checked links, sizes and paths.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import parse_number
from ridgebayes.fea.mesh_files import is_beside, parse_xml, read_vtu, read_xdmf
from ridgebayes.fea.record import FARTHEST, HUGE, provenance

_ROUND = 5e-6  # of R: nodes so near to the circle are on it
_MOST_NAMED = 5  # files that a source names beside the first


def read_series(
    paths: Sequence[Path],
    *,
    R: float | None = None,
    field: str | None = None,
    time: str | None = None,
    loads: Sequence[float] | None = None,
) -> ContactHistory:
    """Read a series of deformed meshes.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        An ``.xdmf`` time series (numbers in it, or in an HDF5 file in its folder), a ``.pvd`` with
        its ``.vtu`` files in its folder, or several ``.vtu`` files, of an undeformed plane mesh
        down from the cylinder's mid-plane.
    R : float, length, or None
        Radius; None takes the mesh's extent at its mid-plane.
    field : str or None
        Point data that hold the displacement, in the units of the points; "displacement" if None.
    time : {"p_over_E", "line", None}
        Whether the series' time is p/E, the default, or the body's line load 2 R p.
    loads : sequence of float or None
        The same for each of several ``.vtu`` files, which have no time, or of those of a ``.pvd``
        whose times are no loads.

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a file cannot be understood; if it has a document type, entities, an encoding other than
        UTF-8, numbers elsewhere than in its folder, or more than 2 GiB of them.
    """
    field = field or "displacement"
    if time not in (None, "p_over_E", "line"):
        raise InputError(f"--time {time}: expected p_over_E or line")
    if not paths:
        raise InputError("no files; expected one .xdmf or .pvd, or several .vtu")
    where, first = str(paths[0]), paths[0]
    suffixes = {one.suffix.lower() for one in paths}
    is_single = len(paths) == 1 and suffixes <= {".xdmf", ".xmf", ".pvd"}
    if is_single and loads and suffixes != {".pvd"}:
        raise InputError(f"{where}: loads of a series; expected its times")
    if suffixes == {".pvd"} and is_single:
        paths, times = _of_pvd(first)
        loads = loads or times
        states = _of_vtus(paths, field, loads)
    elif is_single:
        states = _of_xdmf(first, field)
    elif suffixes == {".vtu"}:
        states = _of_vtus(paths, field, loads)
    else:
        raise InputError(f"{where}: expected one .xdmf or .pvd, or several .vtu")
    points, moved = (np.asarray(one, dtype=float) for one in (states.points, states.moved))
    nodes, R = _rim(points, R, where)
    most = np.abs(moved).max(axis=(1, 2))
    if not most.max() <= FARTHEST * R:
        raise InputError(
            f"{states.places[most.argmax()]}: {field!r} up to {most.max():.3g}; expected within "
            f"{FARTHEST:g} R"
        )
    at = points[nodes, :2] + moved[:, nodes, :2]
    named = [one.name for one in paths if one != first][:_MOST_NAMED]
    return ContactHistory(
        states.loads,
        where,
        provenance(first, "series", f"field={field}", *named),
        "series",
        at[..., 0],
        at[..., 1],
        undeformed=points[nodes, :2],
        R=R,
        digits=float(np.finfo(states.moved.dtype).eps * most.max()),
        load_is=time or "p_over_E",
        messages=(
            f"{where}: {len(moved)} states, {len(nodes)} of {len(points)} nodes are the rim",
        ),
    )


def _of_pvd(path: Path) -> tuple[list[Path], list[float]]:
    """Return the files that a collection lists, in its folder, and their times."""
    found: dict[float, Path] = {}
    listed = parse_xml(path).findall("Collection/DataSet")
    for one in listed:
        name, word = one.get("file", ""), one.get("timestep", "")
        time, target = parse_number(word.strip()), path.parent / name
        if not (name and is_beside(path, name) and target.suffix.lower() == ".vtu"):
            raise InputError(f"{path}: file {name[:80]!r}; expected a .vtu in the same folder")
        if not 0 <= time <= HUGE:
            raise InputError(f"{path}: timestep {word[:40]!r} of {name[:80]!r}; expected a load")
        if time in found:
            raise InputError(
                f"{path}: timestep {word[:40]!r} twice; expected one file a step, of one part"
            )
        found[time] = target
    if len(found) < 2:
        raise InputError(f"{path}: {len(found)} files; expected a collection of two or more .vtu")
    return list(found.values()), list(found)


class _States(NamedTuple):
    """States in the files of a series.

    Parameters
    ----------
    points : ndarray of float, shape (n_point, 2 or 3), length
        Undeformed.
    moved : ndarray of float, shape (n_state, n_point, 2), length
        Displacements.
    loads : ndarray of float, shape (n_state,)
        Time of each state.
    places : list of str
        Where each state stands, for messages.
    """

    points: FloatArray
    moved: FloatArray
    loads: FloatArray
    places: list[str]


def _of_xdmf(path: Path, field: str) -> _States:
    """Read a time series of one mesh."""
    points, moved, words = read_xdmf(path, field)
    times = [parse_number(word.strip()) for word in words]
    for k, (word, time) in enumerate(zip(words, times, strict=True), start=1):
        if not 0 <= time <= HUGE:
            raise InputError(
                f"{path}, state {k}: time {word[:40]!r}; expected a load, from 0 to {HUGE:g}"
            )
    places = [f"{path}, state {k}" for k in range(1, len(moved) + 1)]
    return _States(points, np.array(moved), np.array(times), places)


def _of_vtus(paths: Sequence[Path], field: str, loads: Sequence[float] | None) -> _States:
    """Read VTU files of one mesh."""
    if len(paths) < 2 or loads is None or len(loads) != len(paths):
        given = "no" if loads is None else f"{len(loads)}"
        raise InputError(
            f"{paths[0]}: {len(paths)} .vtu with {given} loads; expected two or more .vtu "
            "files with one load each, or one .xdmf series"
        )
    for path, load in zip(paths, loads, strict=True):
        if not 0 <= load <= HUGE:
            raise InputError(f"{path}: loads of {load:g}; expected finite numbers, 0 to {HUGE:g}")
    states = [read_vtu(path, field) for path in paths]
    points = states[0][0]
    for path, (here, _) in zip(paths, states, strict=True):
        if not np.array_equal(here, points):
            raise InputError(f"{path}: points are not those of {paths[0]}; expected one mesh")
    moved = np.array([one for _, one in states])
    return _States(points, moved, np.array(loads, dtype=float), [str(path) for path in paths])


def _rim(points: FloatArray, R: float | None, where: str) -> tuple[np.ndarray, float]:
    """Return the nodes of the lower rim, and R."""
    if not len(points) or points.shape[1] not in (2, 3):
        raise InputError(
            f"{where}: points of shape {points.shape}; expected (n, 2 or 3), n above 0"
        )
    if not (most := float(np.abs(points).max())) <= HUGE:
        raise InputError(f"{where}: a point {most:.3g} away; expected coordinates within {HUGE:g}")
    if points.shape[1] == 3 and np.ptp(points[:, 2]) > 0:
        raise InputError(f"{where}: z from {points[:, 2].min():g}; expected a plane mesh")
    lowest = points[np.argmin(points[:, 1])]
    R = R if R is not None else float(np.abs(points[:, 0] - lowest[0]).max())
    if not R >= 1 / HUGE:
        raise InputError(f"{where}: points within {R:.3g}; expected a disk, or --R")
    centre = lowest[:2] + np.array([0.0, R])
    away = np.hypot(*(points[:, :2] - centre).T)
    if not away.max() <= R * (1 + _ROUND):
        raise InputError(
            f"{where}: a node {away.max():.6g} from ({centre[0]:.4g}, {centre[1]:.4g}), and "
            f"R = {R:.6g}; expected a disk, undeformed, its lowest node below its centre; or --R"
        )
    on = (away >= R * (1 - _ROUND)) & (points[:, 1] <= centre[1] + _ROUND * R)
    return np.flatnonzero(on), R
