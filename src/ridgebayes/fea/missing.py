"""Columns that a table needs and that no word tells: the likeliest is proposed, never taken."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.fea.mapping import Use, as_load
from ridgebayes.fea.record import FileError
from ridgebayes.fea.words import DIMENSIONS, split_header, unit_factor

# Columns of increments that are nothing of a texture.
_COUNTER = re.compile(r"\b(?:inc|increment|inkrement|time|zeit|step|schritt|nr|no|id|index)\b|^#")
_NAMES = {
    "a": "a_over_R (or a)",
    "b": "b_over_R (or b, pitch)",
    "Q": "Q",
    "load": "p_over_E (or p, line, force, load)",
}


def ask_columns(
    lacking: Sequence[str],
    cells: pd.DataFrame,
    uses: list[Use],
    values: Mapping[str, object],
    problems: FileError,
) -> list[Use]:
    """Return the uses with the likeliest column for what is missing, and note what is.

    Parameters
    ----------
    lacking : sequence of str
        As `ridgebayes.fea.mapping.lacking` returns it.
    cells : DataFrame
        All of the table; the columns that are taken become numbers.
    uses : list of Use
        Recognised columns.
    values : mapping of str to object
        Constants by key.
    problems : FileError
        Where it is noted what the user has to name.
    """
    uses = [*uses]
    for key in lacking:
        problems.columns = ", ".join(map(repr, list(cells)[:50]))
        text = f"no column {_NAMES[key]}; name it with --map '{key}=HEADER'"
        header = _likely(key, cells, uses)
        if header is None and key in ("a", "b"):
            problems.need(f"{text}, or give --texture A,B", texture="?,?")
        else:
            problems.need(text, {key: header or "?"})
        if header is not None:
            cells[header] = _as_numbers(cells[header])
            uses.append(as_load(Use(key, header), uses, values, problems))
    return uses


def _likely(key: str, cells: pd.DataFrame, uses: list[Use]) -> str | None:
    """Return the header that is most likely meant, for the user to check."""
    taken = {use.header for use in uses}
    numbers = {
        name: some
        for name in map(str, cells)
        if name not in taken and not _COUNTER.search(name.lower()) and name[:7] != "(column"
        if len(some := _as_numbers(cells[name]))
    }
    has_Q = any(use.key == "Q" for use in uses)  # so that no other column counts

    def fits(name: str) -> int:
        unit, some = split_header(name)[1], numbers[name]
        is_length = unit_factor(unit, "length") is not None
        is_count = bool((some == np.round(some)).all() and (some >= 2).all()) and not has_Q
        is_load = any(unit_factor(unit, d) for d in set(DIMENSIONS.values()) - {"length"})
        return {"Q": is_count and not unit, "load": is_load - is_length - is_count}.get(
            key, is_length - is_load - (is_count and not unit)
        )

    best = max(numbers, key=fits, default=None)
    # Only the user knows which of several loads presses, as of Fx and Fz.
    n = 1 if best is None or key != "load" else sum(fits(name) == fits(best) for name in numbers)
    return None if best is None or n > 1 or fits(best) < (key == "Q") else best


def _as_numbers(cells: "pd.Series[Any]") -> FloatArray:
    """Return the numbers of a column, with points or commas for decimals; none if some are not."""
    if cells.dtype.kind not in "if":
        cells = pd.to_numeric(cells.astype(str).str.replace(",", "."), errors="coerce")
        if cells.isna().any():
            return np.array([])
    return cells.to_numpy(float)
