"""Why a scene file is no TOML, in the words of a quantity where it was meant as one."""

import re
import tomllib

from ridgebayes.runtime.text import one_line_message
from ridgebayes.scene.units import with_point

# What is no TOML but was meant as a quantity: a decimal comma, or a unit without quotes.
_QUANTITY_LINE = re.compile(
    r"\s*([\w.]+\s*=\s*)([+-]?[0-9][0-9.,]*)[ \t]*([^\s\"'#\[\],][^\"'#]*)?(#.*)?"
)


def syntax_error(content: bytes, error: Exception) -> str:
    """Say why a file is not TOML: in the words of a quantity where it was meant as one."""
    place = re.search(r"at line (\d+)", str(error))
    if isinstance(error, tomllib.TOMLDecodeError) and place is not None:
        number = int(place[1])
        quantity = _QUANTITY_LINE.fullmatch(content.decode("utf-8").split("\n")[number - 1])
        if quantity is not None:
            key, value, unit = quantity[1], quantity[2], (quantity[3] or "").strip()
            wrong = "a decimal comma" if "," in value else "a unit without quotes"
            right = f'"{with_point(value)} {unit}"' if unit else with_point(value)
            given = f"{key}{value} {unit}".strip()
            return f"line {number}: {given}: has {wrong}; expected {key}{right}"
    return f"not a TOML file in UTF-8: {one_line_message(error)}"
