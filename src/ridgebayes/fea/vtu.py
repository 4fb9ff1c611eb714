"""VTU files, each a state of a series: numbers as text, or in base64, plain or compressed."""

import base64
import binascii
import math
import zlib
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.mesh_xml import (
    Budget,
    MeshXml,
    Series,
    as_floats,
    displacements,
    finite_array,
    one_named,
    short,
)
from ridgebayes.fea.record import HUGE
from ridgebayes.runtime.text import one_line_message

_TYPES = {
    **{f"Int{8 * n}": f"i{n}" for n in (1, 2, 4, 8)},
    **{f"UInt{8 * n}": f"u{n}" for n in (1, 2, 4, 8)},
    **{f"Float{8 * n}": f"f{n}" for n in (4, 8)},
}
_ORDERS = {"LittleEndian": "<", "BigEndian": ">"}
_HEADERS = ("UInt32", "UInt64")


def read_vtus(paths: Sequence[Path], field: str, loads: Sequence[float] | None) -> Series:
    """Read VTU files of one mesh.

    Parameters
    ----------
    paths : sequence of pathlib.Path
        In the order of their loads.
    field : str
        Point data that hold the displacements.
    loads : sequence of float or None
        One for each.

    Raises
    ------
    InputError
        If one cannot be understood, they are of several meshes, or loads are missing.
    """
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
    states = [_Vtu(path, budget).state(field) for path in paths]
    points = states[0][0]
    for path, (here, _) in zip(paths, states, strict=True):
        if not np.array_equal(here, points):
            raise InputError(f"{path}: points are not those of {paths[0]}; expected one mesh")
    moved = np.array([one for _, one in states])
    return Series(points, moved, np.array(loads, dtype=float), [str(path) for path in paths])


class _Vtu(MeshXml):
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
        points = finite_array(str(self.path), "points", self._array(at[0], n))
        return points, displacements(str(self.path), field, self._array(item, n), points)

    def _array(self, item: ET.Element, n: int) -> FloatArray:
        """Return a DataArray, shape (n, components)."""
        root = self.root
        shape = (n, self.whole(item.get("NumberOfComponents", "1")))
        self.take(shape)
        kind = self.one_of("type", item.get("type"), tuple(_TYPES))
        order = self.one_of("byte_order", root.get("byte_order", "LittleEndian"), tuple(_ORDERS))
        header = self.one_of("header_type", root.get("header_type", "UInt32"), _HEADERS)
        dtype, head = (np.dtype(_ORDERS[order] + _TYPES[one]) for one in (kind, header))
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
                f"format {short(item.get('format'))}; expected ascii, binary or appended"
            )
        size, compressor = math.prod(shape) * dtype.itemsize, root.get("compressor")
        if compressor not in (None, "vtkZLibDataCompressor"):
            raise self.error(f"compressor {short(compressor)}; expected vtkZLibDataCompressor")
        unpack = self._plain if compressor is None else self._unzipped
        try:
            content = unpack(text, head, size)
        except InputError:
            raise
        except (binascii.Error, zlib.error, ValueError) as error:
            raise self.error(
                f"data cannot be unpacked: {one_line_message(error)}; expected base64, and what "
                "its header says"
            ) from None
        return as_floats(np.frombuffer(content, dtype=dtype).reshape(shape))

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


def _encoded(n: int) -> int:
    """Return how many characters of base64 hold some bytes."""
    return 4 * math.ceil(n / 3)


def _decoded(text: str, n: int) -> bytes:
    """Return at least n bytes of base64, if it holds them."""
    return base64.b64decode(text[: _encoded(n)], validate=True)


def _header(content: bytes, head: np.dtype, n: int) -> list[int]:
    if len(content) < n * head.itemsize:
        raise ValueError(f"{len(content)} bytes of a header of {n} numbers")
    return np.frombuffer(content[: n * head.itemsize], dtype=head).astype(object).tolist()
