"""The column contract of a contact table, written once, and the check of a header against it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ridgebayes.errors import InputError


@dataclass(frozen=True)
class Column:
    """One column of the contract.

    A column whose `default` is None is required. One that is not `always_written` is left out of
    a file in which every row holds the default.
    """

    name: str
    holds: Literal["number", "text"]
    meaning: str
    rule: str
    default: float | str | None = None
    always_written: bool = False


TRANSITION, COUNT = "transition", "count"
CALIBRATION, HELD_OUT = "calibration", "held-out"
OK = "ok"
_MOST_NAMED, _LONGEST = 50, 80  # columns that messages list, and characters of each
LARGEST_Q = 2**53  # beyond it a Q read as a float is no longer a definite integer

# Within these a load of any countable Q, and of none but the first, is a float of full precision.
LEAST_WIDTH, LARGEST_WIDTH, LARGEST_LOAD = 1e-50, 1e50, 1e300

COLUMNS = (
    Column("a_over_R", "number", "ridge width over radius", "must be finite and > 0"),
    Column("b_over_R", "number", "groove width over radius", "must be finite and > 0"),
    Column("Q", "number", "proximal edges in contact", "must be an integer of at most 2^53"),
    Column(
        "p_over_E",
        "number",
        "load at which that Q was reached (transition) or seen (count)",
        "must be finite and > 0",
    ),
    Column(
        "p_over_E_lower",
        "number",
        "last load at which that Q was not yet reached",
        "must be finite and >= 0",
        np.nan,
    ),
    Column(
        "rel_se",
        "number",
        "known relative standard error of the load",
        "must be finite and >= 0",
        0.0,
    ),
    Column(
        "kind",
        "text",
        "a transition load, or a count seen at a load",
        "must be 'transition' or 'count'",
        TRANSITION,
    ),
    Column("nu", "number", "Poisson's ratio", "must be from 0 to 0.5", 0.5, True),
    Column(
        "offset_over_R",
        "number",
        "lateral offset of the body from the groove's centre",
        "must be finite",
        0.0,
    ),
    Column(
        "texture",
        "text",
        "label of the texture; empty means a<A>_b<B>",
        "one label names one (a_over_R, b_over_R)",
        "",
        True,
    ),
    Column("series", "text", "which curve of this texture", "any text on one line", ""),
    Column(
        "role",
        "text",
        "fitted, or predicted and compared only",
        "must be 'calibration' or 'held-out'",
        CALIBRATION,
    ),
    Column("solver", "text", "who computed the row", "any text on one line", "", True),
    Column("status", "text", "'ok', or what failed", "any text on one line", OK, True),
    Column("source", "text", "where the row came from", "any text on one line", "", True),
)
RULES = {column.name: column.rule for column in COLUMNS}
NAMES = tuple(column.name for column in COLUMNS)
REQUIRED = tuple(column.name for column in COLUMNS if column.default is None)
NUMBERS = tuple(column.name for column in COLUMNS if column.holds == "number")
CURVE = ("a_over_R", "b_over_R", "nu", "offset_over_R", "source", "solver", "series")


def check_header(names: Sequence[Any], where: str) -> None:
    """Refuse columns that cannot be told apart or are not all there.

    Parameters
    ----------
    names : sequence of str
        The columns of a table, in any order.
    where : str
        Name that messages show.

    Raises
    ------
    InputError
        If a column has no name, a name stands twice, or a required column is missing.

    Examples
    --------
    >>> check_header(["a_over_R", "b_over_R", "Q", "p"], "fea.csv")
    Traceback (most recent call last):
        ...
    ridgebayes.errors.InputError: fea.csv, header: missing column p_over_E;
    the columns are 'a_over_R', 'b_over_R', 'Q', 'p'
    """
    there = ", ".join(repr(name)[:_LONGEST] for name in names[:_MOST_NAMED]) or "none"
    if len(names) > _MOST_NAMED:
        there += f" and {len(names) - _MOST_NAMED} more"
    before: set[str] = set()
    for i, name in enumerate(names, start=1):
        shown = repr(name)[:_LONGEST]
        if not isinstance(name, str) or not name:
            raise InputError(
                f"{where}, header: column {i} = {shown}: must have a name, as text; "
                f"the columns are {there}"
            )
        if name in before:
            raise InputError(
                f"{where}, header: column {i} = {shown}: each column must stand once; "
                f"the columns are {there}"
            )
        before.add(name)
    if missing := [name for name in REQUIRED if name not in names]:
        columns = "column" if len(missing) == 1 else "columns"
        hint = " (columns are separated by commas)" if ";" in there or "\\t" in there else ""
        raise InputError(
            f"{where}, header: missing {columns} {', '.join(missing)}; "
            f"the columns are {there}{hint}"
        )
