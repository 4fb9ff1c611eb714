"""Columns that a table needs and that no word tells: the likeliest is proposed, never taken."""

from collections.abc import Mapping, Sequence

import pandas as pd

from ridgebayes.fea.mapping import Use, as_load
from ridgebayes.fea.record import FileError
from ridgebayes.fea.words import DIMENSIONS, is_counter, split_header, unit_factor

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
    taken = {use.header for use in uses}
    names = [name for name in map(str, cells) if not (name in taken or is_counter(name))]
    texts = {name: cells[name].astype(str).str.replace(",", ".") for name in names}
    numbers = {name: pd.to_numeric(text, errors="coerce") for name, text in texts.items()}
    is_text = {name: cells[name].dtype.kind not in "if" for name in names}
    free = {n: some for n, some in numbers.items() if not (is_text[n] and some.isna().any())}
    kinds = {name: _kind(name, some) for name, some in free.items()}
    if any(use.key == "Q" for use in uses):  # then no other column counts
        kinds = {name: kind.replace("Q", "") for name, kind in kinds.items()}
    uses = [*uses]
    for key in lacking:
        problems.columns = ", ".join(map(repr, list(cells)[:50]))
        text = f"no column {_NAMES[key]}; name it with --map '{key}=HEADER'"
        wanted = {"a": "length", "b": "length"}.get(key, key)
        likely = [name for name in free if kinds[name] == wanted]
        likely = likely or [name for name in free if not kinds[name] and key != "Q"]
        # Only the user knows which of several loads presses, as of Fx and Fz.
        header = likely[0] if likely and (key != "load" or len(likely) == 1) else None
        if header is None and wanted == "length":
            problems.need(f"{text}, or give --texture A,B", texture="?,?")
        else:
            problems.need(text, {key: header or "?"})
        if header is not None:
            cells[header] = free.pop(header).astype(float)
            uses.append(as_load(Use(key, header), uses, values, problems))
    return uses


def _kind(name: str, numbers: "pd.Series[float]") -> str:
    """Return what a column may be by its unit and its numbers: length, load or Q; else nothing."""
    unit = split_header(name)[1]
    if not unit:
        return "Q" if (numbers.round().eq(numbers) & numbers.ge(2)).all() else ""
    if unit_factor(unit, "length") is not None:
        return "length"
    return "load" if any(unit_factor(unit, some) for some in set(DIMENSIONS.values())) else ""
