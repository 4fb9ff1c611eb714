"""Facts that files lack and the user gives, and what ``--map`` says: typed, or in a file."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_toml
from ridgebayes.runtime.text import shown_value

_LARGEST = 10**30  # of whole numbers: longer ones cannot be shown


@dataclass(frozen=True)
class Given:
    """Facts that a file lacks and the user gives; each format takes only some of them.

    Parameters
    ----------
    map : tuple of str
        ``key=header``, or paths of TOML files with them.
    sheet : str or None
        Worksheet by name or number; None takes the one with the words of the field.
    skip_rows : int
        Lines to pass over at the top.
    header_row : int or None
        Line of the header; 0 for none, None looks for it.
    decimal : str or None
        "point" or "comma".
    empty : tuple of str
        Texts of cells that are empty.
    count_is : str or None
        Things counted, one of `ridgebayes.fea.words.COUNTS`.
    brackets, interpolate : bool
        For increments: always intervals, even where gaps tell the load within; or always loads.
    closed_is : tuple of int
        Codes of a status that mean contact; none for 0 open, 1 closed.
    skip_empty : bool
        Whether rows without a load are left out.
    load_se : str or None
        Standard error of every load of a table, in any unit of loads.
    texture : (float, float) or None
        Ridge and groove width over R.
    nu, R, E : str or None
        As typed; lengths and stresses with units for tables, plain numbers in a run's own units.
    thickness : str or None
        As R: of the slice, or of the body that forces press on.
    symmetry : str or None
        "half" or "full".
    top, corner : float or None
        Height of the ridges' tops, corner radius over R.
    deck : Path or None
        Input deck of a run.
    surface, reaction : str or None
        Node sets.
    field, time : str or None
        Name of a series' displacements; meaning of its time, "p_over_E" or "line".
    loads : tuple of float
        Loads of several ``.vtu``, or of a ``.pvd`` whose times are no loads, as `time` says.
    """

    map: tuple[str, ...] = ()
    sheet: str | None = None
    skip_rows: int = 0
    header_row: int | None = None
    decimal: str | None = None
    empty: tuple[str, ...] = ()
    count_is: str | None = None
    brackets: bool = False
    interpolate: bool = False
    closed_is: tuple[int, ...] = ()
    skip_empty: bool = False
    load_se: str | None = None
    texture: tuple[float, float] | None = None
    nu: str | None = None
    R: str | None = None
    E: str | None = None
    thickness: str | None = None
    symmetry: str | None = None
    top: float | None = None
    corner: float | None = None
    deck: Path | None = None
    surface: str | None = None
    reaction: str | None = None
    field: str | None = None
    time: str | None = None
    loads: tuple[float, ...] = ()

    def columns_and_values(self) -> tuple[dict[str, str], dict[str, str | float]]:
        """Return headers by key, and constants of a table by key: of files, and of options."""
        mapping: dict[str, str] = {}
        values: dict[str, str | float] = {}
        files = [text for text in self.map if text.endswith(".toml") and "=" not in text]
        for file in files:
            columns, constants = read_mapping(Path(file))
            mapping |= columns
            values |= constants
        mapping |= parse_map(text for text in self.map if text not in files)
        values |= self.numbers()
        if self.load_se is not None:
            values["load_se"] = self.load_se
        if self.texture is not None:
            values["a_over_R"], values["b_over_R"] = self.texture
        return mapping, values

    def numbers(self) -> dict[str, str]:
        """Return the numbers of the body that were typed, by key."""
        typed = {key: getattr(self, key) for key in ("nu", "R", "E", "thickness")}
        return {key: text for key, text in typed.items() if text is not None}


def parse_map(texts: Iterable[str]) -> dict[str, str]:
    """Return a mapping from texts ``key=header``, ``key=header;unit`` or ``gap Q=4=header``.

    Raises
    ------
    InputError
        If a text has no key or header, or a key stands twice.

    Examples
    --------
    >>> parse_map(["a=Ridge width;mm", "gap Q=4=Gap 1 [mm]", "Q=4=First", "p=Load Q=* [kPa]"])
    {'a': 'Ridge width;mm', 'gap Q=4': 'Gap 1 [mm]', 'Q=4': 'First', 'p': 'Load Q=* [kPa]'}
    """
    mapping: dict[str, str] = {}
    for text in texts:
        match = re.fullmatch(r"\s*((?:\w+[\s:]+)?Q?\s*=?\s*\d+|[^=]*?)\s*=\s*(.*?)\s*", text, re.S)
        if match is None or not match.group(1) or not match.group(2):
            raise InputError(f"--map {text!r}: expected KEY=HEADER, or KEY=HEADER;UNIT")
        key, header = match.groups()
        if key in mapping:
            raise InputError(f"--map {text!r}: expected each key once")
        mapping[key] = header
    return mapping


def read_mapping(path: Path) -> tuple[dict[str, str], dict[str, str]]:
    """Read a mapping that is kept beside the data.

    Parameters
    ----------
    path : pathlib.Path
        A TOML file: ``[columns]`` of key and header (``a = "Ridge width [mm]"``), and optionally
        ``[values]`` of key and value (``R = "8 mm"``).

    Returns
    -------
    mapping, values : dict of str to str
        As `ridgebayes.fea.columns.read_columns` takes them.

    Raises
    ------
    InputError
        If it is not TOML, or has other keys, or others than text in columns.
    """
    tables: dict[str, dict[str, str]] = {"columns": {}, "values": {}}
    for name, entries in read_toml(path).items():
        if name not in tables or not isinstance(entries, dict):
            raise InputError(f"{path}: {name[:80]}: expected tables [columns] and [values]")
        for key, value in entries.items():
            is_number = isinstance(value, float) or (type(value) is int and abs(value) < _LARGEST)
            text = value if isinstance(value, str) else shown_value(value)
            if not isinstance(value, str) and not (is_number and name == "values"):
                raise InputError(f"{path}: [{name}] {key[:80]} = {text}: expected text in quotes")
            tables[name][key] = text
    return tables["columns"], tables["values"]
