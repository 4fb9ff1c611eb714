"""What the columns of a table mean together: ratios, transitions, and messages about them."""

from collections.abc import Iterable, Mapping
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.cells import NUMBER, Cells
from ridgebayes.fea.column_units import (
    DIMENSIONS,
    Quantity,
    column_unit,
    divided,
    everywhere_or_nowhere,
)
from ridgebayes.fea.mapping import CORNERS, LOADS, LOWERS, Use
from ridgebayes.fea.transitions import STATUS_RULE, touching, transitions_of_runs
from ridgebayes.scene.units import to_si
from ridgebayes.table.columns import NAMES, OK
from ridgebayes.table.rules import as_text

_ABOVE_0 = ("a", "b", "R", "E", "p", "line")
_SHOWN = 8  # names that a line lists


# Rows of the table, their lines in the file where it has lines, and messages.
Rows = tuple[pd.DataFrame, IntArray | None, list[str]]


class ColumnInterpreter:
    """Columns that are understood, and what follows from them."""

    def __init__(
        self, cells: Cells, uses: list[Use], values: Mapping[str, str | float], *, is_history: bool
    ) -> None:
        self.cells, self.where = cells, cells.source.where
        self._uses, self._values = uses, values
        self._by_key = {(use.key, use.Q): use for use in uses}
        self._is_history = is_history
        self.used: dict[Use, None] = {}
        self._dimensional: dict[str, Quantity] = {}
        self.messages: list[str] = []
        self._used_values: set[str] = set()

    def long(self) -> Rows:
        """Return the rows of a table with one transition each, and the columns of its own."""
        found = self._curve()
        found["Q"] = self._required("Q", self._first("Q"))
        found |= {"p_over_E": self._load(None), **self._optional(None)}
        found |= self._texts("kind", "role", "status")
        left = self._left()
        own = [name for name in left if name not in NAMES]
        clash = [name for name in left if name in NAMES]
        frame = self._framed(found)
        self._summarize()
        messages = [f"column {name!r} ignored: the mapping uses another column" for name in clash]
        if own:
            messages.append(f"kept as they are: {listed(own)}")
        return frame.assign(**{n: self.cells.frame[n] for n in own}), self.cells.lines, messages

    def wide(self) -> Rows:
        """Return the rows of a table with one column for each Q."""
        per_Q = [use for use in self._uses if use.Q is not None]
        loads = sorted(use.Q for use in per_Q if use.Q is not None and use.key in LOADS)
        single = [use for use in self._uses if use.Q is None and use.key in (*LOADS, "Q")]
        if single or not loads:
            what = f"column {single[0].header!r}" if single else "no load"
            raise self._error(
                f"{what} beside columns for each Q ({listed(u.header for u in per_Q)}"
                "); expected a load for each Q, or columns Q and load"
            )
        common = self._curve() | self._texts("kind", "role", "status")
        n = len(self.cells.frame)
        parts = [{"p_over_E": self._load(Q), **self._optional(Q)} for Q in loads]
        for use in per_Q:
            if use.Q not in loads:
                raise self._error(f"column {use.header!r}: no load of Q = {use.Q}; expected one")
        # By row of the file, and along it by Q.
        table = {
            key: np.column_stack([np.broadcast_to(part.get(key, np.nan), n) for part in parts])
            for key in dict.fromkeys(key for part in parts for key in part)
        }
        row, which = np.nonzero(~np.isnan(table["p_over_E"]))
        if not row.size:
            raise self._error("no load in any column; expected a load in some cell")
        self._summarize()
        messages = self._unused()
        if empty := n * len(loads) - row.size:
            messages.append(f"{empty} empty cells: not reached")
        lines = self.cells.lines
        frame = self._framed(common).iloc[row].reset_index(drop=True)
        frame = frame.assign(Q=np.array(loads, dtype=float)[which])
        frame = frame.assign(**{key: numbers[row, which] for key, numbers in table.items()})
        return frame, None if lines is None else lines[row], messages

    def history(self, corners: list[Use], *, brackets: bool) -> Rows:
        """Return the transitions of tables whose rows are increments of runs."""
        for use in self._uses:
            wrong = use.Q is not None and use.key not in CORNERS
            if use.how == "mapped" and (wrong or use.key in ("Q", "kind", "rel_se", *LOWERS)):
                raise self._error(
                    f"column {use.header!r} as {use.key} beside {corners[0].header!r}; expected a "
                    "load of each increment, and columns of corners"
                )
        curve = self._curve() | self._texts("role")
        load = self._load(None)
        corners = sorted(corners, key=lambda use: use.Q or 0)
        gaps = np.column_stack([self._gap(use) for use in corners])
        keep = np.ones(len(self.cells.frame), dtype=bool)
        ignored = []
        if status := self._use("status", None):
            keep = as_text(self.cells.frame[status.header]).isin(["", OK]).to_numpy(bool)
            self.used[status] = None
            if n := int((~keep).sum()):
                ignored.append(f"{n} increments ignored: their status is not 'ok'")
            if not keep.any():
                raise self._error("no increment whose status is 'ok'")
        self._summarize()
        # In a run the empty cells of a column are its default; NaN would tell rows apart.
        frame, Q = self._framed(curve)[keep].reset_index(drop=True), [use.Q or 0 for use in corners]
        try:
            rows, remarks = transitions_of_runs(
                frame, load[keep], gaps[keep], np.array(Q), brackets=brackets
            )
        except InputError as error:
            raise self._error(str(error)) from None
        return rows, None, [*self._unused(), *ignored, *remarks]

    def _curve(self) -> dict[str, Any]:
        """Return what is constant along a curve."""
        numbers = {
            **{f"{key}_over_R": self._required(f"{key}_over_R", self._over_R(key)) for key in "ab"},
            "offset_over_R": self._over_R("offset"),
            "nu": self._first("nu"),
        }
        found: dict[str, Any] = {k: value for k, value in numbers.items() if value is not None}
        return found | self._texts("texture", "series", "solver", "source")

    def _optional(self, Q: int | None) -> dict[str, FloatArray]:
        found = {"p_over_E_lower": self._load_of(LOWERS, Q), "rel_se": self._first("rel_se", Q=Q)}
        return {key: value for key, value in found.items() if value is not None}

    def _framed(self, found: Mapping[str, Any]) -> pd.DataFrame:
        n = len(self.cells.frame)
        shaped = {
            key: np.broadcast_to(value, n) if isinstance(value, np.ndarray) else value
            for key, value in found.items()
        }
        return pd.DataFrame(shaped, index=pd.RangeIndex(n))

    def _use(self, key: str, Q: int | None) -> Use | None:
        """Return the column of a key: for each Q, or else the one for all."""
        return self._by_key.get((key, Q)) or self._by_key.get((key, None))

    def _quantity(self, key: str, Q: int | None = None) -> Quantity | None:
        """Return a column or constant; None where there is none."""
        use = self._use(key, Q)
        if use is None or (use.Q is None and Q is not None and key in (*LOADS, *LOWERS)):
            found = self._constant(key)
        else:
            found = self._column(key, use)
        if found is not None and key in DIMENSIONS:
            self._dimensional[found.name] = found
        return found

    def _column(self, key: str, use: Use) -> Quantity:
        unit, factor = column_unit(key, use.header, use.unit, self.where)
        numbers = self.cells.frame[use.header].to_numpy(dtype=float)
        if use not in self.used:
            self.used[use] = None
            self._check(use, numbers)
            how = ", a guess" if use.how == "guessed" else ""
            in_unit = f" in {unit}" if unit else ", no unit" if key in DIMENSIONS else ""
            if use.name != use.header or key in DIMENSIONS or unit or how:
                self.messages.append(f"{use.name}: column {use.header!r}{in_unit}{how}")
        return Quantity(f"{key} ({use.header!r})", numbers, unit, factor)

    def _check(self, use: Use, numbers: FloatArray) -> None:
        # Increments of a run may have no load yet.
        may_be_0 = self._is_history and use.key in ("p", "line")
        rules = (
            ("not empty", use.key in ("a", "b", "R", "E"), np.isnan(numbers)),
            ("above 0", use.key in _ABOVE_0 and not may_be_0, numbers <= 0),
            ("0 or above", use.key in LOWERS, numbers < 0),
            ("0 where open, above 0 where closed", use.key == "pressure", numbers < 0),
        )
        self.cells.check(
            *((bad, use.header, f"expected {r}") for r, applies, bad in rules if applies)
        )

    def _constant(self, key: str) -> Quantity | None:
        if key not in self._values:
            return None
        text = str(self._values[key]).strip()
        if (plain := NUMBER.fullmatch(text)) is None:
            if key not in DIMENSIONS:
                raise self._error(f"value {key} = {text!r}: expected a number")
            try:
                to_si(text, DIMENSIONS[key])
            except InputError as error:
                raise self._error(f"value {key} = {error}") from None
        digits = plain or NUMBER.match(text)
        assert digits is not None
        number, unit = float(digits.group()), text[digits.end() :].strip()
        if not np.isfinite(number) or (key in _ABOVE_0 and number <= 0):
            rule = "above 0" if key in _ABOVE_0 else "finite"
            raise self._error(f"value {key} = {text!r}: expected {rule}")
        factor = to_si(f"1 {unit}", DIMENSIONS[key]) if unit else Fraction(1)
        if key not in self._used_values:
            self.messages.append(f"{key}: {text}, as given")
        self._used_values.add(key)
        return Quantity(key, np.array(number), unit, factor)

    def _first(self, *ways: str, Q: int | None = None) -> FloatArray | None:
        """Return the first of some quantities that is there, over those that it is divided by."""
        for way in ways:
            key, *under = way.split("/")
            if (found := self._quantity(key, Q)) is not None:
                by = [self._needed(one, key) for one in under]
                return divided(found, *by, by=2 if len(by) == 2 else 1)  # p is line / 2 R
        return None

    def _over_R(self, key: str) -> FloatArray | None:
        return self._first(f"{key}_over_R", f"{key}/R")

    def _load(self, Q: int | None) -> FloatArray:
        return self._required("p_over_E", self._load_of(LOADS, Q))

    def _load_of(self, keys: tuple[str, ...], Q: int | None) -> FloatArray | None:
        ratio, pressure, line = keys
        return self._first(ratio, f"{pressure}/E", f"{line}/R/E", Q=Q)

    def _gap(self, use: Use) -> FloatArray:
        if use.key in ("status", "pressure"):
            self.used[use] = None
            how = ", contact pressure" if use.key == "pressure" else ""
            self.messages.append(f"{use.name}: column {use.header!r}{how}")
        if use.key == "status":
            gap, bad = touching(as_text(self.cells.frame[use.header]))
            self.cells.check((bad, use.header, STATUS_RULE))
            return gap
        if use.key == "pressure":
            numbers = self.cells.frame[use.header].to_numpy(dtype=float)
            self._check(use, numbers)
            return np.where(np.isnan(numbers), np.nan, np.where(numbers > 0, -np.inf, np.inf))
        found = self._quantity(use.key, use.Q)
        assert found is not None
        R = None if use.key == "gap_over_R" else self._quantity("R")
        # Without R: only its zero counts, and how it falls, not its size.
        return divided(found) if R is None else divided(found, R)

    def _texts(self, *keys: str) -> dict[str, Any]:
        """Return columns of text, and constants in place of some."""
        found: dict[str, Any] = {}
        for key in keys:
            if (use := self._use(key, None)) is not None:
                self.used[use] = None
                found[key] = as_text(self.cells.frame[use.header])
                if key != use.header:
                    self.messages.append(f"{key}: column {use.header!r}")
            elif key in self._values:
                self._used_values.add(key)
                found[key] = str(self._values[key])
                self.messages.append(f"{key}: {self._values[key]}, as given")
        return found

    def _needed(self, key: str, by: str) -> Quantity:
        if (found := self._quantity(key)) is not None:
            return found
        raise self._error(f"{by} needs {key}; expected a column, --map '{key}=header', or --{key}")

    def _required(self, key: str, found: FloatArray | None) -> FloatArray:
        if found is not None:
            return found
        ways = {"a_over_R": "a", "b_over_R": "b", "p_over_E": "p, line, load"}.get(key)
        there = ", ".join(map(repr, list(self.cells.frame)[:50]))
        either = f" (or {ways})" if ways else ""
        raise self._error(
            f"no column {key}{either}; the columns are {there}; name it with --map '{key}=header'"
        )

    def _error(self, message: str) -> InputError:
        return InputError(f"{self.where}: {message}")

    def _summarize(self) -> None:
        if plain := [one.key for one in self.used if one.key == one.header and one.key in NAMES]:
            self.messages.insert(0, f"recognised by name: {', '.join(plain)}")
        if everywhere_or_nowhere(self._dimensional.values(), self.where):
            self.messages.append("all units converted")
        elif self._dimensional:
            self.messages.append("no units given; one consistent system assumed")
        loads = [use for use in self.used if use.key == "p_over_E" and use.header != "p_over_E"]
        bare = [use for use in loads if "p_over_E" not in use.header and use.how == "named"]
        if bare and ("E" in self._values or self._use("E", None) is not None):
            raise self._error(
                f"column {bare[0].header!r} has no unit, beside E: p/E, pressure or "
                "line load; name it, as --map 'p_over_E=Q=*', 'p=Q=*;kPa' or 'line=Q=*;N/mm'"
            )

        if given := set(self._values) - self._used_values:
            self.messages.append(f"values given but not used: {', '.join(sorted(given))}")

    def _left(self) -> list[str]:
        """Return the columns that are nothing of the contract."""
        used = {use.header for use in self.used}
        return [name for name in map(str, self.cells.frame) if name not in used]

    def _unused(self) -> list[str]:
        left = self._left()
        return [f"not used: {listed(left)}"] if left else []


def listed(names: Iterable[str]) -> str:
    """Return names in quotes, the first of them."""
    names = list(names)
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return ", ".join(repr(name) for name in names[:_SHOWN]) + more
