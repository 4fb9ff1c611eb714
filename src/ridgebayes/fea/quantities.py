"""Columns and constants of a table in SI units, and what is said about them."""

from collections.abc import Mapping
from fractions import Fraction
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.given import Given
from ridgebayes.fea.mapping import Use
from ridgebayes.fea.record import FileError
from ridgebayes.fea.words import (
    DIMENSIONS,
    NUMBER,
    column_unit,
    divided,
    split_header,
    unit_factor,
)
from ridgebayes.table.columns import NAMES
from ridgebayes.table.rules import as_text

ABOVE_0 = ("a", "b", "pitch", "R", "D", "E", "thickness", "p", "line", "force")
_NEEDED = {  # what it is for, and an example
    "R": ("radius of the body", "? mm"),
    "E": ("Young's modulus of the body", "? kPa"),
    "thickness": ("length of the body along the ridges, needed for forces", "? mm"),
}


class Quantities:
    """Columns that are understood, constants, and their units: all have one, or none has."""

    def __init__(
        self,
        cells: pd.DataFrame,
        uses: list[Use],
        values: Mapping[str, str | float],
        how: Given,
        problems: FileError,
    ) -> None:
        self.cells, self.where = cells, problems.where
        self.rows: pd.Index[int] | None = None  # of the file, that are the table's
        self._uses, self._values, self._how, self._problems = uses, values, how, problems
        self._by_key = {(use.key, use.Q): use for use in uses}
        self.used: dict[Use, None] = {}
        self._units: dict[str, str] = {}  # of what has a dimension, by its name in messages
        self.messages, self._begun = problems.messages, len(problems.messages)
        self._used_values: set[str] = set()
        self._p_se: FloatArray | None = None  # of every load, over E

    def _framed(self, found: Mapping[str, Any]) -> pd.DataFrame:
        there = {key: value for key, value in found.items() if value is not None}
        return pd.DataFrame(there, index=self.cells.index)

    def _use(self, key: str, Q: int | None) -> Use | None:
        """Return the column of a key: for each Q, or else the one for all."""
        return self._by_key.get((key, Q)) or self._by_key.get((key, None))

    def _quantity(self, key: str, Q: int | None = None) -> FloatArray | None:
        """Return a column or constant in SI units; None where there is none."""
        use = self._use(key, Q)
        return self._constant(key) if use is None else self._column(key, use)

    def _column(self, key: str, use: Use) -> FloatArray:
        try:
            unit, factor = column_unit(key, use.header, use.unit, self.where)
        except InputError as error:
            last = split_header(use.header)[0].replace("_", " ").split()[-1]
            fits = key in DIMENSIONS and unit_factor(last, DIMENSIONS[key]) is not None
            name = f"{key} Q={use.Q}" if use.Q is not None else key
            self._problems.need(str(error), {name: f"{use.header};{last if fits else '?'}"})
            unit, factor = None, Fraction(1)
        numbers = self.cells[use.header].to_numpy(dtype=float)
        if use not in self.used:
            in_unit = f" in {unit}" if unit else ", no unit" if key in DIMENSIONS else ""
            self._tell(use, in_unit)
        if unit is not None and key in DIMENSIONS:  # else told above, and not to be told again
            self._units[f"{key} ({use.header!r})"] = unit
        return numbers if factor == 1 else divided(numbers * float(factor))

    def _constant(self, key: str) -> FloatArray | None:
        if key not in self._values:
            return None
        text = str(self._values[key]).strip()
        match = NUMBER.match(text)
        unit = "" if match is None else text[match.end() :].strip()
        factor = unit_factor(unit, DIMENSIONS[key]) if unit and key in DIMENSIONS else None
        if match is None or (unit and factor is None):
            what = f"a number and a unit of {DIMENSIONS[key]}" if key in DIMENSIONS else "a number"
            raise self._problems.error(f"value {key} = {text!r}: expected {what}")
        number = float(match.group())
        if not np.isfinite(number) or (key in ABOVE_0 and number <= 0):
            rule = "above 0" if key in ABOVE_0 else "finite"
            raise self._problems.error(f"value {key} = {text!r}: expected {rule}")
        self._tell_value(key)
        if key in DIMENSIONS:
            self._units[key] = unit
        return np.array(number * float(factor or 1))

    def _tell(self, use: Use, what: str = "", *, is_plain: bool = True) -> None:
        """Say which column is used, but of a plain one by its own name, which `_summarize` does."""
        self.used[use] = None
        what += ", guessed from its header" if use.how == "guessed" else ""
        if use.name != use.header or what or not is_plain:
            self.messages.append(f"{use.name}: column {use.header!r}{what}")

    def _tell_value(self, key: str) -> None:
        """Say once that a constant is used."""
        if key not in self._used_values:
            self.messages.append(f"{key}: {str(self._values[key]).strip()}, as given")
        self._used_values.add(key)

    def _first(self, *ways: str) -> FloatArray | None:
        """Return the first of some quantities that is there, over those that it is divided by."""
        for way in ways:
            key, *under = way.split("/")
            if (found := self._quantity(key)) is not None:
                by = [self._needed(one) for one in under]
                # Only loads are over two: p is line / 2 R.
                return divided(found / 2 if len(by) > 1 else found, *by) if by else found
        return None

    def _texts(self, *keys: str) -> dict[str, Any]:
        """Return columns of text, and constants in place of some."""
        found: dict[str, Any] = {}
        for key in keys:
            if (use := self._use(key, None)) is not None:
                self._tell(use)
                codes, distinct = pd.factorize(self.cells[use.header], use_na_sentinel=False)
                words = as_text(pd.Series(distinct)).take(codes)  # each text once
                found[key] = words.set_axis(self.cells.index)
            elif key in self._values:
                self._tell_value(key)
                found[key] = str(self._values[key])
        return found

    def _needed(self, key: str) -> FloatArray:
        if (found := self._quantity(key)) is not None:
            return found
        if key == "R" and (found := self._quantity("D")) is not None:
            return found / 2
        why, example = _NEEDED[key]
        self._units[key] = example.split()[1]  # as the user is asked for it
        ways = f"expected --{key} '{example}', or a column, --map '{key}=HEADER'"
        self._problems.need(f"{key} is missing ({why}): {ways}", None, **{key: example})
        # Loads rise or do not, whatever it is.
        return np.array(1.0)

    def _summarize(self) -> None:
        if plain := [one.key for one in self.used if one.key == one.header and one.key in NAMES]:
            self.messages.insert(self._begun, f"recognised by name: {', '.join(plain)}")
        have = [f"{name} in {unit}" for name, unit in self._units.items() if unit]
        bare = [name for name, unit in self._units.items() if not unit]
        if have and bare:
            self._ask_units(have, bare)
        elif have or bare:
            one_system = "no units given; one consistent system assumed"
            self.messages.append("all units converted" if have else one_system)
        if given := set(self._values) - self._used_values:
            self.messages.append(f"values given but not used: {', '.join(sorted(given))}")

    def _ask_units(self, have: list[str], bare: list[str]) -> None:
        """Ask for units, with those of the same dimension as a first guess."""
        units = {DIMENSIONS[name.split(" ")[0]]: one for name, one in self._units.items() if one}
        mapping, options = {}, {}
        for name in bare:
            key = name.split(" ")[0]
            unit = units.get(DIMENSIONS[key], "?")
            if name.endswith("(--load-se)"):
                options["load_se"] = f"{self._values['load_se']} {unit}"
            elif key in self._values:
                options[key] = f"{self._values[key]} {unit}"
            elif (use := self._by_key.get((key, None))) is not None:
                mapping[key] = f"{use.header};{unit}"
        self._problems.need(
            f"{self.where}: {', '.join(have)}, but {', '.join(bare)} without a "
            "unit; expected units on all columns and values that have dimensions, or on none",
            mapping,
            **options,
        )

    def _left(self) -> list[str]:
        """Return the columns that are nothing of the contract."""
        used = {use.header for use in self.used}
        return [name for name in map(str, self.cells) if name not in used]
