"""Reader for deformed meshes: XDMF time series, PVD collections and lists of VTU files.

Files are untrusted and are checked before meshio reads them.

meshio trusts links, sizes and paths. The checks refuse document types and entities, data outside
of the file and of HDF5 files in its folder, and compressed data larger than the stated size.
"""

import base64
import re
import warnings
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path, PureWindowsPath
from xml.etree import ElementTree as ET

import numpy as np

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.deck import Run
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.lines import parse_number
from ridgebayes.fea.record import FARTHEST, HUGE, SHOWN
from ridgebayes.fea.rim import NEAR
from ridgebayes.runtime.reading import LARGEST, LARGEST_TEXT, check_tree, read_text, refusing
from ridgebayes.runtime.text import clipped, some_of
from ridgebayes.table.columns import SHOWN as MOST_SHOWN

_ENCODING = re.compile(r"<\?xml[^>]*encoding\s*=\s*[\"']([^\"']*)")
State = tuple[FloatArray, FloatArray]  # points, and their displacements


def parse_xml(path: Path) -> ET.Element:
    """Parse an XML file.

    Raises
    ------
    InputError
        If the file is not XML, is too large, has a document type or entities, or is not UTF-8.
    """
    text = read_text(path, LARGEST_TEXT)
    for word in ("<!DOCTYPE", "<!ENTITY"):
        if (at := text.upper().find(word)) >= 0:
            line = text.count("\n", 0, at) + 1
            raise InputError(f"{path}, line {line}: {word}; expected XML without it")
    encoding = _ENCODING.match(text)
    if encoding and encoding[1].upper() not in ("UTF-8", "UTF8", "ASCII", "US-ASCII"):
        raise InputError(f"{path}, line 1: encoding {clipped(encoding[1])}; expected UTF-8")
    try:
        return ET.fromstring(text)
    except ET.ParseError as error:
        raise InputError(f"{path}, line {error.position[0]}: {error}; expected XML") from None


def read_xdmf(path: Path, field: str) -> tuple[FloatArray, list[FloatArray], list[str]]:
    """Read the points, and the displacements and time (as text) of each state of a series."""
    root = parse_xml(path)
    _check_items(path, root)
    if len({ET.tostring(grid).strip() for grid in root.iter("Geometry")}) > 1:
        raise InputError(f"{path}: several geometries; expected one, undeformed")
    with _meshio_errors(str(path), "an XDMF time series of one mesh"):
        from meshio.xdmf import TimeSeriesReader  # slow import that other formats do not need

        with TimeSeriesReader(path) as reader:
            points = _checked_points(str(path), reader.read_points_cells()[0])
            moved, times = [], []
            for k, state in enumerate(reader.collection):
                here = f"{path}, state {k + 1}"
                attributes = state.findall("Attribute")
                _check_once(here, field, attributes)
                for other in (item for item in attributes if item.get("Name") != field):
                    state.remove(other)
                times.append([time.get("Value", "") for time in state.findall("Time")])
                if len(times[-1]) != 1:
                    raise InputError(f"{here}: {len(times[-1])} times; expected one")
                moved.append(_displacements(here, field, reader.read_data(k)[1], points))
    return points, moved, [time for (time,) in times]


def read_vtu(path: Path, field: str) -> State:
    """Read the points and displacements of one state."""
    root = parse_xml(path)
    compressor = root.get("compressor")
    if compressor not in (None, "vtkZLibDataCompressor"):
        raise InputError(
            f"{path}: compressor {clipped(str(compressor))}; expected vtkZLibDataCompressor"
        )
    _check_once(str(path), field, root.findall("*/Piece/PointData/DataArray"))
    with _meshio_errors(str(path), "a VTU file of an unstructured grid"):
        for item in root.iter("DataArray"):
            if item.get("format") != "ascii":
                _check_binary(path, root, item)
        from meshio.vtu import read  # slow import that other formats do not need

        mesh = read(path)
        points = _checked_points(str(path), mesh.points)
        return points, _displacements(str(path), field, mesh.point_data, points)


@contextmanager
def _meshio_errors(where: str, expected: str) -> Iterator[None]:
    """Convert the exceptions of meshio, which are of many types, and its warnings to InputError."""
    refuse = refusing(f"{where}: cannot be read", rule=f"; expected {expected}")
    with refuse, warnings.catch_warnings():
        warnings.simplefilter("error")  # meshio only warns of truncated numbers
        yield


def _check_items(path: Path, root: ET.Element) -> None:
    """Refuse data that are not in this file or in HDF5 files of its folder, without links."""
    names: dict[str, None] = {}
    for item in root.iter("DataItem"):
        if len(item) or item.get("ItemType", "Uniform") != "Uniform":
            raise InputError(
                f"{path}: a <DataItem> that refers to others; expected one plain <DataItem>"
            )
        if item.get("Format") == "HDF":
            names[(item.text or "").strip().rpartition(":")[0]] = None
        elif item.get("Format") != "XML":
            raise InputError(f"{path}: Format {item.get('Format')!r:.80}; expected XML or HDF")
    for name in names:
        _check_hdf5(path, name)


def _check_hdf5(path: Path, name: str) -> None:
    """Refuse an HDF5 file outside of the XDMF file's folder, and links or sizes in it."""
    import h5py  # slow import that other formats do not need

    where = f"{path}: numbers in {clipped(name)}"
    # h5py raises TypeError for an HDF5 type without a NumPy type.
    kinds = (OSError, RuntimeError, KeyError, ValueError, TypeError)
    with refusing(f"{where}: cannot be read", *kinds):
        if not name or not is_beside(path, name):
            raise InputError(f"{where}; expected FILE.h5:/PATH in the same folder")
        if not (path.parent / name).is_file():
            raise InputError(f"{where}: no such file; move both together")
        with h5py.File(path.parent / name, "r") as data:
            check_tree(data, str(path.parent / name))


def _check_binary(path: Path, root: ET.Element, item: ET.Element) -> None:
    """Refuse an array that is not base64, or whose blocks are larger than the stated size."""
    text = (item.text or "").strip()
    if item.get("format") == "appended":
        appended = (root.findtext("AppendedData") or "").strip()
        text = appended[1 + int(item.get("offset", "0")) :]
    if not re.fullmatch(r"[A-Za-z0-9+/=]*", text):
        raise InputError(f"{path}: {clipped(text)}; expected base64")
    if root.get("compressor") is None:
        return
    order = ">" if root.get("byte_order") == "BigEndian" else "<"
    head = np.dtype(f"{order}u{8 if root.get('header_type') == 'UInt64' else 4}")

    def numbers(n: int) -> list[int]:
        content = base64.b64decode(text[: _base64_length(n * head.itemsize)])
        return [int(number) for number in np.frombuffer(content, head, n)]

    n_block, block, _ = numbers(3)
    if n_block > len(text) or n_block * block > LARGEST:
        raise InputError(f"{path}: {n_block} blocks of {block} bytes; expected {LARGEST} in all")
    packed = numbers(3 + n_block)[3:]
    at = _base64_length((3 + n_block) * head.itemsize)
    content = base64.b64decode(text[at : at + _base64_length(sum(packed))])
    for start, end in pairwise(np.cumsum([0, *packed]).tolist()):
        if len(zlib.decompressobj().decompress(content[start:end], block + 1)) > block:
            raise InputError(
                f"{path}: a block of over {block} bytes unpacked; expected what the file states"
            )


def _base64_length(n: int) -> int:
    """Return the number of base64 characters that encode n bytes."""
    return 4 * -(-n // 3)


def is_beside(path: Path, name: str) -> bool:
    """Return whether a file name refers to the folder of `path`, with symbolic links resolved."""
    folder, within = path.parent.resolve(), PureWindowsPath(name)
    # The file may have been written on Windows, with backslashes and drives.
    is_away = within.anchor or ".." in within.parts
    return not is_away and (folder / name).resolve().is_relative_to(folder)


def _check_once(here: str, field: str, arrays: Sequence[ET.Element]) -> None:
    """Refuse a state that does not have exactly one point data array of the field."""
    names = [array.get("Name") for array in arrays if array.get("Center", "Node") == "Node"]
    if (n := names.count(field)) != 1:
        shown = some_of(sorted(set(map(clipped, map(str, names)))), MOST_SHOWN)
        raise InputError(
            f"{here}: {n} point data {field!r}; expected one; the fields are {shown or 'none'}"
        )


def _checked_points(where: str, points: FloatArray) -> FloatArray:
    is_wrong = points.ndim != 2 or points.shape[1] not in (2, 3)
    if is_wrong or not (np.abs(points.astype(float)) <= HUGE).all():
        rule = f"expected (n, 2 or 3), within {HUGE:g}"
        raise InputError(f"{where}: points of shape {points.shape}, or not all finite; {rule}")
    return points


def _displacements(
    where: str, field: str, data: dict[str, FloatArray], points: FloatArray
) -> FloatArray:
    """Return the checked x and y displacements, in single precision if the file stores them so."""
    values = data[field]
    if values.ndim != 2 or len(values) != len(points):
        raise InputError(f"{where}: {field!r} of shape {values.shape}; expected {points.shape}")
    kind = np.float32 if values.dtype.kind == "f" and values.dtype.itemsize <= 4 else np.float64
    return np.asarray(_checked_points(f"{where}: {field!r}", values)[:, :2], dtype=kind)


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
    paths, where, time, loads = run.paths, str(run.path), run.facts.time, run.facts.loads
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
    """Return the files of a collection, which must lie in its folder, by rising time."""
    listed = parse_xml(path).findall("Collection/DataSet")
    listed.sort(key=lambda item: parse_number(item.get("timestep", "")))  # as ParaView reads it
    names = [item.get("file", "") for item in listed]
    times = [item.get("timestep", "") for item in listed]
    for name in names:
        if not (name.lower().endswith(".vtu") and is_beside(path, name)):
            raise InputError(f"{path}: file {clipped(name)}; expected a .vtu in the same folder")
    if twice := [one for one, other in pairwise(times) if parse_number(one) == parse_number(other)]:
        raise InputError(f"{path}: timestep {clipped(twice[0])} stands twice; expected a file each")
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
