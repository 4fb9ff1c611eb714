"""Deformed meshes over load: XDMF time series and lists of VTU files.

Files are read here rather than by meshio, so that no size or path in them is taken on trust: only
points and one field are read, sizes are held against limits first, and nothing outside of the
file's folder is opened.
"""

import base64
import binascii
import math
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Literal
from xml.etree import ElementTree as ET

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.importers.levels import Body, Levels, table_of
from ridgebayes.importers.record import LARGEST, Imported, finite, provenance, read_text
from ridgebayes.importers.rim import Rim

_LARGEST_XML = 64 * 2**20  # bytes: more would take a parser longer than a user waits
_ROUND = 5e-6  # of R: nodes so near to the circle are on it
_FARTHEST = 4.0  # of R: no body moves so far
_REST = 3e-6  # of R: how well the height of a rim at rest on a ridge is known
_INSIDE = (0.1, 0.9)  # of a ridge's width: away from its corners, where meshes sink in
_LOWEST = 0.25  # of a ridge's nodes: where the body rests, if it rests on part of it
_LIFTED = 1e-4  # of R: nodes so far above those do not rest
_ENCODING = re.compile(r"<\?xml[^>]*encoding\s*=\s*[\"']([^\"']*)")
_VTK = {
    **{f"Int{n}": f"i{n // 8}" for n in (8, 16, 32, 64)},
    **{f"UInt{n}": f"u{n // 8}" for n in (8, 16, 32, 64)},
    "Float32": "f4",
    "Float64": "f8",
}


@dataclass
class _Budget:
    """What is left of the bytes that a file's numbers may take."""

    where: str
    left: int = LARGEST

    def take(self, shape: Sequence[int]) -> None:
        self.left -= 8 * math.prod(shape)
        if self.left < 0:
            raise InputError(
                f"{self.where}: {' x '.join(map(str, shape))} numbers; rule: at most {LARGEST} "
                "bytes in all"
            )


def read_series(
    path: Path | Sequence[Path],
    body: Body,
    *,
    field: str = "displacement",
    time: Literal["p_over_E", "line"] = "p_over_E",
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
        As `ridgebayes.importers.increments.transitions_of`.

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
        raise InputError(f"time = {time!r}; rule: p_over_E or line")
    paths = [path] if isinstance(path, Path) else list(path)
    if not paths:
        raise InputError("no files; rule: one .xdmf, or several .vtu")
    where = str(paths[0])
    suffixes = {one.suffix.lower() for one in paths}
    if suffixes == {".xdmf"} and len(paths) == 1:
        if loads is not None:
            raise InputError(f"{where}: loads of a series; rule: its times")
        points, moved, times = _xdmf(paths[0], field)
    elif suffixes == {".vtu"}:
        points, moved, times = _vtus(paths, field, loads)
    else:
        raise InputError(f"{where}: rule: one .xdmf, or several .vtu")
    if not (np.isfinite(points).all() and np.isfinite(moved).all()):
        raise InputError(f"{where}: points or {field!r} are not all finite; rule: finite numbers")
    digits = float(np.finfo(moved.dtype).eps) * float(np.abs(moved).max(initial=0.0))
    points, moved = np.asarray(points, dtype=float), np.asarray(moved, dtype=float)
    nodes, R = _rim(points, body, where)
    if not (most := float(np.abs(moved).max())) <= _FARTHEST * R:
        raise InputError(f"{where}: {field!r} up to {most:.3g}; rule: within {_FARTHEST:g} R")
    body = replace(body, R=R)
    half = 2.0 if body.symmetry == "half" else 1.0
    scale = 2 * R * body.E if time == "p_over_E" else 1.0
    levels = Levels(
        times * scale * body.thickness / half,
        points[nodes, :2],
        points[nodes, :2] + moved[:, nodes, :2],
        np.zeros((0, 2)),
        digits=digits,
        said=(f"{where}: {len(times)} states, {len(nodes)} of {len(points)} nodes are the rim",),
    )
    if body.top is None:
        levels = _at_rest(levels, body, where)
        body = replace(body, top=0.0)
    source = provenance(paths[0], "series", f"field={field}", *(one.name for one in paths[1:]))
    return table_of(levels, body, where=where, solver="series", source=source, brackets=brackets)


def _rim(points: FloatArray, body: Body, where: str) -> tuple[np.ndarray, float]:
    """Return the nodes of the lower rim, and R."""
    if points.shape[1] == 3 and np.ptp(points[:, 2]) > 0:
        raise InputError(f"{where}: z from {points[:, 2].min():g}; rule: a plane mesh")
    lowest = points[np.argmin(points[:, 1])]
    R = body.R if body.R is not None else float(np.abs(points[:, 0] - lowest[0]).max())
    centre = lowest[:2] + np.array([0.0, R])
    away = np.hypot(*(points[:, :2] - centre).T)
    if not away.max() <= R * (1 + _ROUND):
        raise InputError(
            f"{where}: a node {away.max():.6g} from ({centre[0]:.4g}, {centre[1]:.4g}), and "
            f"R = {R:.6g}; rule: a disk, undeformed, its lowest node below its centre; or --R"
        )
    on = (away >= R * (1 - _ROUND)) & (points[:, 1] <= centre[1] + _ROUND * R)
    return np.flatnonzero(on), R


def _at_rest(levels: Levels, body: Body, where: str) -> Levels:
    """Return levels seen from the ridges: tops at y = 0, where the body rests on the first."""
    rim = Rim.of(levels.undeformed, where, R=body.R, symmetry=body.symmetry)
    near, far = (rim.R * (body.b_over_R / 2 + part * body.a_over_R) for part in _INSIDE)
    away = np.abs(levels.position[..., 0] - rim.centre[0])
    position = levels.position.copy()
    for k, x in enumerate(away):
        over = (near <= x) & (x <= far)
        if not over.any():
            raise InputError(
                f"{where}, state {k + 1}: no rim node over the first ridge, {near:.4g} to "
                f"{far:.4g} from the axis; rule: its texture and a mesh as fine, or --top"
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
        said=(*levels.said, "tops: where the body rests on the first ridge, state by state"),
    )


def _xdmf(path: Path, field: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points, displacements (n_state, n_point, dim), and times."""
    root = _xml(path)
    series = [
        grid
        for grid in root.iter("Grid")
        if grid.get("GridType") == "Collection" and grid.get("CollectionType") == "Temporal"
    ]
    if root.tag != "Xdmf" or len(series) != 1:
        raise InputError(f"{path}: {len(series)} time series; rule: one <Grid> of a collection")
    grids = series[0].findall("Grid")
    shapes = list(root.iter("Geometry"))
    if not shapes or not grids:
        raise InputError(f"{path}: no geometry or no states; rule: XDMF of a mesh over time")
    if len({ET.tostring(one) for one in shapes}) > 1:
        raise InputError(f"{path}: {len(shapes)} geometries; rule: one, undeformed")
    shape = shapes[0]
    kind = shape.get("GeometryType", shape.get("Type", "XYZ"))
    if kind not in ("XY", "XYZ"):
        raise InputError(f"{path}: geometry {kind!r}; rule: XY or XYZ")
    budget = _Budget(str(path))
    points = _item(path, shape, budget)
    if points.ndim != 2 or points.shape[1] != len(kind):
        raise InputError(f"{path}: points of shape {points.shape}; rule: (n, {len(kind)})")
    moved, times = [], []
    for number, grid in enumerate(grids, start=1):
        here = f"state {number}"
        clock = grid.find("Time")
        if clock is None or not clock.get("Value"):
            raise InputError(f"{path}, {here}: no <Time Value=...>")
        times.append(_number(path, here, clock.get("Value", "")))
        data = {one.get("Name"): one for one in grid.findall("Attribute")}
        if field not in data or data[field].get("Center") != "Node":
            names = ", ".join(sorted(str(name) for name in data)) or "none"
            raise InputError(f"{path}, {here}: no point data {field!r}; the fields are {names}")
        moved.append(_checked(f"{path}, {here}", field, _item(path, data[field], budget), points))
    return points, np.array(moved), np.array(times)


def _item(path: Path, parent: ET.Element, budget: _Budget) -> FloatArray:
    """Return the numbers of an element's one DataItem."""
    items = list(parent)
    if (
        len(items) != 1
        or items[0].tag != "DataItem"
        or items[0].get("ItemType", "Uniform") != ("Uniform")
    ):
        raise InputError(f"{path}: <{parent.tag}>; rule: one plain <DataItem>")
    item, text = items[0], (items[0].text or "").strip()
    words = (item.get("Dimensions") or "").split()
    if not words or not all(re.fullmatch("[0-9]{1,15}", word) for word in words):
        raise InputError(f"{path}: Dimensions {item.get('Dimensions')!r}; rule: whole numbers")
    shape = tuple(int(word) for word in words)
    budget.take(shape)
    if item.get("Format") == "XML":
        return _from_text(path, text, item.get("Precision", "4")).reshape(_fits(path, text, shape))
    if item.get("Format") == "HDF":
        return _from_hdf5(path, text, shape)
    raise InputError(f"{path}: Format {item.get('Format')!r}; rule: XML or HDF")


def _fits(path: Path, text: str, shape: tuple[int, ...]) -> tuple[int, ...]:
    if (n := len(text.split())) != math.prod(shape):
        raise InputError(f"{path}: {n} numbers, and Dimensions {shape}; rule: as many")
    return shape


def _from_text(path: Path, text: str, precision: str) -> FloatArray:
    try:
        if not text.isascii() or "_" in text:
            raise ValueError("not in digits of ASCII")
        numbers = np.array(text.split(), dtype=np.float64)
    except ValueError as error:
        raise InputError(f"{path}: {str(error)[:80]}; rule: numbers between blanks") from None
    return numbers.astype(np.float32) if precision == "4" else numbers


def _from_hdf5(path: Path, text: str, shape: tuple[int, ...]) -> FloatArray:
    """Return a dataset of a file in the XDMF's folder, without following any link out of it."""
    import h5py

    name, _, inner = text.rpartition(":")
    keys = inner.split("/")
    try:
        if len(keys) < 2 or keys[0] or not all(keys[1:]):
            raise InputError(f"{path}: numbers in {text[:80]!r}; rule: FILE.h5:/PATH")
        folder = path.parent.resolve()
        target = folder / name
        if (
            not name
            or PurePosixPath(name).is_absolute()
            or PureWindowsPath(name).anchor
            or ".." in (*PurePosixPath(name).parts, *PureWindowsPath(name).parts)
            or not target.resolve().is_relative_to(folder)
        ):
            raise InputError(f"{path}: numbers in {text[:80]!r}; rule: a file in the same folder")
        if not target.is_file():
            raise InputError(f"{path}: numbers in {name!r}: no such file; rule: move both together")
        with h5py.File(target, "r") as file:
            here = file
            for key in keys[1:]:
                if not isinstance(here, h5py.Group) or key not in here:
                    raise InputError(f"{target}: no {inner!r}")
                if not isinstance(here.get(key, getlink=True), h5py.HardLink):
                    raise InputError(f"{target}: {inner!r} is a link; rule: a dataset")
                here = here[key]
            if (
                not isinstance(here, h5py.Dataset)
                or here.is_virtual
                or here.external
                or here.dtype.kind not in "fiu"
                or here.dtype.itemsize > 8
            ):
                raise InputError(f"{target}: {inner!r}: rule: a dataset of numbers, in this file")
            if here.shape != shape:
                raise InputError(
                    f"{target}: {inner!r} is {here.shape}; rule: {shape}, as in {path}"
                )
            return _floating(here[()])
    except (OSError, RuntimeError, KeyError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path.parent / name}: cannot be read: {str(error)[:120]}") from None


def _vtus(
    paths: Sequence[Path], field: str, loads: Sequence[float] | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points, displacements (n_state, n_point, dim), and loads of VTU files."""
    if len(paths) < 2 or loads is None or len(loads) != len(paths):
        given = "no" if loads is None else f"{len(loads)}"
        raise InputError(
            f"{paths[0]}: {len(paths)} .vtu with {given} loads; rule: several, each one state, and "
            "a load for each; or an .xdmf series"
        )
    if not all(math.isfinite(load) for load in loads):
        raise InputError(f"{paths[0]}: loads {list(loads)}; rule: finite numbers")
    budget = _Budget(str(paths[0]))
    points, moved = None, []
    for path in paths:
        root = _xml(path)
        pieces = root.findall("UnstructuredGrid/Piece")
        if root.tag != "VTKFile" or len(pieces) != 1:
            raise InputError(f"{path}: {len(pieces)} pieces; rule: an unstructured grid of one")
        n = _whole(path, pieces[0].get("NumberOfPoints"))
        at = pieces[0].find("Points/DataArray")
        data = {one.get("Name"): one for one in pieces[0].findall("PointData/DataArray")}
        if at is None or field not in data:
            names = ", ".join(sorted(str(name) for name in data)) or "none"
            raise InputError(f"{path}: no points, or no point data {field!r}; there are {names}")
        here = _array(path, root, at, n, budget)
        if points is not None and not np.array_equal(here, points):
            raise InputError(f"{path}: points are not those of {paths[0]}; rule: one mesh")
        points = here
        moved.append(_checked(str(path), field, _array(path, root, data[field], n, budget), points))
    assert points is not None
    return points, np.array(moved), np.array(loads, dtype=float)


def _array(path: Path, root: ET.Element, item: ET.Element, n: int, budget: _Budget) -> FloatArray:
    """Return a DataArray, shape (n, components)."""
    components = _whole(path, item.get("NumberOfComponents", "1"))
    shape = (n, components)
    budget.take(shape)
    if item.get("type") not in _VTK:
        raise InputError(f"{path}: type {item.get('type')!r}; rule: one of {', '.join(_VTK)}")
    order = {"LittleEndian": "<", "BigEndian": ">"}.get(root.get("byte_order", "LittleEndian"), "<")
    dtype = np.dtype(order + _VTK[str(item.get("type"))])
    text = (item.text or "").strip()
    if item.get("format") == "ascii":
        numbers = _from_text(path, text, "4" if dtype.itemsize == 4 else "8")
        return numbers.reshape(_fits(path, text, shape))
    if item.get("format") == "appended":
        data = root.find("AppendedData")
        if data is None or data.get("encoding") != "base64":
            raise InputError(f"{path}: appended data; rule: encoding base64")
        text = (data.text or "").strip().removeprefix("_")[_whole(path, item.get("offset")) :]
    elif item.get("format") != "binary":
        raise InputError(f"{path}: format {item.get('format')!r}; rule: ascii, binary or appended")
    size = math.prod(shape) * dtype.itemsize
    head = np.dtype(order + _VTK.get(root.get("header_type", "UInt32"), "u4"))
    compressor = root.get("compressor")
    try:
        if compressor is None:
            content = _stated(path, text, head, size)
        elif compressor == "vtkZLibDataCompressor":
            content = _unzipped(path, text, head, size)
        else:
            raise InputError(f"{path}: compressor {compressor!r}; rule: vtkZLibDataCompressor")
    except (binascii.Error, zlib.error, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: data cannot be unpacked: {str(error)[:80]}") from None
    return _floating(np.frombuffer(content, dtype=dtype).reshape(shape))


def _stated(path: Path, text: str, head: np.dtype, size: int) -> bytes:
    """Return bytes after a header that states how many they are."""
    n = 4 * math.ceil((head.itemsize + size) / 3)
    content = base64.b64decode(text[:n], validate=True)
    stated = int(np.frombuffer(content[: head.itemsize], dtype=head)[0])
    if stated != size or len(content) < head.itemsize + size:
        raise InputError(f"{path}: {stated} bytes of data; rule: {size}, as the mesh has it")
    return content[head.itemsize : head.itemsize + size]


def _unzipped(path: Path, text: str, head: np.dtype, size: int) -> bytes:
    """Return bytes of compressed blocks, after a header with their number and sizes."""

    def encoded(n: int) -> int:
        return 4 * math.ceil(n / 3)

    def numbers(n: int) -> list[int]:
        some = base64.b64decode(text[: encoded(n * head.itemsize)], validate=True)
        return [int(one) for one in np.frombuffer(some[: n * head.itemsize], dtype=head)]

    n_block, block, last = numbers(3)
    total = (n_block - (last > 0)) * block + last
    if total != size or n_block > 1 + size:
        raise InputError(f"{path}: {total} bytes of data; rule: {size}, as the mesh has it")
    packed = numbers(3 + n_block)[3:]
    begin = encoded((3 + n_block) * head.itemsize)
    content = base64.b64decode(text[begin : begin + encoded(sum(packed))], validate=True)
    parts, at = [], 0
    for i, one in enumerate(packed):
        most = last if last and i == n_block - 1 else block
        part = zlib.decompressobj().decompress(content[at : at + one], most + 1)
        if len(part) != most:
            raise InputError(
                f"{path}: a block of {len(part)} bytes or more; rule: {most}, as stated"
            )
        parts.append(part)
        at += one
    return b"".join(parts)


def _xml(path: Path) -> ET.Element:
    """Parse a file that declares no types and no entities: those can grow without end."""
    text = read_text(path)
    if len(text) > _LARGEST_XML:
        raise InputError(f"{path}: {len(text)} bytes; rule: at most {_LARGEST_XML}, with HDF5")
    for word in ("<!DOCTYPE", "<!ENTITY"):
        if (at := text.upper().find(word)) >= 0:
            line = text.count("\n", 0, at) + 1
            raise InputError(f"{path}, line {line}: {word}; rule: XML without it")
    said = _ENCODING.match(text)
    if said is not None and said[1].upper() not in ("UTF-8", "UTF8", "ASCII", "US-ASCII"):
        raise InputError(f"{path}, line 1: encoding {said[1]!r}; rule: UTF-8")
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise InputError(f"{path}, line {error.position[0]}: {error}; rule: XML") from None


def _checked(where: str, field: str, values: FloatArray, points: FloatArray) -> FloatArray:
    """Return displacements if they are two or three a point."""
    if values.ndim != 2 or len(values) != len(points) or values.shape[1] not in (2, 3):
        raise InputError(
            f"{where}: {field!r} of shape {values.shape}; rule: ({len(points)}, 2 or 3)"
        )
    return values[:, :2]


def _floating(values: np.ndarray) -> FloatArray:
    """Return numbers in this machine's order, as float32 where they were."""
    kind = np.float32 if values.dtype.kind == "f" and values.dtype.itemsize <= 4 else np.float64
    return np.asarray(values, dtype=kind)


def _number(path: Path, here: str, word: str) -> float:
    try:
        return finite(path, 0, word)
    except InputError:
        raise InputError(f"{path}, {here}: time {word[:40]!r}; rule: a finite number") from None


def _whole(path: Path, word: str | None) -> int:
    if word is None or not re.fullmatch("[0-9]{1,15}", word):
        raise InputError(f"{path}: {word!r}; rule: a whole number")
    return int(word)
