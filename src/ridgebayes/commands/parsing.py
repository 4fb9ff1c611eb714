"""Parsers of option values, and checks of output files."""

import math
import os
from collections.abc import Sequence
from pathlib import Path

from ridgebayes.errors import InputError
from ridgebayes.scene.units import to_si


def refuse_output(path: Path, force: bool, *suffixes: str) -> None:
    """Raise InputError for an output file that cannot be written, before the work starts.

    Parameters
    ----------
    path : Path
        File to write.
    force : bool
        Whether an existing file may be replaced.
    *suffixes : str
        Allowed suffixes of the name; any if not given.
    """
    folder = path.absolute().parent
    if suffixes and path.suffix.lower() not in suffixes:
        expected = f"a file name that ends in {' or '.join(suffixes)}"
        raise InputError(f"{path}: expected {expected}, got {path.suffix or 'no suffix'!r}")
    if path.is_dir():
        raise InputError(f"{path}: expected a file, got a folder")
    why = (
        "exists; use another name, or --force to replace it" if path.exists() and not force else ""
    )
    if not folder.is_dir():
        why = f"folder {path.parent} does not exist; expected an existing folder"
    elif not why and not os.access(folder, os.W_OK):
        why = f"folder {path.parent} cannot be written to; expected a writable folder"
    if why:
        raise InputError(f"{path}: {why}")


def parse_names(text: str | None, option: str = "--forms") -> list[str]:
    """Parse comma-separated names; none if the option is not given."""
    names = [] if text is None else [name.strip() for name in text.split(",")]
    if not all(names):
        raise InputError(f"{option} {text!r}: an empty name; expected names separated by commas")
    return names


def parse_form(text: str) -> str:
    """Convert a form's title, such as ``Power law``, to its name.

    Examples
    --------
    >>> parse_form("Power law"), parse_form("half-plane")
    ('power-law', 'half-plane')
    """
    return "-".join(text.lower().split())


def parse_forms(text: str | None) -> list[str]:
    """Parse comma-separated names of forms."""
    return [parse_form(name) for name in parse_names(text)]


def parse_odds(text: str) -> dict[str, float]:
    """Parse comma-separated FORM=NUMBER to prior odds by form."""
    odds_of: dict[str, float] = {}
    for part in text.split(",") if text else []:
        name, _, odds = part.partition("=")
        name = parse_form(name)
        try:
            number = float(odds)
        except ValueError:
            number = math.nan
        if not name or math.isnan(number) or name in odds_of:
            raise InputError(
                f"--prior-odds {text!r}: {part.strip()!r}; expected FORM=NUMBER separated by "
                "commas, without repeats, such as hybrid=2,classic=0.5"
            )
        odds_of[name] = number
    return odds_of


def parse_numbers(text: str, option: str) -> tuple[float, ...]:
    """Parse comma-separated numbers."""
    try:
        return tuple(float(part) for part in text.split(",")) if text else ()
    except ValueError:
        raise InputError(f"{option} {text!r}: expected numbers separated by commas") from None


def parse_inches(text: str, option: str) -> float:
    """Parse the width of a figure, 50 to 1000 mm, to inches.

    Examples
    --------
    >>> round(parse_inches("85 mm", "--width"), 3)
    3.346
    """
    try:
        metres = float(to_si(text, "length"))
    except InputError as error:
        raise InputError(f"{option} {error}") from None
    if not 0.05 <= metres <= 1:
        raise InputError(f"{option} {text!r}: expected 50 to 1000 mm")
    return metres / 0.0254


def medians_taken(names: Sequence[str]) -> list[str]:
    """Return a message that names the uncertain values replaced by their medians, if any."""
    return [f"medians are taken of {', '.join(names)}"] if names else []
