"""Values of options as they are typed: names, textures, loads, files to write."""

import os
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError

_LOADS = "LO:HI:N or log:LO:HI:N with 0 < LO <= HI and N >= 1, such as 0.001:0.02:50"


def refuse_existing(path: Path, force: bool) -> None:
    """Refuse a file that cannot be written, before the work rather than after it."""
    if path.is_dir():
        raise InputError(f"{path}: expected a file for -o, got a folder")
    if not path.absolute().parent.is_dir():
        raise InputError(
            f"{path}: folder {path.parent} does not exist; expected an existing folder"
        )
    if path.exists() and not force:
        raise InputError(f"{path}: exists; use another -o, or --force to replace it")
    if not os.access(path.absolute().parent, os.W_OK):
        raise InputError(
            f"{path}: folder {path.parent} cannot be written to; expected a writable one"
        )


def parse_names(text: str, option: str = "--forms") -> list[str]:
    """Return comma-separated names."""
    names = [name.strip() for name in text.split(",")] if text else []
    if not all(names):
        raise InputError(
            f"{option} {text!r}: an empty name; expected names with commas between them"
        )
    return names


def parse_numbers(text: str, option: str) -> tuple[float, ...]:
    """Return comma-separated numbers."""
    try:
        return tuple(float(one) for one in text.split(",")) if text else ()
    except ValueError:
        raise InputError(f"{option} {text!r}: expected numbers with commas between them") from None


def parse_texture(text: str) -> tuple[float, float]:
    """Return the ridge and groove width of A,B."""
    try:
        a, b = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"--texture {text!r}: expected A,B, two numbers with one comma, such as 0.022,0.02"
        ) from None
    if not (0 < a < float("inf") and 0 < b < float("inf")):
        raise InputError(f"--texture {text!r}: expected both widths finite and > 0")
    return a, b


def parse_loads(text: str) -> FloatArray:
    """Return the loads p/E of LO:HI:N or log:LO:HI:N, shape (N,)."""
    try:
        low, high, n = text.removeprefix("log:").split(":")
        ends, count = (float(low), float(high)), int(n)
    except ValueError:
        raise InputError(f"--p-over-E {text!r}: expected {_LOADS}") from None
    if not 0 < ends[0] <= ends[1] < float("inf") or count < 1:
        raise InputError(f"--p-over-E {text!r}: expected {_LOADS}")
    return np.geomspace(*ends, count) if text.startswith("log:") else np.linspace(*ends, count)
