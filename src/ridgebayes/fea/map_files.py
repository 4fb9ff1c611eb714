"""What ``--map`` says: keys and headers, typed or in a file."""

import re
from collections.abc import Iterable
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.runtime.reading import read_toml
from ridgebayes.runtime.text import shown_value

_LARGEST = 10**30  # of whole numbers: longer ones cannot be shown
_SHOWN = 80  # characters of a key that messages show


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
    found: dict[str, str] = {}
    for text in texts:
        match = re.fullmatch(r"\s*((?:\w+[\s:]+)?Q?\s*=?\s*\d+|[^=]*?)\s*=\s*(.*?)\s*", text, re.S)
        if match is None or not match.group(1) or not match.group(2):
            raise InputError(f"--map {text!r}: expected KEY=HEADER, or KEY=HEADER;UNIT")
        key, header = match.groups()
        if key in found:
            raise InputError(f"--map {text!r}: expected each key once")
        found[key] = header
    return found


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
            raise InputError(f"{path}: {name[:_SHOWN]}: expected tables [columns] and [values]")
        for key, value in entries.items():
            is_whole = isinstance(value, int) and not isinstance(value, bool)
            number = isinstance(value, float) or (is_whole and abs(value) < _LARGEST)
            text = value if isinstance(value, str) else shown_value(value)
            if not (isinstance(value, str) or (number and name == "values")):
                raise InputError(
                    f"{path}: [{name}] {key[:_SHOWN]} = {text}: expected text in quotes"
                )
            tables[name][key] = text
    return tables["columns"], tables["values"]
