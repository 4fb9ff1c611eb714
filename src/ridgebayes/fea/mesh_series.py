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
from xml.etree import ElementTree as ET

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import parse_number
from ridgebayes.fea.record import HUGE, Imported, provenance
from ridgebayes.fea.surface import Body, CylinderSurface, Origin, SurfaceHistory, table_from_history
from ridgebayes.runtime.reading import LARGEST, check_inside, check_stored, read_text
from ridgebayes.runtime.text import one_line_message

_LARGEST_XML = 64 * 2**20  # bytes: more would take a parser longer than a user waits
_SHOWN = 80  # characters of a word in a file that messages show
_MOST_NAMES = 10  # of fields that messages show
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
_ORDERS = {"LittleEndian": "<", "BigEndian": ">"}
_HEADERS = ("UInt32", "UInt64")


@dataclass
class _Budget:
    """What is left of the bytes that a series' numbers may take."""

    left: int = LARGEST

    def take(self, path: Path, shape: Sequence[int]) -> None:
        self.left -= 8 * math.prod(shape)
        if self.left < 0:
            raise InputError(
                f"{path}: {' x '.join(map(str, shape))} numbers; expected at most {LARGEST} "
                "bytes in "
                "all"
            )


@dataclass
class _Series:
    """What stands in the files: displacements, shape (n_state, n_point, 2), and where each did."""

    points: FloatArray
    moved: FloatArray
    loads: FloatArray
    places: list[str]


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
    if suffixes == {".xdmf"} and len(paths) == 1:
        if loads is not None:
            raise InputError(f"{where}: loads of a series; expected its times")
        series = _xdmf(paths[0], field)
    elif suffixes == {".vtu"}:
        series = _vtus(paths, field, loads)
    else:
        raise InputError(f"{where}: expected one .xdmf, or several .vtu")
    points, moved = (np.asarray(one, dtype=float) for one in (series.points, series.moved))
    nodes, R = _rim(points, body, where)
    most = np.abs(moved).max(axis=(1, 2))
    if not most.max() <= _FARTHEST * R:
        raise InputError(
            f"{series.places[most.argmax()]}: {field!r} up to {most.max():.3g}; expected within "
            f"{_FARTHEST:g} R"
        )
    digits = float(np.finfo(series.moved.dtype).eps * most.max())
    body = replace(body, R=R)
    half = 2.0 if body.symmetry == "half" else 1.0
    scale = 2 * R * body.E if time == "p_over_E" else 1.0
    levels = SurfaceHistory(
        series.loads * (scale * body.thickness / half),
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


def _xdmf(path: Path, field: str) -> _Series:
    """Read an XDMF file, and the HDF5 file that it names."""
    root = _xml(path)
    series = [
        grid
        for grid in root.iter("Grid")
        if grid.get("GridType") == "Collection" and grid.get("CollectionType") == "Temporal"
    ]
    if root.tag != "Xdmf" or len(series) != 1:
        raise InputError(f"{path}: {len(series)} time series; expected one <Grid> of a collection")
    grids = series[0].findall("Grid")
    shapes = list(root.iter("Geometry"))
    if not shapes or not grids:
        raise InputError(f"{path}: no geometry or no states; expected XDMF of a mesh over time")
    shape, *others = ((one.attrib, item.attrib, item.text) for one, item in _items(path, shapes))
    if any(one != shape for one in others):
        raise InputError(f"{path}: {len(shapes)} geometries; expected one, undeformed")
    kind = shapes[0].get("GeometryType", shapes[0].get("Type", "XYZ"))
    if kind not in ("XY", "XYZ"):
        raise InputError(f"{path}: geometry {_short(kind)}; expected XY or XYZ")
    budget = _Budget()
    points = _finite(str(path), "points", _numbers(path, shapes[0], budget))
    if points.ndim != 2 or points.shape[1] != len(kind):
        raise InputError(f"{path}: points of shape {points.shape}; expected (n, {len(kind)})")
    moved, times, places = [], [], []
    for number, grid in enumerate(grids, start=1):
        here = f"{path}, state {number}"
        clocks = grid.findall("Time")
        if not clocks or not clocks[0].get("Value"):
            raise InputError(f"{here}: no <Time Value=...>")
        if len(clocks) > 1:
            raise InputError(f"{here}: {len(clocks)} times; expected one")
        times.append(_number(here, clocks[0].get("Value", "")))
        given = grid.findall("Attribute")
        data = [one for one in given if one.get("Center") == "Node"]
        one = _named(here, field, data, "the fields are", given)
        moved.append(_checked(here, field, _numbers(path, one, budget), points))
        places.append(here)
    return _Series(points, np.array(moved), np.array(times), places)


def _named(
    here: str, field: str, data: list[ET.Element], are: str, given: list[ET.Element]
) -> ET.Element:
    """Return the one array of point data with a name."""
    found = [one for one in data if one.get("Name") == field]
    if not found:
        names = ", ".join(sorted({_short(one.get("Name")) for one in given})[:_MOST_NAMES])
        raise InputError(f"{here}: no point data {field!r}; {are} {names or 'none'}")
    if len(found) > 1:
        raise InputError(f"{here}: {len(found)} point data {field!r}; expected one of a name")
    return found[0]


def _items(path: Path, parents: Sequence[ET.Element]) -> list[tuple[ET.Element, ET.Element]]:
    """Return elements, each with its one DataItem."""
    found = []
    for parent in parents:
        items = list(parent)
        if (
            len(items) != 1
            or items[0].tag != "DataItem"
            or len(items[0])
            or items[0].get("ItemType", "Uniform") != "Uniform"
        ):
            raise InputError(f"{path}: <{parent.tag}>; expected one plain <DataItem>")
        found.append((parent, items[0]))
    return found


def _numbers(path: Path, parent: ET.Element, budget: _Budget) -> FloatArray:
    """Return the numbers of an element's one DataItem."""
    ((_, item),) = _items(path, [parent])
    text = (item.text or "").strip()
    words = (item.get("Dimensions") or "").split()
    if len(words) not in (1, 2) or not all(re.fullmatch("[0-9]{1,15}", word) for word in words):
        raise InputError(
            f"{path}: Dimensions {_short(item.get('Dimensions'))}; expected whole numbers, of "
            "points "
            "and components"
        )
    shape = tuple(int(word) for word in words)
    budget.take(path, shape)
    if item.get("Format") == "XML":
        return _from_text(path, text, item.get("Precision", "4")).reshape(_fits(path, text, shape))
    if item.get("Format") == "HDF":
        return _from_hdf5(path, text, shape)
    raise InputError(f"{path}: Format {_short(item.get('Format'))}; expected XML or HDF")


def _fits(path: Path, text: str, shape: tuple[int, ...]) -> tuple[int, ...]:
    if (n := len(text.split())) != math.prod(shape):
        raise InputError(f"{path}: {n} numbers, and Dimensions {shape}; expected as many")
    return shape


def _from_text(path: Path, text: str, precision: str) -> FloatArray:
    try:
        if not text.isascii() or "_" in text:
            raise ValueError("not in digits of ASCII")
        numbers = np.array(text.split(), dtype=np.float64)
    except ValueError as error:
        raise InputError(
            f"{path}: {one_line_message(error)}; expected numbers between blanks"
        ) from None
    with np.errstate(over="ignore"):  # to infinity, which is refused where it belongs
        return numbers.astype(np.float32) if precision == "4" else numbers


def _from_hdf5(path: Path, text: str, shape: tuple[int, ...]) -> FloatArray:
    """Return a dataset of a file in the XDMF's folder, without following any link out of it."""
    import h5py

    name, _, inner = text.rpartition(":")
    keys = inner.split("/")
    shown = _short(inner)
    try:
        if len(keys) < 2 or keys[0] or not all(keys[1:]):
            raise InputError(f"{path}: numbers in {_short(text)}; expected FILE.h5:/PATH")
        folder = path.parent.resolve()
        target = folder / name
        if (
            not name
            or PurePosixPath(name).is_absolute()
            or PureWindowsPath(name).anchor
            or ".." in (*PurePosixPath(name).parts, *PureWindowsPath(name).parts)
            or not target.resolve().is_relative_to(folder)
        ):
            raise InputError(
                f"{path}: numbers in {_short(text)}; expected a file in the same folder"
            )
        if not target.is_file():
            raise InputError(f"{path}: numbers in {_short(name)}: no such file; move both together")
        with h5py.File(target, "r") as file:
            here = file
            for key in keys[1:]:
                if not isinstance(here, h5py.Group) or key not in here:
                    raise InputError(f"{target}: no {shown}")
                if not isinstance(here.get(key, getlink=True), h5py.HardLink):
                    raise InputError(f"{target}: {shown} is a link; expected a dataset")
                here = here[key]
            check_inside(here, f"{target}: {shown}")
            if here.shape != shape:
                raise InputError(
                    f"{target}: {shown} is {here.shape}; expected {shape}, as in {path}"
                )
            check_stored(here, f"{target}: {shown}")
            return _floating(here[()])
    # TypeError: a type of HDF5 that NumPy has not.
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: numbers in {_short(text)}: cannot be read: {one_line_message(error)}"
        ) from None


def _vtus(paths: Sequence[Path], field: str, loads: Sequence[float] | None) -> _Series:
    """Read VTU files, each a state."""
    if len(paths) < 2 or loads is None or len(loads) != len(paths):
        given = "no" if loads is None else f"{len(loads)}"
        raise InputError(
            f"{paths[0]}: {len(paths)} .vtu with {given} loads; expected several, each one "
            "state, and "
            "a load for each; or an .xdmf series"
        )
    for path, load in zip(paths, loads, strict=True):
        if not 0 <= load <= HUGE:
            raise InputError(f"{path}: loads of {load:g}; expected finite numbers, 0 to {HUGE:g}")
    budget = _Budget()
    points, moved = None, []
    for path in paths:
        root = _xml(path)
        pieces = root.findall("UnstructuredGrid/Piece")
        if root.tag != "VTKFile" or len(pieces) != 1:
            raise InputError(f"{path}: {len(pieces)} pieces; expected an unstructured grid of one")
        n = _whole(path, pieces[0].get("NumberOfPoints"))
        at = pieces[0].findall("Points/DataArray")
        if len(at) != 1:
            raise InputError(f"{path}: {len(at) or 'no'} points; expected one array of them")
        data = pieces[0].findall("PointData/DataArray")
        item = _named(str(path), field, data, "there are", data)
        here = _finite(str(path), "points", _array(path, root, at[0], n, budget))
        if points is not None and not np.array_equal(here, points):
            raise InputError(f"{path}: points are not those of {paths[0]}; expected one mesh")
        points = here
        moved.append(_checked(str(path), field, _array(path, root, item, n, budget), points))
    assert points is not None
    places = [str(path) for path in paths]
    return _Series(points, np.array(moved), np.array(loads, dtype=float), places)


def _array(path: Path, root: ET.Element, item: ET.Element, n: int, budget: _Budget) -> FloatArray:
    """Return a DataArray, shape (n, components)."""
    components = _whole(path, item.get("NumberOfComponents", "1"))
    shape = (n, components)
    budget.take(path, shape)
    kind = _one_of(path, "type", item.get("type"), tuple(_VTK))
    order = _one_of(path, "byte_order", root.get("byte_order", "LittleEndian"), tuple(_ORDERS))
    header = _one_of(path, "header_type", root.get("header_type", "UInt32"), _HEADERS)
    dtype = np.dtype(_ORDERS[order] + _VTK[kind])
    head = np.dtype(_ORDERS[order] + _VTK[header])
    text = (item.text or "").strip()
    if item.get("format") == "ascii":
        numbers = _from_text(path, text, "4" if dtype.itemsize == 4 else "8")
        return numbers.reshape(_fits(path, text, shape))
    if item.get("format") == "appended":
        data = root.findall("AppendedData")
        text = (data[0].text or "").strip() if data else ""
        if len(data) != 1 or data[0].get("encoding") != "base64" or not text.startswith("_"):
            raise InputError(f"{path}: appended data; expected one of encoding base64, after a _")
        text = text[1 + _whole(path, item.get("offset")) :]
    elif item.get("format") != "binary":
        raise InputError(
            f"{path}: format {_short(item.get('format'))}; expected ascii, binary or appended"
        )
    size = math.prod(shape) * dtype.itemsize
    compressor = root.get("compressor")
    try:
        if compressor is None:
            content = _stated(path, text, head, size)
        elif compressor == "vtkZLibDataCompressor":
            content = _unzipped(path, text, head, size)
        else:
            raise InputError(
                f"{path}: compressor {_short(compressor)}; expected vtkZLibDataCompressor"
            )
    except (binascii.Error, zlib.error, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: data cannot be unpacked: {one_line_message(error)}; expected base64, and "
            "what "
            "its "
            "header says"
        ) from None
    return _floating(np.frombuffer(content, dtype=dtype).reshape(shape))


def _stated(path: Path, text: str, head: np.dtype, size: int) -> bytes:
    """Return bytes after a header that states how many they are."""
    n = 4 * math.ceil((head.itemsize + size) / 3)
    content = base64.b64decode(text[:n], validate=True)
    if len(content) < head.itemsize:
        raise ValueError(f"{len(content)} bytes of a header of {head.itemsize}")
    stated = int(np.frombuffer(content[: head.itemsize], dtype=head)[0])
    if stated != size or len(content) < head.itemsize + size:
        raise InputError(f"{path}: {stated} bytes of data; expected {size}, as the mesh has it")
    return content[head.itemsize : head.itemsize + size]


def _unzipped(path: Path, text: str, head: np.dtype, size: int) -> bytes:
    """Return bytes of compressed blocks, after a header with their number and sizes."""

    def encoded(n: int) -> int:
        return 4 * math.ceil(n / 3)

    def numbers(n: int) -> list[int]:
        some = base64.b64decode(text[: encoded(n * head.itemsize)], validate=True)
        if len(some) < n * head.itemsize:
            raise ValueError(f"{len(some)} bytes of a header of {n} numbers")
        return [int(one) for one in np.frombuffer(some[: n * head.itemsize], dtype=head)]

    n_block, block, last = numbers(3)
    total = (n_block - (last > 0)) * block + last
    if total != size or n_block > 1 + size:
        raise InputError(f"{path}: {total} bytes of data; expected {size}, as the mesh has it")
    packed = numbers(3 + n_block)[3:]
    begin = encoded((3 + n_block) * head.itemsize)
    content = base64.b64decode(text[begin : begin + encoded(sum(packed))], validate=True)
    parts, at = [], 0
    for i, one in enumerate(packed):
        most = last if last and i == n_block - 1 else block
        unpack = zlib.decompressobj()
        part = unpack.decompress(content[at : at + one], most + 1)
        if len(part) != most:
            raise InputError(
                f"{path}: a block of {len(part)} bytes or more; expected {most}, as stated"
            )
        if not unpack.eof:  # else its checksum was not seen
            raise InputError(f"{path}: a block of data is cut short; expected whole ones")
        parts.append(part)
        at += one
    return b"".join(parts)


def _xml(path: Path) -> ET.Element:
    """Parse a file that declares no types and no entities: those can grow without end."""
    text = read_text(path)
    if len(text) > _LARGEST_XML:
        raise InputError(f"{path}: {len(text)} bytes; expected at most {_LARGEST_XML}, with HDF5")
    for word in ("<!DOCTYPE", "<!ENTITY"):
        if (at := text.upper().find(word)) >= 0:
            line = text.count("\n", 0, at) + 1
            raise InputError(f"{path}, line {line}: {word}; expected XML without it")
    declared = _ENCODING.match(text)
    if declared is not None and declared[1].upper() not in ("UTF-8", "UTF8", "ASCII", "US-ASCII"):
        raise InputError(f"{path}, line 1: encoding {_short(declared[1])}; expected UTF-8")
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise InputError(f"{path}, line {error.position[0]}: {error}; expected XML") from None


def _checked(where: str, field: str, values: FloatArray, points: FloatArray) -> FloatArray:
    """Return displacements if they are finite, and two or three a point."""
    if values.ndim != 2 or len(values) != len(points) or values.shape[1] not in (2, 3):
        raise InputError(
            f"{where}: {field!r} of shape {values.shape}; expected ({len(points)}, 2 or 3)"
        )
    return _finite(where, repr(field), values)[:, :2]


def _finite(where: str, what: str, values: FloatArray) -> FloatArray:
    if not np.isfinite(values).all():
        raise InputError(f"{where}: {what} are not all finite; expected finite numbers")
    return values


def _floating(values: np.ndarray) -> FloatArray:
    """Return numbers in this machine's order, as float32 where they were."""
    kind = np.float32 if values.dtype.kind == "f" and values.dtype.itemsize <= 4 else np.float64
    return np.asarray(values, dtype=kind)


def _number(here: str, word: str) -> float:
    time = parse_number(word)
    if not math.isfinite(time):
        raise InputError(f"{here}: time {word[:40]!r}; expected a finite number")
    if not 0 <= time <= HUGE:
        raise InputError(f"{here}: time {word[:40]!r}; expected a load, from 0 to {HUGE:g}")
    return time


def _whole(path: Path, word: str | None) -> int:
    if word is None or not re.fullmatch("[0-9]{1,15}", word):
        raise InputError(f"{path}: {_short(word)}; expected a whole number")
    return int(word)


def _one_of(path: Path, name: str, word: str | None, words: Sequence[str]) -> str:
    if word is None or word not in words:
        raise InputError(f"{path}: {name} {_short(word)}; expected one of {', '.join(words)}")
    return word


def _short(word: str | None) -> str:
    """Return a word of a file as messages show it: in quotes, and no more than its beginning."""
    return repr(word if word is None else word[:_SHOWN])
