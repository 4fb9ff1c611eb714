"""Deformed meshes over load: XDMF time series and lists of VTU files.

Files are read here rather than by meshio, so that no size or path in them is taken on trust: see
`ridgebayes.fea.mesh_files`.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import parse_number
from ridgebayes.fea.mesh_files import Budget, Vtu, Xdmf, displacements, one_named
from ridgebayes.fea.record import FARTHEST, HUGE, Imported, provenance
from ridgebayes.fea.surface import Body, CylinderSurface, Origin, SurfaceHistory, table_from_history

_ROUND = 5e-6  # of R: nodes so near to the circle are on it
_REST = 3e-6  # of R: how well the height of a rim at rest on a ridge is known
_INSIDE = (0.1, 0.9)  # of a ridge's width: away from its corners, where meshes sink in
_LOWEST = 0.25  # of a ridge's nodes: where the body rests, if it rests on part of it
_LIFTED = 1e-4  # of R: nodes so far above those do not rest


def read_series(
    path: Path | Sequence[Path],
    body: Body,
    *,
    field: str = "displacement",
    time: str = "p_over_E",
    loads: Sequence[float] | None = None,
    brackets: bool = False,
) -> Imported:
    """Read a series of deformed meshes.

    Parameters
    ----------
    path : pathlib.Path or sequence of pathlib.Path
        An ``.xdmf`` time series (numbers in it, or in an HDF5 file in its folder), or several
        ``.vtu`` files, of an undeformed plane mesh down from the cylinder's mid-plane.
    body : Body
        What the files do not say. `R` None takes the mesh's extent at its mid-plane. `top` is
        where ridges' tops stand still; with None they are where the body rests on the first
        ridge, state by state, as for the XDMF files that this package writes.
    field : str, optional
        Point data that hold the displacement, in the units of the points.
    time : {"p_over_E", "line"}, optional
        Whether the series' time is p/E, or the body's line load 2 R p.
    loads : sequence of float, optional
        The same for each of several ``.vtu`` files, which have no time.
    brackets : bool, optional
        As `ridgebayes.fea.transitions.transitions_of`.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If a file cannot be understood; if it has a document type, entities, an encoding other than
        UTF-8, numbers elsewhere than in its folder, or more than 2 GiB of them.
    """
    if time not in ("p_over_E", "line"):
        raise InputError(f"--time {time}: expected p_over_E or line")
    paths = [path] if isinstance(path, Path) else list(path)
    if not paths:
        raise InputError("no files; expected one .xdmf, or several .vtu")
    where = str(paths[0])
    suffixes = {one.suffix.lower() for one in paths}
    if suffixes <= {".xdmf", ".xmf"} and len(paths) == 1:
        if loads is not None:
            raise InputError(f"{where}: loads of a series; expected its times")
        states = _of_xdmf(paths[0], field)
    elif suffixes == {".vtu"}:
        states = _of_vtus(paths, field, loads)
    else:
        raise InputError(f"{where}: expected one .xdmf, or several .vtu")
    points, moved = (np.asarray(one, dtype=float) for one in (states.points, states.moved))
    nodes, R = _rim(points, body, where)
    most = np.abs(moved).max(axis=(1, 2))
    if not most.max() <= FARTHEST * R:
        raise InputError(
            f"{states.places[most.argmax()]}: {field!r} up to {most.max():.3g}; expected within "
            f"{FARTHEST:g} R"
        )
    digits = float(np.finfo(states.moved.dtype).eps * most.max())
    body = replace(body, R=R)
    half = 2.0 if body.symmetry == "half" else 1.0
    scale = 2 * R * body.E if time == "p_over_E" else 1.0
    levels = SurfaceHistory(
        states.loads * (scale * body.thickness / half),
        points[nodes, :2],
        points[nodes, :2] + moved[:, nodes, :2],
        np.zeros((0, 2)),
        digits=digits,
        messages=(
            f"{where}: {len(moved)} states, {len(nodes)} of {len(points)} nodes are the rim",
        ),
    )
    if body.top is None:
        levels = _at_rest(levels, body, where)
        body = replace(body, top=0.0)
    source = provenance(paths[0], "series", f"field={field}", *(one.name for one in paths[1:]))
    return table_from_history(levels, body, Origin(where, "series", source), brackets=brackets)


class _States(NamedTuple):
    """What stands in the files of a series.

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
    file = Xdmf(path, Budget())
    series = [
        grid
        for grid in file.root.iter("Grid")
        if grid.get("GridType") == "Collection" and grid.get("CollectionType") == "Temporal"
    ]
    if file.root.tag != "Xdmf" or len(series) != 1:
        raise file.error(f"{len(series)} time series; expected one <Grid> of a collection")
    states = series[0].findall("Grid")
    points = file.points(states)
    moved, times = [], []
    places = [f"{path}, state {number}" for number in range(1, len(states) + 1)]
    for here, state in zip(places, states, strict=True):
        times.append(_time(here, state))
        given = state.findall("Attribute")
        data = one_named(here, field, [a for a in given if a.get("Center") == "Node"], given)
        moved.append(displacements(here, field, file.numbers(data), points))
    return _States(points, np.array(moved), np.array(times), places)


def _time(here: str, state: ET.Element) -> float:
    clocks = state.findall("Time")
    word = clocks[0].get("Value") if clocks else None
    if not word:
        raise InputError(f"{here}: no <Time Value=...>")
    if len(clocks) > 1:
        raise InputError(f"{here}: {len(clocks)} times; expected one")
    time = parse_number(word)
    if not 0 <= time <= HUGE:
        expected = "a load, from 0 to " if math.isfinite(time) else "a finite number, 0 to "
        raise InputError(f"{here}: time {word[:40]!r}; expected {expected}{HUGE:g}")
    return time


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
    budget = Budget()
    states = [Vtu(path, budget).state(field) for path in paths]
    points = states[0][0]
    for path, (here, _) in zip(paths, states, strict=True):
        if not np.array_equal(here, points):
            raise InputError(f"{path}: points are not those of {paths[0]}; expected one mesh")
    moved = np.array([one for _, one in states])
    return _States(points, moved, np.array(loads, dtype=float), [str(path) for path in paths])


def _rim(points: FloatArray, body: Body, where: str) -> tuple[np.ndarray, float]:
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
    R = body.R if body.R is not None else float(np.abs(points[:, 0] - lowest[0]).max())
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


def _at_rest(levels: SurfaceHistory, body: Body, where: str) -> SurfaceHistory:
    """Return levels seen from the ridges: tops at y = 0, where the body rests on the first."""
    rim = CylinderSurface.of(levels.undeformed, where, R=body.R, symmetry=body.symmetry)
    near, far = (rim.R * (body.b_over_R / 2 + part * body.a_over_R) for part in _INSIDE)
    away = np.abs(levels.position[..., 0] - rim.centre[0])
    position = levels.position.copy()
    for k, x in enumerate(away):
        over = (near <= x) & (x <= far)
        if not over.any():
            raise InputError(
                f"{where}, state {k + 1}: no rim node over the first ridge, {near:.4g} to "
                f"{far:.4g} from the axis; expected its texture and a mesh as fine, or --top"
            )
        # Nodes at rest scatter about the top by what the mesh leaves: their median does not.
        heights = position[k, over, 1]
        low = float(np.quantile(heights, _LOWEST))
        rest = float(np.median(heights[heights <= low + _LIFTED * rim.R]))
        # States at a transition touch by rounding only: a little lower they do.
        position[k, :, 1] -= rest + _REST * rim.R
    return replace(
        levels,
        position=position,
        digits=math.hypot(levels.digits, _REST * rim.R),
        messages=(
            *levels.messages,
            "tops: where the body rests on the first ridge, state by state",
        ),
    )
