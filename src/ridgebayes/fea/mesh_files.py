"""XDMF time series and VTU files that somebody else may have made: nothing in them is trusted.

No types and no entities are declared in them, sizes are held against limits before numbers are
read, and only what is asked for is read. Numbers of XDMF lie in HDF5 files of the same folder or in
the XML; those of VTU are text, or base64, plain or compressed.
"""

import base64
import math
import re
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from xml.etree import ElementTree as ET

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import LARGEST, check_inside, check_stored, read_text, refusing

_LARGEST_XML = 64 * 2**20  # bytes: more would take a parser longer than a user waits
_SHOWN = 80  # characters of a word in a file that messages show
_TYPES = {
    **{f"Int{8 * n}": f"i{n}" for n in (1, 2, 4, 8)},
    **{f"UInt{8 * n}": f"u{n}" for n in (1, 2, 4, 8)},
    **{f"Float{8 * n}": f"f{n}" for n in (4, 8)},
}
_ORDERS = {"LittleEndian": "<", "BigEndian": ">"}
_HEADERS = ("UInt32", "UInt64")
_MOST_NAMES = 10  # of fields that messages show
_ENCODING = re.compile(r"<\?xml[^>]*encoding\s*=\s*[\"']([^\"']*)")


@dataclass
class Budget:
    """Bytes left for the numbers of a series."""

    left: int = LARGEST


class PlainXml:
    """A parsed file.

    Parameters
    ----------
    path : pathlib.Path
        The file.
    budget : Budget
        Shared by the files of a series.

    Raises
    ------
    InputError
        If it is no XML, is too large, has a document type or entities, or is not UTF-8.
    """

    def __init__(self, path: Path, budget: Budget) -> None:
        self.path, self._budget = path, budget
        text = read_text(path)
        if len(text) > _LARGEST_XML:
            raise self.error(f"{len(text)} bytes; expected at most {_LARGEST_XML}, with HDF5")
        for word in ("<!DOCTYPE", "<!ENTITY"):
            if (at := text.upper().find(word)) >= 0:
                line = text.count("\n", 0, at) + 1
                raise InputError(f"{path}, line {line}: {word}; expected XML without it")
        encoding = _ENCODING.match(text)
        if encoding and encoding[1].upper() not in ("UTF-8", "UTF8", "ASCII", "US-ASCII"):
            raise InputError(f"{path}, line 1: encoding {_short(encoding[1])}; expected UTF-8")
        try:
            self.root = ET.fromstring(text)
        except ET.ParseError as error:
            raise InputError(f"{path}, line {error.position[0]}: {error}; expected XML") from None

    def error(self, message: str) -> InputError:
        """Return an error that names the file."""
        return InputError(f"{self.path}: {message}")

    def take(self, shape: Sequence[int]) -> None:
        """Refuse numbers that with all before them would take too many bytes."""
        self._budget.left -= 8 * math.prod(shape)
        if self._budget.left < 0:
            raise self.error(
                f"{' x '.join(map(str, shape))} numbers; expected at most {LARGEST} bytes in all"
            )

    def whole(self, word: str | None) -> int:
        """Return a whole number from 0."""
        if word is None or not re.fullmatch("[0-9]{1,15}", word):
            raise self.error(f"{_short(word)}; expected a whole number")
        return int(word)

    def from_text(self, text: str, shape: tuple[int, ...], *, is_single: bool) -> FloatArray:
        """Return numbers between blanks, in single precision if they were."""
        with refusing(str(self.path), ValueError, rule="; expected numbers between blanks"):
            if not text.isascii() or "_" in text:
                raise ValueError("not in digits of ASCII")
            numbers = np.array(text.split(), dtype=np.float64)
        if numbers.size != math.prod(shape):
            raise self.error(f"{numbers.size} numbers, and Dimensions {shape}; expected as many")
        with np.errstate(over="ignore"):  # to infinity, which is refused where it belongs
            return np.asarray(numbers, dtype="f4" if is_single else "f8").reshape(shape)


class Xdmf(PlainXml):
    """A parsed XDMF file."""

    def points(self, states: list[ET.Element]) -> FloatArray:
        """Return the points of its one geometry."""
        shapes = list(self.root.iter("Geometry"))
        if not shapes or not states:
            raise self.error("no geometry or no states; expected XDMF of a mesh over time")
        items = [self.item(one) for one in shapes]
        given = [(a.attrib, b.attrib, b.text) for a, b in zip(shapes, items, strict=True)]
        if any(one != given[0] for one in given):
            raise self.error(f"{len(shapes)} geometries; expected one, undeformed")
        kind = shapes[0].get("GeometryType", shapes[0].get("Type", "XYZ"))
        if kind not in ("XY", "XYZ"):
            raise self.error(f"geometry {_short(kind)}; expected XY or XYZ")
        points = _finite(str(self.path), "points", self.numbers(shapes[0]))
        if points.ndim != 2 or points.shape[1] != len(kind):
            raise self.error(f"points of shape {points.shape}; expected (n, {len(kind)})")
        return points

    def item(self, parent: ET.Element) -> ET.Element:
        """Return an element's one DataItem."""
        items = list(parent)
        is_one = len(items) == 1 and items[0].tag == "DataItem" and not len(items[0])
        if not is_one or items[0].get("ItemType", "Uniform") != "Uniform":
            raise self.error(f"<{parent.tag}>; expected one plain <DataItem>")
        return items[0]

    def numbers(self, parent: ET.Element) -> FloatArray:
        """Return the numbers of an element's one DataItem."""
        item = self.item(parent)
        text, dimensions = (item.text or "").strip(), item.get("Dimensions")
        if not re.fullmatch(r"\s*[0-9]{1,15}(\s+[0-9]{1,15})?\s*", dimensions or ""):
            raise self.error(
                f"Dimensions {_short(dimensions)}; expected whole numbers, of points and components"
            )
        shape = tuple(map(int, (dimensions or "").split()))
        self.take(shape)
        if item.get("Format") == "XML":
            return self.from_text(text, shape, is_single=item.get("Precision", "4") == "4")
        if item.get("Format") == "HDF":
            return self._dataset(text, shape)
        raise self.error(f"Format {_short(item.get('Format'))}; expected XML or HDF")

    def _dataset(self, text: str, shape: tuple[int, ...]) -> FloatArray:
        """Return a dataset of a file in the XDMF's folder, without following any link out of it."""
        import h5py  # slow to load, and other formats need none

        name, _, inner = text.rpartition(":")
        target = self.path.parent.resolve() / name
        here = f"{target}: {_short(inner)}"
        # TypeError: a type of HDF5 that NumPy has not.
        kinds = (OSError, RuntimeError, KeyError, ValueError, TypeError)
        with refusing(f"{self.path}: numbers in {_short(text)}: cannot be read", *kinds):
            if not re.fullmatch("(/[^/]+)+", inner):
                raise self.error(f"numbers in {_short(text)}; expected FILE.h5:/PATH")
            if not name or not is_beside(self.path, name):
                raise self.error(f"numbers in {_short(text)}; expected a file in the same folder")
            if not target.is_file():
                raise self.error(f"numbers in {_short(name)}: no such file; move both together")
            with h5py.File(target, "r") as file:
                data = file
                for key in inner[1:].split("/"):
                    if not isinstance(data, h5py.Group) or key not in data:
                        raise InputError(f"{target}: no {_short(inner)}")
                    if not isinstance(data.get(key, getlink=True), h5py.HardLink):
                        raise InputError(f"{here} is a link; expected a dataset")
                    data = data[key]
                check_inside(data, here)
                if data.shape != shape:
                    raise InputError(f"{here} is {data.shape}; expected {shape}, as in {self.path}")
                check_stored(data, here)
                return _as_floats(data[()])


class Vtu(PlainXml):
    """A parsed VTU file."""

    def state(self, field: str) -> tuple[FloatArray, FloatArray]:
        """Return points and displacements."""
        pieces = self.root.findall("UnstructuredGrid/Piece")
        if self.root.tag != "VTKFile" or len(pieces) != 1:
            raise self.error(f"{len(pieces)} pieces; expected an unstructured grid of one")
        n = self.whole(pieces[0].get("NumberOfPoints"))
        at = pieces[0].findall("Points/DataArray")
        if len(at) != 1:
            raise self.error(f"{len(at) or 'no'} points; expected one array of them")
        data = pieces[0].findall("PointData/DataArray")
        item = one_named(str(self.path), field, data, data)
        points = _finite(str(self.path), "points", self._array(at[0], n))
        return points, displacements(str(self.path), field, self._array(item, n), points)

    def _array(self, item: ET.Element, n: int) -> FloatArray:
        """Return a DataArray, shape (n, components)."""
        root = self.root
        shape = (n, self.whole(item.get("NumberOfComponents", "1")))
        self.take(shape)
        kind, order = item.get("type"), root.get("byte_order", "LittleEndian")
        header = root.get("header_type", "UInt32")
        for name, word, words in (
            ("type", kind, _TYPES),
            ("byte_order", order, _ORDERS),
            ("header_type", header, _HEADERS),
        ):
            if word not in words:
                raise self.error(f"{name} {_short(word)}; expected one of {', '.join(words)}")
        dtype, head = (np.dtype(_ORDERS[order] + _TYPES[one or ""]) for one in (kind, header))
        text = (item.text or "").strip()
        if item.get("format") == "ascii":
            return self.from_text(text, shape, is_single=dtype.itemsize == 4)
        if item.get("format") == "appended":
            data = root.findall("AppendedData")
            text = (data[0].text or "").strip() if data else ""
            if len(data) != 1 or data[0].get("encoding") != "base64" or not text.startswith("_"):
                raise self.error("appended data; expected one of encoding base64, after a _")
            text = text[1 + self.whole(item.get("offset")) :]
        elif item.get("format") != "binary":
            raise self.error(
                f"format {_short(item.get('format'))}; expected ascii, binary or appended"
            )
        size, compressor = math.prod(shape) * dtype.itemsize, root.get("compressor")
        if compressor not in (None, "vtkZLibDataCompressor"):
            raise self.error(f"compressor {_short(compressor)}; expected vtkZLibDataCompressor")
        unpack = self._plain if compressor is None else self._unzipped
        where, rule = (
            f"{self.path}: data cannot be unpacked",
            "; expected base64, as its header says",
        )
        with refusing(where, zlib.error, ValueError, rule=rule):  # binascii's is a ValueError
            content = unpack(text, head, size)
        return _as_floats(np.frombuffer(content, dtype=dtype).reshape(shape))

    def _plain(self, text: str, head: np.dtype, size: int) -> bytes:
        """Return bytes after a header that states how many they are."""
        content = _decoded(text, head.itemsize + size)
        (stated,) = _header(content, head, 1)
        if stated != size or len(content) < head.itemsize + size:
            raise self.error(f"{stated} bytes of data; expected {size}, as the mesh has it")
        return content[head.itemsize : head.itemsize + size]

    def _unzipped(self, text: str, head: np.dtype, size: int) -> bytes:
        """Return bytes of compressed blocks, after a header with their number and sizes."""
        n_block, block, last = _header(_decoded(text, 3 * head.itemsize), head, 3)
        total = (n_block - (last > 0)) * block + last
        if total != size or n_block > 1 + size:
            raise self.error(f"{total} bytes of data; expected {size}, as the mesh has it")
        n_head = (3 + n_block) * head.itemsize
        packed = _header(_decoded(text, n_head), head, 3 + n_block)[3:]
        content = _decoded(text[_encoded(n_head) :], sum(packed))
        parts, at = [], 0
        for i, one in enumerate(packed):
            most = last if last and i == n_block - 1 else block
            unpack = zlib.decompressobj()
            part = unpack.decompress(content[at : at + one], most + 1)
            if len(part) != most:
                raise self.error(
                    f"a block of {len(part)} bytes or more; expected {most}, as stated"
                )
            if not unpack.eof:  # else its checksum was not seen
                raise self.error("truncated data block")
            parts.append(part)
            at += one
        return b"".join(parts)


def is_beside(path: Path, name: str) -> bool:
    """Return whether the name of a file stays in the folder of another, links followed."""
    folder, within = path.parent.resolve(), PureWindowsPath(name)
    # Backslashes and drives too: the file may have been made elsewhere.
    is_away = within.anchor or ".." in within.parts
    return not is_away and (folder / name).resolve().is_relative_to(folder)


def _encoded(n: int) -> int:
    """Return how many characters of base64 hold some bytes."""
    return 4 * math.ceil(n / 3)


def _decoded(text: str, n: int) -> bytes:
    """Return at least n bytes of base64, if it holds them."""
    return base64.b64decode(text[: _encoded(n)], validate=True)


def _header(content: bytes, head: np.dtype, n: int) -> list[int]:
    if len(content) < n * head.itemsize:
        raise ValueError(f"{len(content)} bytes of a header of {n} numbers")
    value: list[int] = (
        np.frombuffer(content[: n * head.itemsize], dtype=head).astype(object).tolist()
    )
    return value


def one_named(here: str, field: str, data: list[ET.Element], given: list[ET.Element]) -> ET.Element:
    """Return the one array of point data with a name; messages show those of all that is given."""
    found = [one for one in data if one.get("Name") == field]
    if not found:
        names = ", ".join(sorted({_short(one.get("Name")) for one in given})[:_MOST_NAMES])
        raise InputError(f"{here}: no point data {field!r}; the fields are {names or 'none'}")
    if len(found) > 1:
        raise InputError(f"{here}: {len(found)} point data {field!r}; expected one with that name")
    return found[0]


def displacements(where: str, field: str, values: FloatArray, points: FloatArray) -> FloatArray:
    """Return displacements if they are finite, and two or three a point."""
    if values.ndim != 2 or len(values) != len(points) or values.shape[1] not in (2, 3):
        raise InputError(
            f"{where}: {field!r} of shape {values.shape}; expected ({len(points)}, 2 or 3)"
        )
    return _finite(where, repr(field), values)[:, :2]


def _finite(where: str, what: str, values: FloatArray) -> FloatArray:
    """Return numbers that are all finite."""
    if not np.isfinite(values).all():
        raise InputError(f"{where}: {what} are not all finite; expected finite numbers")
    return values


def _as_floats(values: np.ndarray) -> FloatArray:
    """Return numbers in this machine's order, as float32 where they were."""
    kind = np.float32 if values.dtype.kind == "f" and values.dtype.itemsize <= 4 else np.float64
    return np.asarray(values, dtype=kind)


def _short(word: str | None) -> str:
    """Return a word of a file as messages show it: in quotes, and no more than its beginning."""
    return repr(word if word is None else word[:_SHOWN])
