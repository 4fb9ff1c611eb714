"""Conversion of columns and constants of a table to SI units and dimensionless rows."""

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.mapping import ABOVE_0, LOADS, SDS, Use
from ridgebayes.fea.record import FileError, Given
from ridgebayes.fea.words import (
    COUNTS,
    DIMENSIONS,
    column_unit,
    divided,
    is_error,
    key_of,
    number_and_unit,
    split_header,
    unit_factor,
)
from ridgebayes.runtime.text import some_of
from ridgebayes.table.columns import COUNT, NAMES, OK
from ridgebayes.table.columns import SHOWN as MOST_SHOWN
from ridgebayes.table.rules import as_text

_MISSING_CONSTANTS = {  # meaning of the constant, and an example value for messages
    "R": ("radius of the body", "? mm"),
    "E": ("Young's modulus of the body", "? kPa"),
    "thickness": ("length of the body along the ridges, needed for forces", "? mm"),
}
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
    values : mapping of str to str or float
        Constants by key.
    facts : Given
        The user's options.
    problems : FileError
        Collects messages, errors and missing facts.
    """

    def __init__(
        self,
        cells: pd.DataFrame,
        uses: Sequence[Use],
        values: Mapping[str, str | float],
        facts: Given,
        problems: FileError,
    ) -> None:
        self.cells, self.facts, self.problems = cells, facts, problems
        self.messages = problems.messages
        self.uses, self._values = {(use.key, use.Q): use for use in uses}, values
        self.used: dict[Use, None] = {}
        self._used_values: set[str] = set()
        self._units: dict[str, str] = {}  # unit of each quantity, by its name in messages

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
        columns = self.curve()
        columns["Q"] = self._counts(self.quantity("Q"), term)
        load = columns["p_over_E"] = self.load()
        columns |= {"p_over_E_lower": self.load("_lower"), "rel_se": self._rel_se(load)}
        columns["load_se"] = self.load_se()
        columns |= self.texts("kind", "role", "status")
        self.summarize()
        if any(columns[key] is None for key in ("a_over_R", "b_over_R", "Q", "p_over_E")):
            return pd.DataFrame()
        return self.framed(columns)

    def finished(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Return the rows that are transitions, with the user's additional columns."""
        left = self.left()
        extra = [name for name in left if name not in NAMES]
        for name in left:
            if name in NAMES:
                self.messages.append(f"column {name!r} ignored: the mapping uses another column")
        if extra:
            self.messages.append(f"kept as they are: {listed(extra)}")
        if errors := [*filter(is_error, extra)]:
            self.messages.append(
                f"not read as errors of loads: {listed(errors)}; --map 'load_sd=HEADER' takes a "
                "standard deviation, 'load_sem=HEADER' a standard error"
            )
        has_sd = any(use.key in SDS for use in self.used)
        if has_sd and frame.duplicated(["a_over_R", "b_over_R", "Q"]).any():
            self.messages.append(
                "repeats with an sd of their own: sigma is fitted to the scatter of repeats, so an "
                "sd over the same repeats counts it twice"
            )
        for name in extra:
            self._compare_loads(name, frame["p_over_E"])
        frame = frame.assign(**{name: self.cells[name] for name in extra})
        keep = (frame["Q"] >= 4) | ~frame["Q"].isin([0, 2]) | (frame.get("kind", "") == COUNT)
        if n := int((~keep).sum()):
            self.messages.append(f"{n} rows of Q under 4 ignored: that many touch at any load")
        keep &= ~self._empty(frame, extra)
        return frame[keep]

    def curve(self) -> dict[str, Any]:
        """Return the columns that are constant along a curve."""
        a, b = self._over_R("a"), self._over_R("b")
        if b is None and a is not None and (pitch := self._over_R("pitch")) is not None:
            b = np.round(pitch - a, 12)  # removes rounding errors of a difference of decimals
            self.messages.append("b: pitch minus ridge width")
        columns = {"a_over_R": a, "b_over_R": b, "offset_over_R": self._over_R("offset")}
        columns["nu"] = self.quantity("nu")
        return columns | self.texts("texture", "series", "solver", "source")

    def load(self, suffix: str = "") -> FloatArray | None:
        """Return p/E of the loads, whatever their kind; None without a column of loads."""
        for key in LOADS:
            if (numbers := self.quantity(key + suffix)) is not None:
                return self._over_E(key, numbers)
        return None

    def load_se(self) -> FloatArray | None:
        """Return the standard error of the loads over E, or None if the user gives none."""
        if "load_se" not in self._values:
            return None
        text = str(self._values["load_se"]).strip()
        number, unit = number_and_unit(text)
        key = next((key for key in LOADS[1:] if unit_factor(unit, DIMENSIONS[key])), "")
        if not unit and (use := self.load_use()) is not None:  # loads without a unit
            key = use.key
        if not key or not number > 0:
            raise self.problems.error(
                f"--load-se {text!r}: expected a number above 0 and a unit of loads, as '0.05 N'"
            )
        self._tell_value("load_se")
        if key in DIMENSIONS:
            self._units[f"{key} (--load-se)"] = unit
        factor = unit_factor(unit, DIMENSIONS[key]) if unit else None
        return self._over_E(key, np.array(number * float(factor or 1)))

    def load_use(self) -> Use | None:
        """Return the column of loads, or None if there is none or one column per Q."""
        return next((use for key in LOADS if (use := self.uses.get((key, None)))), None)

    def texts(self, *keys: str) -> dict[str, Any]:
        """Return text columns or constants by key."""
        columns: dict[str, Any] = {}
        for key in keys:
            if (use := self.uses.get((key, None))) is not None:
                self.tell(use)
                codes, distinct = pd.factorize(self.cells[use.header], use_na_sentinel=False)
                words = as_text(pd.Series(distinct)).take(codes)  # converts each text once
                columns[key] = words.set_axis(self.cells.index)
            elif key in self._values:
                self._tell_value(key)
                columns[key] = str(self._values[key])
        return columns

    def quantity(self, key: str, Q: int | None = None) -> FloatArray | None:
        """Return a column or constant in SI units, or None if there is none."""
        use = self.uses.get((key, Q)) or self.uses.get((key, None))
        return self._constant(key) if use is None else self._column(use)

    def tell(self, use: Use, what: str = "", *, is_plain: bool = True) -> None:
        """Report that a column is used, unless its header is its key (see `summarize`)."""
        self.used[use] = None
        what += ", guessed from its header" if use.how == "guessed" else ""
        if use.name != use.header or what or not is_plain:
            self.messages.append(f"{use.name}: column {use.header!r}{what}")

    def summarize(self) -> None:
        """Report the columns whose header is their key, and ask for missing units."""
        if plain := [use.key for use in self.used if use.key == use.header and use.key in NAMES]:
            self.messages.append(f"recognised by name: {', '.join(plain)}")
        have = [f"{name} in {unit}" for name, unit in self._units.items() if unit]
        bare = [name for name, unit in self._units.items() if not unit]
        if have and bare:
            self._ask_units(have, bare)
        elif have or bare:
            one_system = "no units given; one consistent system assumed"
            self.messages.append("all units converted" if have else one_system)
        if unused := set(self._values) - self._used_values:
            self.messages.append(f"values given but not used: {', '.join(sorted(unused))}")

    def framed(self, columns: Mapping[str, Any]) -> pd.DataFrame:
        """Return a frame of the columns that are not None."""
        present = {key: value for key, value in columns.items() if value is not None}
        return pd.DataFrame(present, index=self.cells.index)

    def left(self) -> list[str]:
        """Return the headers of columns that are not used."""
        used = {use.header for use in self.used}
        return [name for name in map(str, self.cells) if name not in used]

    def _column(self, use: Use) -> FloatArray:
        key = use.key
        try:
            unit, factor = column_unit(key, use.header, use.unit, self.problems.where)
        except InputError as error:
            last = split_header(use.header)[0].replace("_", " ").split()[-1]
            fits = key in DIMENSIONS and unit_factor(last, DIMENSIONS[key]) is not None
            self.problems.need(str(error), {use.name: f"{use.header};{last if fits else '?'}"})
            unit, factor = None, Fraction(1)
        if use not in self.used:
            self.tell(use, f" in {unit}" if unit else ", no unit" if key in DIMENSIONS else "")
        if unit is not None and key in DIMENSIONS:  # a None was reported above
            self._units[f"{key} ({use.header!r})"] = unit
        numbers = self.cells[use.header].to_numpy(dtype=float)
        return numbers if factor == 1 else divided(numbers * float(factor))

    def _constant(self, key: str) -> FloatArray | None:
        if key not in self._values:
            return None
        text = str(self._values[key]).strip()
        number, unit = number_and_unit(text)
        factor = unit_factor(unit, DIMENSIONS[key]) if unit and key in DIMENSIONS else None
        rule = ""
        if np.isnan(number) or (unit and factor is None):
            rule = f"a number and a unit of {DIMENSIONS[key]}" if key in DIMENSIONS else "a number"
        elif not np.isfinite(number) or (key in ABOVE_0 and number <= 0):
            rule = "above 0" if key in ABOVE_0 else "finite"
        if rule:
            raise self.problems.error(f"value {key} = {text!r}: expected {rule}")
        self._tell_value(key)
        if key in DIMENSIONS:
            self._units[key] = unit
        return np.array(number * float(factor or 1))

    def _tell_value(self, key: str) -> None:
        """Report once that a constant is used."""
        if key not in self._used_values:
            self.messages.append(f"{key}: {str(self._values[key]).strip()}, as given")
        self._used_values.add(key)

    def _over_R(self, key: str) -> FloatArray | None:
        ratio = self.quantity(f"{key}_over_R")
        if ratio is not None or (length := self.quantity(key)) is None:
            return ratio
        return divided(length, self._needed("R"))

    def _over_E(self, key: str, loads: FloatArray) -> FloatArray:
        by = [self._needed(name) for name in _LOAD_DIVISORS[key]]
        return divided(loads / 2 if len(by) > 1 else loads, *by) if by else loads

    def _needed(self, key: str) -> FloatArray:
        if (numbers := self.quantity(key)) is not None:
            return numbers
        if key == "R" and (numbers := self.quantity("D")) is not None:
            return numbers / 2
        why, example = _MISSING_CONSTANTS[key]
        self._units[key] = example.split()[1]  # the unit in the user's answer
        ways = f"expected --{key} '{example}', or a column, --map '{key}=HEADER'"
        self.problems.need(f"{key} is missing ({why}): {ways}", None, **{key: example})
        return np.array(1.0)  # a placeholder, so that all other errors are found, too

    def _rel_se(self, load: FloatArray | None) -> FloatArray | None:
        """Return the relative standard error of loads, from the columns of errors and sds."""
        rel_se, se, n = self.quantity("rel_se"), self.load("_sem"), self.uses.get(("n_mean", None))
        if se is None and (se := self.load("_sd")) is not None and n is not None:
            se = se / np.sqrt(self.cells[n.header].to_numpy(dtype=float))
            self.tell(n, ", how many loads the mean is of: its error is sd over their root")
        if se is None or load is None:
            return rel_se
        return divided(se, load) if rel_se is None else np.hypot(rel_se, divided(se, load))

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
        if not empty.any():
            return empty
        if not self.facts.skip_empty:
            use = self.load_use()
            rule = "expected a load; --skip-empty leaves out rows without one"
            if use is not None and use.header in self.cells:
                self.problems.cells(frame.index[empty], use.header, rule)
            self.problems.options.setdefault("skip_empty", "yes")
            return empty & False
        texts = [name for name in extra if frame[name].dtype.kind not in "if"]
        why = frame.loc[empty, texts].astype(str).agg(" ".join, axis=1).str.strip()
        reasons = listed(why.mask(why == "", "no reason given").unique(), "")
        self.messages.append(f"{int(empty.sum())} rows without a load left out: {reasons}")
        return empty

    def _compare_loads(self, name: str, p_over_E: "pd.Series[float]") -> None:
        """Report the ratio of an unused column of loads to the loads that are read."""
        words, unit = split_header(name)
        for key in LOADS[1:]:
            factor = unit_factor(unit, DIMENSIONS[key])
            is_load = factor is not None and key_of(words) in (key, "load")
            if is_load and all(self.quantity(by) is not None for by in _LOAD_DIVISORS[key]):
                others = pd.to_numeric(self.cells[name], errors="coerce").to_numpy(dtype=float)
                ratio = np.nanmedian(self._over_E(key, others * float(factor or 1)) / p_over_E)
                self.messages.append(
                    f"column {name!r} is not read: its loads are {ratio:.3g} times those that are"
                )

    def _ask_units(self, have: list[str], bare: list[str]) -> None:
        """Ask for missing units, and propose the unit of another quantity of the same dimension."""
        units = {DIMENSIONS[name.split(" ")[0]]: unit for name, unit in self._units.items() if unit}
        mapping, options = {}, {}
        for name in bare:
            key = name.split(" ")[0]
            unit = units.get(DIMENSIONS[key], "?")
            option = "load_se" if name.endswith("(--load-se)") else key
            if option in self._values:
                options[option] = f"{self._values[option]} {unit}"
            elif (use := self.uses.get((key, None))) is not None:
                mapping[key] = f"{use.header};{unit}"
        self.problems.need(
            f"{self.problems.where}: {', '.join(have)}, but {', '.join(bare)} without a "
            "unit; expected units on all columns and values that have dimensions, or on none",
            mapping,
            **options,
        )


def with_load_se(frame: pd.DataFrame, p_se: FloatArray | None) -> pd.DataFrame:
    """Return rows with the load cell's error `p_se` (over E) added to rel_se in quadrature."""
    if p_se is None:
        return frame
    rel_se = frame["rel_se"].fillna(0.0) if "rel_se" in frame else 0.0
    return frame.assign(rel_se=np.hypot(rel_se, p_se / frame["p_over_E"].to_numpy()))


def listed(names: Iterable[str], quote: str = "'") -> str:
    """Return the first names in quotes, separated by commas."""
    return some_of((repr(name) if quote else name for name in names), MOST_SHOWN)
