"""Meaning of the columns of a table together: what is missing, ratios, transitions."""

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.errors import InputError
from ridgebayes.fea.mapping import CORNERS, LOADS, LOWERS, Use, as_load
from ridgebayes.fea.quantities import Quantities
from ridgebayes.fea.record import FileError
from ridgebayes.fea.transitions import (
    counts_repeat,
    last_digit,
    middle_loads,
    transitions_of_runs,
)
from ridgebayes.fea.words import (
    COUNTS,
    DIMENSIONS,
    NUMBER,
    STATUS_RULE,
    divided,
    split_header,
    touching,
    unit_factor,
)
from ridgebayes.runtime.text import some_of
from ridgebayes.table.columns import COUNT, NAMES, OK
from ridgebayes.table.rules import as_text

# Columns of increments that are nothing of a texture.
_COUNTER = re.compile(r"\b(?:inc|increment|inkrement|time|zeit|step|schritt|nr|no|id|index)\b|^#")
_WAYS = {  # what a message names, and the keys that give the same
    "a": ("a_over_R (or a)", ("a", "a_over_R")),
    "b": ("b_over_R (or b, pitch)", ("b", "b_over_R", "pitch")),
    "Q": ("Q", ("Q",)),
    "load": ("p_over_E (or p, line, force, load)", (*LOADS, "load")),
}


def ask_columns(
    cells: pd.DataFrame, uses: list[Use], values: Mapping[str, object], problems: FileError
) -> list[Use]:
    """Return the uses with the likeliest column for what is missing, and note what is.

    Parameters
    ----------
    cells : DataFrame
        All of the table; the columns that are taken become numbers.
    uses : list of Use
        Recognised columns.
    values : mapping of str to object
        Constants by key.
    problems : FileError
        Where it is noted what the user has to name.
    """
    given = {use.key for use in uses} | set(values)
    per_Q = [use for use in uses if use.Q is not None]
    is_history = any(use.key in CORNERS for use in per_Q)
    uses = [*uses]
    for key, (words, ways) in _WAYS.items():
        is_there = bool(per_Q) and (key == "Q" or (key == "load" and not is_history))
        if is_there or given.intersection(ways):
            continue
        problems.columns = ", ".join(map(repr, list(cells)[:50]))
        text = f"no column {words}; name it with --map '{key}=HEADER'"
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
    return None if best is None or fits(best) < (key == "Q") else best


def _as_numbers(cells: "pd.Series[Any]") -> FloatArray:
    """Return the numbers of a column, with points or commas for decimals; none if some are not."""
    if cells.dtype.kind not in "if":
        cells = pd.to_numeric(cells.astype(str).str.replace(",", "."), errors="coerce")
        if cells.isna().any():
            return np.array([])
    return cells.to_numpy(float)


_SHOWN = 8  # names that a line lists


class ColumnInterpreter(Quantities):
    """Columns that are understood, and what follows from them."""

    def long(self, term: str | None) -> pd.DataFrame:
        """Return the rows of a table with one transition or increment each, and its own columns.

        Parameters
        ----------
        term : str or None
            Things counted, as `ridgebayes.fea.mapping.assign` returns it.
        """
        found = self._curve()
        found["Q"] = self._counts(self._first("Q"), term)
        found["p_over_E"] = self._load()
        found |= {"p_over_E_lower": self._load("_lower"), "rel_se": self._rel_se()}
        self._load_se()
        found |= self._texts("kind", "role", "status")
        left = self._left()
        own = [name for name in left if name not in NAMES]
        self._summarize()
        if any(found[key] is None for key in ("a_over_R", "b_over_R", "Q", "p_over_E")):
            return pd.DataFrame()
        frame = self._framed(found)
        if "kind" not in found and "status" not in found and counts_repeat(frame):
            return self._transitions(frame)
        for name in left:
            if name in NAMES:
                self.messages.append(f"column {name!r} ignored: the mapping uses another column")
        if own:
            self.messages.append(f"kept as they are: {listed(own)}")
        frame = frame.assign(**{n: self.cells[n] for n in own})
        frame = self._with_load_se(frame)
        keep = (frame["Q"] >= 4) | ~frame["Q"].isin([0, 2]) | (frame.get("kind", "") == COUNT)
        if n := int((~keep).sum()):
            self.messages.append(f"{n} rows of Q under 4 ignored: that many touch at any load")
        keep &= ~self._empty(frame, own)
        self.rows = frame.index[keep]
        return frame[keep].reset_index(drop=True)

    def history(self, corners: list[Use]) -> pd.DataFrame:
        """Return the transitions of tables whose rows are increments of runs."""
        for use in self._uses:
            wrong = use.Q is not None and use.key not in CORNERS
            if use.how == "mapped" and (wrong or use.key in ("Q", "kind", "rel_se", *LOWERS)):
                raise self._problems.error(
                    f"column {use.header!r} as {use.key} beside {corners[0].header!r}; expected a "
                    "load of each increment, and columns of corners"
                )
        curve = self._curve() | self._texts("role")
        load = self._load()
        self._load_se()
        corners = sorted(corners, key=lambda use: use.Q or 0)
        gaps = np.column_stack([self._gap(use) for use in corners])
        digits = last_digit(gaps) / 2  # a gap is printed as it is, and so rounded once
        keep = np.ones(len(self.cells), dtype=bool)
        ignored = []
        if status := self._use("status", None):
            keep = as_text(self.cells[status.header]).isin(["", OK]).to_numpy(bool)
            self.used[status] = None
            if n := int((~keep).sum()):
                ignored.append(f"{n} increments ignored: their status is not 'ok'")
            if not keep.any():
                raise self._problems.error("no increment whose status is 'ok'")
        self._summarize()
        if load is None or self._problems:
            return pd.DataFrame()
        # In a run the empty cells of a column are its default; NaN would tell rows apart.
        frame, Q = self._framed(curve)[keep].reset_index(drop=True), [use.Q or 0 for use in corners]
        return self._of_runs(frame, load[keep], gaps[keep], np.array(Q), ignored, digits)

    def _of_runs(
        self,
        frame: pd.DataFrame,
        load: FloatArray,
        gaps: FloatArray,
        Q: IntArray,
        said: list[str],
        digits: float = 0.0,
    ) -> pd.DataFrame:
        try:
            rows, remarks = transitions_of_runs(
                frame, load, gaps, Q, brackets=self._how.brackets, digits=digits
            )
        except InputError as error:
            raise self._problems.error(str(error)) from None
        if left := self._left():
            self.messages.append(f"not used: {listed(left)}")
        self.messages += [*said, *remarks]
        if self._how.interpolate:
            rows, n = middle_loads(rows)
            self.messages.append(f"{n} loads in the middle of their increments")
        return self._with_load_se(rows)

    def _empty(self, frame: pd.DataFrame, own: list[str]) -> "pd.Series[bool]":
        """Return which rows have no load and are left out; refuse them without `--skip-empty`."""
        status = frame["status"] if "status" in frame else pd.Series(OK, index=frame.index)
        empty = frame["p_over_E"].isna() & status.isin(["", OK])
        empty &= ~frame.index.isin(list(self._problems.broken_rows()))
        if not empty.any():
            return empty & False
        if not self._how.skip_empty:
            use = next((one for key in LOADS if (one := self._use(key, None))), None)
            rule = "expected a load; --skip-empty leaves out rows without one"
            if use is not None and use.header in self.cells:
                self._problems.cells(frame.index[empty], use.header, rule)
            self._problems.options.setdefault("skip_empty", "yes")
            return empty & False
        texts = [name for name in own if frame[name].dtype.kind not in "if"]
        why = frame.loc[empty, texts].astype(str).agg(" ".join, axis=1).str.strip()
        said = some_of([one or "no reason given" for one in dict.fromkeys(why)], _SHOWN)
        self.messages.append(f"{int(empty.sum())} rows without a load left out: {said}")
        return empty

    def _rel_se(self) -> FloatArray | None:
        """Return the relative error of loads: as a column, or a deviation over its mean."""
        own, sd = self._first("rel_se"), self._use("load_sd", None)
        mean = next((one for key in LOADS if (one := self._use(key, None))), None)
        if sd is None or mean is None:
            return own
        factors = []
        for use in (sd, mean):
            unit = use.own_unit or mean.own_unit
            dimension = DIMENSIONS.get(mean.key)
            factor = unit_factor(unit, dimension) if dimension and unit not in ("", "1") else None
            factors.append(float(factor or 1))
        ratio = divided(self.cells[sd.header].to_numpy(dtype=float) * factors[0])
        ratio = ratio / (self.cells[mean.header].to_numpy(dtype=float) * factors[1])
        what = "standard deviation of the load"
        if (n := self._use("n_mean", None)) is not None:
            ratio = ratio / np.sqrt(self.cells[n.header].to_numpy(dtype=float))
            self._tell(n, ", how many loads the mean is of", is_plain=False)
            what = "standard deviation of the load, over the root of their number: its error"
        self._tell(sd, f", {what}", is_plain=False)
        return ratio if own is None else np.hypot(own, ratio)

    def _load_se(self) -> None:
        """Find the standard error of every load, as p/E, where the user gives one."""
        if "load_se" not in self._values:
            return
        text = str(self._values["load_se"]).strip()
        match = NUMBER.match(text)
        unit = "" if match is None else text[match.end() :].strip()
        of_loads = next((one for key in LOADS if (one := self._use(key, None))), None)
        key = next((key for key in LOADS[1:] if unit_factor(unit, DIMENSIONS[key])), "")
        if not unit and of_loads is not None:  # as the loads: both without a unit
            key = of_loads.key
        if match is None or not key or not float(match.group()) > 0:
            raise self._problems.error(
                f"--load-se {text!r}: expected a number above 0 and a unit of loads, as '0.05 N'"
            )
        self._tell_value("load_se")
        if key in DIMENSIONS:
            self._units[f"{key} (--load-se)"] = unit
        factor = unit_factor(unit, DIMENSIONS[key]) if unit else None
        size = np.array(float(match.group()) * float(factor or 1))
        names = {"p_over_E": (), "p": ("E",), "line": ("R", "E"), "force": ("thickness", "R", "E")}
        by = [self._needed(one) for one in names[key]]
        self._p_se = divided(size / 2 if len(by) > 1 else size, *by) if by else size

    def _with_load_se(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Return rows with the load cell's error in rel_se, in quadrature."""
        if self._p_se is None:
            return frame
        p_se = self._p_se
        if p_se.size not in (1, len(frame)):  # increments became transitions
            if len(np.unique(p_se)) > 1:
                raise self._problems.error("--load-se: expected one R and E in all increments")
            p_se = p_se.ravel()[:1]
        own = frame["rel_se"].fillna(0.0) if "rel_se" in frame else 0.0
        return frame.assign(rel_se=np.hypot(own, p_se / frame["p_over_E"].to_numpy()))

    def _counts(self, counts: FloatArray | None, term: str | None) -> FloatArray | None:
        """Return Q of counts, whatever they are of."""
        if counts is None:
            return None
        whole = counts[~np.isnan(counts)]
        asked = self._how.count_is
        if asked is None and term == "":
            likely = "per-side" if (whole % 2 == 1).any() else "edges"
            self._problems.need(
                "counts: the header does not say what is counted; expected --count-is edges, "
                "ridges, segments or per-side (edges on one side of the body)",
                count_is=likely,
            )
        term = asked or term
        if term:
            self.messages.append(f"counts of {term}: {COUNTS[term]}")
        return 2 * counts if term == "per-side" else counts

    def _transitions(self, frame: pd.DataFrame) -> pd.DataFrame:
        """Return the transitions of increments with a count each."""
        Q, load = frame["Q"].to_numpy(), frame["p_over_E"].to_numpy()
        levels = np.arange(4, int(np.nanmax(Q)) + 1, 2)
        gaps = np.where(Q[:, None] >= levels, -np.inf, np.inf)
        gaps[np.isnan(Q)] = np.nan
        curve = frame.drop(columns=["Q", "p_over_E", "p_over_E_lower", "rel_se"], errors="ignore")
        how = "loads" if self._how.interpolate else "brackets (--interpolate gives loads)"
        said = f"counts repeat while loads rise: {len(frame)} increments of runs, taken as {how}"
        if self._problems:
            return pd.DataFrame()
        return self._of_runs(curve, load, gaps, levels, [said])

    def _curve(self) -> dict[str, Any]:
        """Return what is constant along a curve."""
        found: dict[str, Any] = {"a_over_R": self._over_R("a")}
        b = self._over_R("b")
        if b is None and found["a_over_R"] is not None:
            pitch = self._over_R("pitch")
            # Twelve decimals: a difference of decimals is one.
            b = None if pitch is None else np.round(pitch - found["a_over_R"], 12)
            self.messages += [] if b is None else ["b: pitch minus ridge width"]
        found["b_over_R"] = b
        found |= {"offset_over_R": self._over_R("offset"), "nu": self._first("nu")}
        return found | self._texts("texture", "series", "solver", "source")

    def _over_R(self, key: str) -> FloatArray | None:
        return self._first(f"{key}_over_R", f"{key}/R")

    def _load(self, lower: str = "") -> FloatArray | None:
        ratio, pressure, line, force = (f"{key}{lower}" for key in LOADS)
        return self._first(ratio, f"{pressure}/E", f"{line}/R/E", f"{force}/thickness/R/E")

    def _gap(self, use: Use) -> FloatArray:
        if use.key in ("status", "pressure"):
            what = ", contact pressure" if use.key == "pressure" else ""
            self._tell(use, what, is_plain=False)
        if use.key == "status":
            gap, bad = touching(as_text(self.cells[use.header]), self._how.closed_is)
            self._problems.cells(self.cells.index[bad], use.header, STATUS_RULE)
            if bad.any():
                self._problems.options.setdefault("closed_is", "?")
            return gap
        if use.key == "pressure":
            numbers = self.cells[use.header].to_numpy(dtype=float)
            return np.where(np.isnan(numbers), np.nan, np.where(numbers > 0, -np.inf, np.inf))
        found = self._quantity(use.key, use.Q)
        assert found is not None
        R = None if use.key == "gap_over_R" else self._quantity("R")
        # Without R: only its zero counts, and how it falls, not its size.
        return found if R is None else divided(found, R)


def listed(names: Iterable[str]) -> str:
    """Return names in quotes, the first of them."""
    return some_of(map(repr, names), _SHOWN)
