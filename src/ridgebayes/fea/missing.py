"""Proposals for required columns that were not recognised; the user has to confirm them."""

from collections.abc import Sequence

import pandas as pd

from ridgebayes.fea.mapping import Use, as_load
from ridgebayes.fea.record import FileError
from ridgebayes.fea.words import COUNTER, load_kind, split_header, unit_factor

_KEY_NAMES = {
    "a": "a_over_R (or a, pitch)",
    "b": "b_over_R (or b, pitch)",
    "Q": "Q",
    "load": "p_over_E (or p, line, force, load)",
}


def ask_columns(
    lacking: Sequence[str], cells: pd.DataFrame, uses: list[Use], problems: FileError
) -> None:
    """Ask the user for missing columns, and add the proposed columns to the uses.

    The proposed columns let the import go on, so that further errors are found; `problems` holds an
    error for each missing quantity.

    Parameters
    ----------
    lacking : sequence of str
        Missing quantities, as `ridgebayes.fea.mapping.lacking` returns them.
    cells : DataFrame
        The table; proposed columns are converted to numbers in place.
    uses : list of Use
        Recognised columns.
    problems : FileError
        Collects the questions.
    """
    taken = {use.header for use in uses}
    headers = [*map(str, cells)]
    names = [name for name in headers if not (name in taken or COUNTER.search(name.lower()))]
    texts = {name: cells[name].astype(str).str.replace(",", ".") for name in names}
    numbers = {name: pd.to_numeric(text, errors="coerce") for name, text in texts.items()}
    is_text = {name: cells[name].dtype.kind not in "if" for name in names}
    free = {n: column for n, column in numbers.items() if not (is_text[n] and column.isna().any())}
    kinds = {name: _kind(name, column) for name, column in free.items()}
    if any(use.key == "Q" for use in uses):  # the table already has a column of counts
        kinds = {name: kind.replace("Q", "") for name, kind in kinds.items()}
    is_bare = not any(split_header(name)[1] for name in headers)  # no unit tells lengths
    for key in lacking:
        problems.columns = ", ".join(map(repr, list(cells)[:50]))
        text = f"no column {_KEY_NAMES[key]}; name it with --map '{key}=HEADER'"
        kind = {"a": "length", "b": "length"}.get(key, key)
        likely = [name for name in free if kinds[name] == kind]
        likely = likely or [name for name in free if is_bare and key != "Q" and not kinds[name]]
        # Several loads are ambiguous: only the user knows whether Fx or Fz presses.
        header = likely[0] if likely and (key != "load" or len(likely) == 1) else None
        if header is None and kind == "length":
            problems.need(f"{text}, or give --texture A,B", texture="?,?")
        else:
            problems.need(text, {key: header or "?"})
        if header is not None:
            cells[header] = free.pop(header).astype(float)
            uses.append(as_load(Use(key, header), uses, problems))


def _kind(name: str, numbers: "pd.Series[float]") -> str:
    """Return "length", "load", "Q" or "", the possible kind of a column by unit and numbers."""
    unit = split_header(name)[1]
    if not unit:
        return "Q" if (numbers.round().eq(numbers) & numbers.ge(2)).all() else ""
    if unit_factor(unit, "length") is not None:
        return "length"
    return "load" if load_kind(unit) else ""
