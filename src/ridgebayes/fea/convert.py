"""Conversion of columns and constants of a table to SI units and dimensionless rows."""

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.fea.mapping import ABOVE_0, LOADS, SDS, Use
from ridgebayes.fea.record import MAX_REL_SE, FileError
from ridgebayes.fea.words import (
    COUNTS,
    DIMENSIONS,
    STATUS_RULE,
    column_unit,
    divided,
    load_kind,
    number_and_unit,
    split_header,
    touching,
    unit_factor,
)
from ridgebayes.runtime.text import count, percent, some_of
from ridgebayes.table.columns import COUNT, NAMES, OK
from ridgebayes.table.columns import SHOWN as MOST_SHOWN
from ridgebayes.table.rules import as_text

_MISSING_CONSTANTS = {  # meaning of the constant, and an example value for messages
    "R": ("radius of the body", "? mm"),
    "E": ("Young's modulus of the body", "? kPa"),
    "thickness": ("length of the body along the ridges, needed for forces", "? mm"),
}
_REDUNDANT = {"pitch": ("a", "b"), "D": ("R", "R")}  # lengths, and the keys of their parts
# Divisors that convert each kind of load to p/E, where p is the line load over 2 R.
_LOAD_DIVISORS = {"p_over_E": (), "p": ("E",), "line": ("R", "E"), "force": ("thickness", "R", "E")}


class Converter:
    """Converter of the recognised columns and constants of a table to dimensionless rows.

    Either all columns and constants with a dimension have a unit, or none has.

    Parameters
    ----------
    cells : DataFrame, n_row rows
        Numbers and texts by header.
    uses : list of Use
        Recognised columns.
    problems : FileError
        The import, with facts and constants; collects messages, errors and missing facts.
    """

    def __init__(self, cells: pd.DataFrame, uses: Sequence[Use], problems: FileError) -> None:
        self.cells, self.problems = cells, problems
        self.facts, self.messages = problems.facts, problems.messages
        self.uses = {(use.key, use.Q): use for use in uses}
        self.used: dict[Use, str] = {}  # how each column is read, for messages
        self._values = problems.values
        self._used_values: dict[str, None] = {}
        self._units: dict[str, tuple[str, str]] = {}  # key and unit of each column and constant

    def rows(self, term: str | None) -> pd.DataFrame:
        """Return a row for each transition or increment, with contract columns.

        Parameters
        ----------
        term : str or None
            Counted objects, as `ridgebayes.fea.mapping.assign` returns them.

        Returns
        -------
        DataFrame
            Empty if a column is missing; the missing column is reported.
        """
        columns = self.curve() | {"Q": self._counts(self.number("Q"), term)}
        load = columns["p_over_E"] = self.load()
        columns |= {"p_over_E_lower": self.load("_lower"), "rel_se": self._rel_se(load)}
        columns |= self.texts("kind", "role", "status")
        self.summarize()
        if any(columns[key] is None for key in ("a_over_R", "b_over_R", "Q", "p_over_E")):
            return pd.DataFrame()
        return self.framed(columns)

    def finished(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Return the rows that are transitions, with the user's additional columns."""
        if (load_se := self.load_se()) is not None:
            rel_se = frame["rel_se"].fillna(0.0) if "rel_se" in frame else 0.0
            frame = frame.assign(rel_se=np.hypot(rel_se, load_se / frame["p_over_E"]))
        extra = [name for name in self.left() if name not in NAMES]
        ignored = [name for name in self.left() if name in NAMES]
        has_sd = any(use.key in SDS for use in self.used)
        has_repeats = has_sd and frame.duplicated(["a_over_R", "b_over_R", "Q"]).any()
        frame = frame.assign(**{name: self.cells[name] for name in extra})
        few = frame["Q"].isin([0, 2]) & (frame.get("kind", "") != COUNT)
        exact = frame["p_over_E"].notna() & frame.get("rel_se", few).isna()
        remarks = {
            f"ignored, as the mapping uses other columns: {listed(ignored)}": ignored,
            f"kept as they are: {listed(extra)}": extra,
            "repeats with an sd of their own: sigma is fitted to the scatter of repeats, so an "
            "sd over the same repeats counts it twice": has_repeats,
            f"{count(exact.sum(), 'row')} without an error of their own: rel_se is 0": exact.any(),
            f"{count(few.sum(), 'row')} of Q under 4 ignored: all touch at any load": few.any(),
        }
        self.messages += [remark for remark, holds in remarks.items() if holds]
        return frame[~few & ~self._empty(frame, extra)]

    def curve(self) -> dict[str, Any]:
        """Return the columns that are constant along a curve."""
        a, b = self.over_R("a"), self.over_R("b")
        one = a if b is None else b if a is None else None
        if one is not None and (pitch := self.over_R("pitch")) is not None:
            rest = np.round(pitch - one, 12)  # removes rounding errors of a difference of decimals
            said = "a: pitch minus groove width" if a is None else "b: pitch minus ridge width"
            self.messages.append(said)
            a, b = (rest, b) if a is None else (a, rest)
        columns = {"a_over_R": a, "b_over_R": b, "offset_over_R": self.over_R("offset")}
        columns["nu"] = self.number("nu")
        return columns | self.texts("texture", "series", "solver", "source")

    def load(self, suffix: str = "") -> FloatArray | None:
        """Return p/E of the loads, whatever their kind; None without a column of loads."""
        for key in LOADS:
            if (numbers := self.number(key + suffix)) is not None:
                return self._over_E(key, numbers)
        return None

    def load_se(self) -> FloatArray | None:
        """Return the standard error of the loads over E, or None if the user gives none."""
        if "load_se" not in self._values:
            return None
        unit, use = number_and_unit(self._values["load_se"])[1], self.load_use()
        key = load_kind(unit) if unit else use.key if use is not None else ""
        if not key:
            rule = "expected a number above 0 and a unit of loads, as '0.05 N'"
            raise self.problems.error(f"value load_se = {self._values['load_se']!r}: {rule}")
        return self._over_E(key, self._constant("load_se", key))

    def load_use(self) -> Use | None:
        """Return the column of loads, or None if there is none or one column per Q."""
        return next((use for key in LOADS if (use := self.uses.get((key, None)))), None)

    def texts(self, *keys: str) -> dict[str, Any]:
        """Return text columns or constants by key."""
        columns: dict[str, Any] = {}
        for key in keys:
            if (use := self.uses.get((key, None))) is not None:
                self.tell(use)
                columns[key] = as_text(self.cells[use.header])
            elif key in self._values:
                self._used_values[key] = None
                columns[key] = self._values[key]
        return columns

    def status(self, use: Use, *, may_be_empty: bool = True) -> FloatArray:
        """Return gaps of -inf (closed), inf (open) or NaN (empty) of a column of status."""
        self.tell(use)
        gap, bad = touching(as_text(self.cells[use.header]), self.facts.closed_is)
        if bad.any():
            self.problems.options.setdefault("closed_is", "?")
        bad |= np.isnan(gap) & (not may_be_empty)
        self.problems.cells(self.cells.index[bad], use.header, STATUS_RULE)
        return gap

    def number(self, key: str, Q: int | None = None) -> FloatArray | None:
        """Return a column or constant in SI units, or None if there is none."""
        use = self.uses.get((key, Q)) or self.uses.get((key, None))
        if use is not None:
            return self._column(use)
        return self._constant(key, key) if key in self._values else None

    def tell(self, use: Use, how: str = "") -> None:
        """Note that a column is used, for the summary."""
        self.used[use] = how + (", guessed from its header" if use.how == "guessed" else "")

    def summarize(self) -> None:
        """Report the columns and constants that are used, and ask for missing units."""
        self.load_se()  # its unit belongs to the summary
        plain = [use.name for use, how in self.used.items() if use.name == use.header and not how]
        if plain:
            self.messages.append(f"recognised by name: {', '.join(plain)}")
        for use, how in self.used.items():
            if use.name != use.header or how:
                self.messages.append(f"{use.name}: column {use.header!r}{how}")
        self.messages += [f"{key}: {self._values[key]}, as given" for key in self._used_values]
        if unused := self._values.keys() - self._used_values:
            self.messages.append(f"values given but not used: {', '.join(sorted(unused))}")
        bare = [name for name, (_, unit) in self._units.items() if not unit]
        have = [f"{name} in {unit}" for name, (_, unit) in self._units.items() if unit]
        if have and bare:
            self._ask_units(have, bare)
        elif have or bare:
            one_system = "no units given; one consistent system assumed"
            self.messages.append("all units converted" if have else one_system)

    def framed(self, columns: Mapping[str, Any]) -> pd.DataFrame:
        """Return a frame of the columns that are not None."""
        present = {key: value for key, value in columns.items() if value is not None}
        return pd.DataFrame(present, index=self.cells.index)

    def left(self) -> list[str]:
        """Return the headers of columns that are not used."""
        used = {use.header for use in self.used}
        return [name for name in map(str, self.cells) if name not in used]

    @property
    def doubts(self) -> list[str]:
        """Cautions on unused columns of a pitch or diameter that contradict the used columns."""
        doubts, used = [], {use.key for use in self.used} | self._used_values.keys()
        for key, parts in _REDUNDANT.items():
            use = self.uses.get((key, None))
            if use is None or use in self.used or not used.issuperset(parts):
                continue
            _, factor, rule = column_unit(key, use.header, use.unit)
            size = self.cells[use.header].to_numpy(dtype=float) * float(factor)
            whole = sum(x for part in parts if (x := self.number(part)) is not None)
            off = float(np.nanmax(np.abs(size / whole - 1), initial=0.0))
            if off > MAX_REL_SE and not rule:
                doubts.append(f"column {use.header!r} is {percent(off)} off {' + '.join(parts)}")
        return doubts

    def _column(self, use: Use) -> FloatArray:
        key, has_dimension = use.key, use.key in DIMENSIONS
        unit, factor, rule = column_unit(key, use.header, use.unit)
        if rule:
            last = split_header(use.header)[0].replace("_", " ").split()[-1]
            fits = has_dimension and unit_factor(last, DIMENSIONS[key]) is not None
            self.problems.need(
                f"{self.problems.where}, header {use.header!r}: {rule}",
                {use.name: f"{use.header};{last if fits else '?'}"},
            )
        elif has_dimension:
            self._units[f"{key} ({use.header!r})"] = key, unit
        self.tell(use, f" in {unit}" if unit else ", no unit" if has_dimension else "")
        numbers = self.cells[use.header].to_numpy(dtype=float)
        return numbers if factor == 1 else divided(numbers * float(factor))

    def _constant(self, name: str, key: str) -> FloatArray:
        """Return a constant in SI units; `key` tells its dimension, and whether it is above 0."""
        text, kind = self._values[name], DIMENSIONS.get(key)
        number, unit = number_and_unit(text)
        factor = Fraction(1) if not unit else unit_factor(unit, kind) if kind else None
        is_above_0 = key in (*ABOVE_0, "p_over_E")
        if factor is None or not np.isfinite(number) or (is_above_0 and number <= 0):
            rule = f"a finite number{' above 0' if is_above_0 else ''}"
            rule += f" and a unit of {kind}" if kind else ""
            rule += "; its error is common to all loads and no part of the table" * ("±" in text)
            raise self.problems.error(f"value {name} = {text!r}: expected {rule}")
        self._used_values[name] = None
        if kind:
            self._units[name] = key, unit
        return np.array(number * float(factor))

    def over_R(self, key: str) -> FloatArray | None:
        """Return a length over R, from a column or constant of the ratio or of the length."""
        ratio = self.number(f"{key}_over_R")
        if ratio is None and (half := self.number(f"{key}_over_D")) is not None:
            self.messages.append(f"{key} over the diameter: doubled, to be over R")
            return 2 * half
        if ratio is not None or (length := self.number(key)) is None:
            return ratio
        return divided(length, self._needed("R"))

    def _over_E(self, key: str, loads: FloatArray) -> FloatArray:
        by = [self._needed(name) for name in _LOAD_DIVISORS[key]]
        return divided(loads / 2 if len(by) > 1 else loads, *by) if by else loads

    def _needed(self, key: str) -> FloatArray:
        if (numbers := self.number(key)) is not None:
            return numbers
        if key == "R" and (numbers := self.number("D")) is not None:
            return numbers / 2
        why, example = _MISSING_CONSTANTS[key]
        self._units[key] = key, example.split()[1]  # the unit in the user's answer
        ways = f"expected --{key} '{example}', or a column, --map '{key}=HEADER'"
        self.problems.need(f"{key} is missing ({why}): {ways}", None, **{key: example})
        return np.array(1.0)  # a placeholder, so that all other errors are found, too

    def _rel_se(self, load: FloatArray | None) -> FloatArray | None:
        """Return the relative standard error of loads, from the columns of errors and sds."""
        rel_se, n = self.number("rel_se"), self.uses.get(("n_mean", None))
        for end in ("_sem", "_sd"):
            if (share := self.number(f"rel{end}")) is None and (se := self.load(end)) is not None:
                share = divided(se, np.array(np.nan) if load is None else load)
            if share is not None and end == "_sd" and n is not None:
                numbers = self.cells[n.header].to_numpy(dtype=float)
                is_lost = np.isnan(numbers) & ~np.isnan(share)
                self.problems.cells(is_lost, n.header, "expected a number beside an sd")
                share = share / np.sqrt(numbers)
                self.tell(n, ", how many loads the mean is of: its error is sd over their root")
            if share is not None:
                return share if rel_se is None else np.hypot(rel_se, share)
        return rel_se

    def _counts(self, counts: FloatArray | None, term: str | None) -> FloatArray | None:
        """Return Q from counts of edges, ridges or segments, or of edges on one side."""
        if counts is None:
            return None
        if self.facts.count_is is None and term == "":
            is_odd = (counts[~np.isnan(counts)] % 2 == 1).any()
            self.problems.need(
                "counts: the header does not say what is counted; expected --count-is edges, "
                "ridges, segments or per-side (edges on one side of the body)",
                count_is="per-side" if is_odd else "edges",
            )
        if term := self.facts.count_is or term:
            self.messages.append(f"counts of {term}: {COUNTS[term]}")
        return 2 * counts if term == "per-side" else counts

    def _empty(self, frame: pd.DataFrame, extra: list[str]) -> "pd.Series[bool]":
        """Return a mask of the rows to leave out without a load; report them as errors otherwise.

        Rows without a load are left out with ``--skip-empty`` only.
        """
        is_ok = frame["status"].isin(["", OK]) if "status" in frame else True
        empty = frame["p_over_E"].isna() & is_ok
        empty &= ~frame.index.isin(list(self.problems.broken_rows()))
        if empty.any() and not self.facts.skip_empty:
            use = self.load_use()
            rule = "expected a load; --skip-empty leaves out rows without one"
            if use is not None and use.header in self.cells:
                self.problems.cells(frame.index[empty], use.header, rule)
            self.problems.options.setdefault("skip_empty", "yes")
            return empty & False
        if n := int(empty.sum()):
            texts = [name for name in extra if frame[name].dtype.kind not in "if"]
            why = frame.loc[empty, texts].astype(str).agg(" ".join, axis=1).str.strip()
            reasons = listed(why.mask(why == "", "no reason given").unique(), "")
            self.messages.append(f"{count(n, 'row')} without a load left out: {reasons}")
        return empty

    def _ask_units(self, have: list[str], bare: list[str]) -> None:
        """Ask for missing units, and propose the unit of another quantity of the same dimension."""
        units = {DIMENSIONS[key]: u for key, u in reversed(self._units.values()) if u}
        mapping, options = {}, {}
        for name in bare:
            key = self._units[name][0]
            unit = units.get(DIMENSIONS[key], "?")
            if name in self._values:
                options[name] = f"{self._values[name]} {unit}"
            elif (use := self.uses.get((key, None))) is not None:
                mapping[key] = f"{use.header};{unit}"
        self.problems.need(
            f"{self.problems.where}: {', '.join(have)}, but {', '.join(bare)} without a "
            "unit; expected units on all columns and values that have dimensions, or on none",
            mapping,
            **options,
        )


def listed(names: Iterable[str], quote: str = "'") -> str:
    """Return the first names in quotes, separated by commas."""
    return some_of((repr(name) if quote else name for name in names), MOST_SHOWN)
