"""XDMF time series, with their numbers in HDF5 files of the same folder or in the XML itself."""

import math
import re
from pathlib import Path, PureWindowsPath
from xml.etree import ElementTree as ET

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.lines import parse_number
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
from ridgebayes.runtime.reading import check_inside, check_stored
from ridgebayes.runtime.text import one_line_message


def read_xdmf(path: Path, field: str) -> Series:
    """Read a time series of one mesh.

    Parameters
    ----------
    path : pathlib.Path
        The ``.xdmf`` file.
    field : str
        Point data that hold the displacements.

    Raises
    ------
    InputError
        If it cannot be understood, or numbers lie elsewhere than in its folder.
    """
    file = _Xdmf(path, Budget())
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
    return Series(points, np.array(moved), np.array(times), places)


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


class _Xdmf(MeshXml):
    """A parsed XDMF file."""

    def points(self, states: list[ET.Element]) -> FloatArray:
        """Return the points of its one geometry."""
        shapes = list(self.root.iter("Geometry"))
        if not shapes or not states:
            raise self.error("no geometry or no states; expected XDMF of a mesh over time")
        given = [
            (one.attrib, item.attrib, item.text) for one in shapes for item in [self.item(one)]
        ]
        if any(one != given[0] for one in given):
            raise self.error(f"{len(shapes)} geometries; expected one, undeformed")
        kind = shapes[0].get("GeometryType", shapes[0].get("Type", "XYZ"))
        if kind not in ("XY", "XYZ"):
            raise self.error(f"geometry {short(kind)}; expected XY or XYZ")
        points = finite_array(str(self.path), "points", self.numbers(shapes[0]))
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
                f"Dimensions {short(dimensions)}; expected whole numbers, of points and components"
            )
        shape = tuple(map(int, (dimensions or "").split()))
        self.take(shape)
        if item.get("Format") == "XML":
            return self.from_text(text, shape, is_single=item.get("Precision", "4") == "4")
        if item.get("Format") == "HDF":
            return self._dataset(text, shape)
        raise self.error(f"Format {short(item.get('Format'))}; expected XML or HDF")

    def _dataset(self, text: str, shape: tuple[int, ...]) -> FloatArray:
        """Return a dataset of a file in the XDMF's folder, without following any link out of it."""
        import h5py  # slow to load, and other formats need none

        name, _, inner = text.rpartition(":")
        folder, within, shown = self.path.parent.resolve(), PureWindowsPath(name), short(inner)
        target = folder / name
        try:
            if not re.fullmatch("(/[^/]+)+", inner):
                raise self.error(f"numbers in {short(text)}; expected FILE.h5:/PATH")
            # Backslashes and drives too: the file may have been made elsewhere.
            is_away = not name or within.anchor or ".." in within.parts
            if is_away or not target.resolve().is_relative_to(folder):
                raise self.error(f"numbers in {short(text)}; expected a file in the same folder")
            if not target.is_file():
                raise self.error(f"numbers in {short(name)}: no such file; move both together")
            with h5py.File(target, "r") as file:
                here = file
                for key in inner[1:].split("/"):
                    if not isinstance(here, h5py.Group) or key not in here:
                        raise InputError(f"{target}: no {shown}")
                    if not isinstance(here.get(key, getlink=True), h5py.HardLink):
                        raise InputError(f"{target}: {shown} is a link; expected a dataset")
                    here = here[key]
                check_inside(here, f"{target}: {shown}")
                if here.shape != shape:
                    raise InputError(
                        f"{target}: {shown} is {here.shape}; expected {shape}, as in {self.path}"
                    )
                check_stored(here, f"{target}: {shown}")
                return as_floats(here[()])
        except InputError:
            raise
        # TypeError: a type of HDF5 that NumPy has not.
        except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
            message = one_line_message(error)
            raise self.error(f"numbers in {short(text)}: cannot be read: {message}") from None
