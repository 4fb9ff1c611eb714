"""Contact tables as strangers bring them, each with the truth that it was made from.

Every table goes through a file, as a user's does: it is written as text and read back under the
rules of the contract, or imported. `python -m tests.tables_in_the_wild [-o DIR]` writes them.
"""

import argparse
import functools
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

import ridgebayes as rb
from ridgebayes.model.forms import Form

FORMS: dict[str, tuple[Form, tuple[float, ...]]] = {
    "hybrid": (rb.Hybrid(), (1.348, 0.01583)),
    "modified": (rb.Modified(), (1.38,)),
    "classic": (rb.Classic(), (1.382,)),
}
PERCENT = 0.01


@dataclass(frozen=True)
class WildTable:
    """A table and where it comes from.

    Parameters
    ----------
    name : str
        Of the file, without suffix.
    table : ContactTable
        As read.
    form : str
        Form that made its loads.
    coefficients : tuple of float
        The form's.
    errors : mapping of str to float
        Standard deviations of log loads, by the error model's parameter.
    note : str
        What is special about it.
    """

    name: str
    table: rb.ContactTable
    form: str
    coefficients: tuple[float, ...]
    errors: Mapping[str, float]
    note: str


@dataclass(frozen=True)
class Rows:
    """Rows of one form, exact, and the errors that are put on them.

    Parameters
    ----------
    form : str
        Form.
    frame : pandas.DataFrame
        Columns a_over_R, b_over_R, Q, nu, p_over_E.
    errors : mapping of str to float
        What has been put on so far.
    """

    form: str
    frame: pd.DataFrame
    errors: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of(cls, form: str, places: pd.DataFrame) -> "Rows":
        model, theta = FORMS[form]
        a, b, q, nu = (places[name].to_numpy() for name in ("a_over_R", "b_over_R", "Q", "nu"))
        load = model.load(q, a, b, np.array(theta), nu)
        return cls(form, places.assign(p_over_E=load, solver="lab").reset_index(drop=True))

    def shared(self, rng: np.random.Generator, parameter: str, by: list[str], sd: float) -> "Rows":
        """Put one error on all rows alike in some columns."""
        codes = self.frame.groupby(by, sort=False).ngroup().to_numpy()
        offset = sd * rng.standard_normal(codes.max() + 1)
        load = self.frame["p_over_E"] * np.exp(offset[codes])
        errors = {**self.errors, parameter: sd}
        return Rows(self.form, self.frame.assign(p_over_E=load), errors)

    def iid(self, rng: np.random.Generator, sd: float | np.ndarray) -> "Rows":
        """Put an error of its own on each row; anew where a curve would fall, which is refused."""
        size = len(self.frame)
        each = np.broadcast_to(np.asarray(sd, dtype=float), size)
        keys = [
            name
            for name in ("a_over_R", "b_over_R", "nu", "source", "series")
            if name in self.frame
        ]
        curves = self.frame.groupby(keys, sort=False).ngroup().to_numpy()
        exact = self.frame["p_over_E"].to_numpy()
        load = exact.copy()
        for curve in range(curves.max() + 1):
            here = np.flatnonzero(curves == curve)
            while True:
                load[here] = exact[here] * np.exp(each[here] * rng.standard_normal(len(here)))
                if np.all(np.diff(load[here]) > 0):
                    break
        errors = {**self.errors, "sigma": float(each.max())}
        return Rows(self.form, self.frame.assign(p_over_E=load), errors)

    def with_frame(self, frame: pd.DataFrame) -> "Rows":
        return Rows(self.form, frame, self.errors)


Maker = Callable[[], Iterator[tuple[str, Rows, str]]]


def nine() -> pd.DataFrame:
    """Return textures and counts of the paper's nine textures, 41 rows."""
    return rb.paper_sweep().calibration.frame[["a_over_R", "b_over_R", "Q", "nu"]]


def grid(
    a: Sequence[float], b: Sequence[float], counts: Sequence[int], nu: float = 0.5
) -> pd.DataFrame:
    """Return every count of some textures (a[i], b[i])."""
    rows = [(x, y, q, nu) for x, y in zip(a, b, strict=True) for q in counts]
    return pd.DataFrame(rows, columns=["a_over_R", "b_over_R", "Q", "nu"])


def _plain() -> Iterator[tuple[str, Rows, str]]:
    for form in FORMS:
        for sd in (0.001, 0.01, 0.03, 0.1):
            rng = np.random.default_rng([17, round(1e4 * sd)])
            name = f"{form}-{100 * sd:g}-percent"
            yield name, Rows.of(form, nine()).iid(rng, sd), "independent errors, nothing special"


def _outliers() -> Iterator[tuple[str, Rows, str]]:
    rows = Rows.of("hybrid", nine()).iid(np.random.default_rng(21), PERCENT)
    factor = np.ones(len(rows.frame))
    first = np.flatnonzero(rows.frame["Q"] == 4)
    factor[first[[0, 4, 7]]] = 0.8, 1.25, 1.3  # far from the next transition of their curve
    frame = rows.frame.assign(p_over_E=rows.frame["p_over_E"] * factor)
    yield "outliers", rows.with_frame(frame), "three loads are off by x0.8, x1.25 and x1.3"


def _series() -> Iterator[tuple[str, Rows, str]]:
    places = nine()
    for column, name in (("series", "two-series"), ("source", "two-sources")):
        both = pd.concat([places.assign(**{column: x}) for x in ("first", "second")])
        rows = Rows.of("hybrid", both).iid(np.random.default_rng(22), PERCENT)
        factor = np.where(rows.frame[column] == "second", 1.08, 1.0)
        frame = rows.frame.assign(p_over_E=rows.frame["p_over_E"] * factor)
        yield name, rows.with_frame(frame), f"loads of the second {column} are 8 % higher"


def _few() -> Iterator[tuple[str, Rows, str]]:
    one = grid([0.022], [0.02], range(4, 16, 2))
    rng = np.random.default_rng(23)
    yield "one-texture", Rows.of("hybrid", one).iid(rng, PERCENT), "six rows of one texture"
    three = Rows.of("hybrid", nine().iloc[[0, 10, 30]]).iid(rng, PERCENT)
    yield "three-rows", three, "three rows of three textures"


def _mixed_nu() -> Iterator[tuple[str, Rows, str]]:
    places = nine()
    ratio = np.array([0.5, 0.49, 0.45, 0.3])
    codes = places.groupby(["a_over_R", "b_over_R"], sort=False).ngroup().to_numpy()
    rows = Rows.of("hybrid", places.assign(nu=ratio[codes % 4]))
    yield "mixed-nu", rows.iid(np.random.default_rng(24), PERCENT), "nu is 0.5, 0.49, 0.45 or 0.3"


def _rel_se() -> Iterator[tuple[str, Rows, str]]:
    rng = np.random.default_rng(25)
    places = nine()
    known = rng.choice([0.0, 0.005, 0.02, 0.05], len(places))
    rows = Rows.of("hybrid", places.assign(rel_se=known)).iid(rng, np.hypot(0.005, known))
    yield (
        "rel-se",
        Rows("hybrid", rows.frame, {"sigma": 0.005}),
        "rel_se from 0 to 5 %, and 0.5 % that nobody tells",
    )


def _bracketed(frame: pd.DataFrame, step: float) -> pd.DataFrame:
    """Return the increment of a load-stepped run in which each load lies."""
    upper = np.ceil(frame["p_over_E"] / step) * step
    return frame.assign(p_over_E=upper.round(12), p_over_E_lower=(upper - step).round(12))


def _counted(frame: pd.DataFrame, loads: Sequence[float]) -> pd.DataFrame:
    """Return what each texture of some transitions shows at some loads."""
    rows = []
    for (a, b, nu), curve in frame.groupby(["a_over_R", "b_over_R", "nu"], sort=False):
        highest = curve["p_over_E"].max()
        for p in (p for p in loads if p < highest):
            q = 2 + 2 * int((curve["p_over_E"] <= p).sum())
            rows.append((a, b, q, nu, p, "lab", "count"))
    columns = ["a_over_R", "b_over_R", "Q", "nu", "p_over_E", "solver", "kind"]
    return pd.DataFrame(rows, columns=columns)


def _intervals() -> Iterator[tuple[str, Rows, str]]:
    rows = Rows.of("hybrid", nine()).iid(np.random.default_rng(26), PERCENT)
    brackets = _bracketed(rows.frame, 2.5e-4)
    yield "brackets", rows.with_frame(brackets), "each load is an increment of 0.00025 E"
    counts = _counted(rows.frame, np.linspace(0.001, 0.019, 7).round(6).tolist())
    yield "counts", rows.with_frame(counts), "counts seen at seven loads"
    code = rows.frame.groupby(["a_over_R", "b_over_R"], sort=False).ngroup() % 3
    kinds = [
        rows.frame[code == 0].assign(kind="transition"),
        brackets[code == 1].assign(kind="transition"),
        _counted(rows.frame[code == 2], [0.002, 0.006, 0.012]),
    ]
    mixed = pd.concat(kinds, ignore_index=True)
    yield "all-kinds", rows.with_frame(mixed), "transitions, brackets and counts, by texture"


def _shared() -> Iterator[tuple[str, Rows, str]]:
    rng = np.random.default_rng(27)
    rows = Rows.of("hybrid", nine()).shared(rng, "tau_texture", ["a_over_R", "b_over_R"], 0.02)
    rows = rows.shared(rng, "tau_step", ["Q"], 0.02).iid(rng, 0.003)
    yield "texture-and-step", rows, "errors of 2 % that textures share and 2 % that steps share"
    held_out = grid([0.017, 0.027, 0.012], [0.015, 0.025, 0.06], range(4, 12, 2))
    both = pd.concat([nine().assign(role="calibration"), held_out.assign(role="held-out")])
    rows = Rows.of("hybrid", both).shared(rng, "tau_texture", ["a_over_R", "b_over_R"], 0.03)
    yield "held-out-textures", rows.iid(rng, 0.005), "textures held out; 3 % that textures share"


def _off_centre() -> Iterator[tuple[str, Rows, str]]:
    rows = Rows.of("hybrid", nine()).iid(np.random.default_rng(28), PERCENT)
    # A body over a ridge's centre reaches the ridges on either side together: odd numbers of them.
    off = grid([0.022, 0.012], [0.02, 0.03], [5, 7, 9])
    off = off.assign(p_over_E=[0.0015, 0.0045, 0.009] * 2, role="held-out", solver="lab")
    off["offset_over_R"] = 0.5 * (off["a_over_R"] + off["b_over_R"]) * 0.5
    frame = pd.concat([rows.frame.assign(role="calibration", offset_over_R=0.0), off])
    yield "off-centre-held-out", rows.with_frame(frame), "held-out rows of a body off centre, odd Q"


def _large() -> Iterator[tuple[str, Rows, str]]:
    share, pitch = np.linspace(0.25, 0.75, 20), np.tile([0.03, 0.042, 0.055, 0.038, 0.048], 4)
    a, b = (share * pitch).round(5), ((1 - share) * pitch).round(5)
    rows = Rows.of("hybrid", grid(a.tolist(), b.tolist(), range(4, 24, 2)))
    yield "two-hundred-rows", rows.iid(np.random.default_rng(29), PERCENT), "20 textures, 10 counts"
    share, pitch = (
        np.tile(np.linspace(0.25, 0.75, 12), 5),
        np.repeat(np.linspace(0.02, 0.06, 5), 12),
    )
    a, b = (share * pitch).round(5), ((1 - share) * pitch).round(5)
    places = grid(a.tolist(), b.tolist(), (4, 6)).iloc[np.arange(60) * 2 + np.arange(60) % 2]
    rows = Rows.of("hybrid", places).iid(np.random.default_rng(32), PERCENT)
    yield "sixty-textures", rows, "one row of each texture"


def _replicates() -> Iterator[tuple[str, Rows, str]]:
    rows = Rows.of("hybrid", nine()).iid(np.random.default_rng(30), PERCENT)
    twice = pd.concat([rows.frame.assign(source=name) for name in ("export.csv", "copy.csv")])
    yield "duplicated", rows.with_frame(twice), "every row twice, under two sources"


MAKERS: tuple[Maker, ...] = (
    _plain,
    _outliers,
    _series,
    _few,
    _mixed_nu,
    _rel_se,
    _intervals,
    _shared,
    _off_centre,
    _large,
    _replicates,
)


def _imported(folder: Path) -> WildTable:
    """Import 24 rows from a table in millimetres and newtons per millimetre."""
    places = grid(
        [0.25, 0.25, 0.2, 0.15, 0.1, 0.1], [0.25, 0.1, 0.2, 0.15, 0.25, 0.1], range(4, 12, 2)
    )
    places = places.assign(a_over_R=places["a_over_R"] / 8, b_over_R=places["b_over_R"] / 8)
    rows = Rows.of("hybrid", places).iid(np.random.default_rng(31), PERCENT)
    lines = ["Ridge [mm],Groove [mm],Edges,Load [N/mm],R [mm],E [MPa]"]
    for row in rows.frame.itertuples():
        load = row.p_over_E * 2 * 8 * 0.06  # P = 2 R p, with R = 8 mm and E = 0.06 MPa
        lines.append(f"{8 * row.a_over_R:g},{8 * row.b_over_R:g},{row.Q},{load:.4g},8,0.06")
    path = folder / "millimetres.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    mapping = ("a=Ridge", "b=Groove", "Q=Edges", "line=Load", "R=R", "E=E")
    table = rb.import_table(path, map=mapping)
    note = "24 rows imported from millimetres and N/mm, four digits"
    return WildTable("millimetres", table, "hybrid", FORMS["hybrid"][1], rows.errors, note)


@functools.cache  # some dozen small tables, which tests ask for one by one
def tables() -> tuple[WildTable, ...]:
    """Return all tables."""
    found = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for maker in MAKERS:
            for title, rows, note in maker():
                path = folder / f"{title}.csv"
                rows.frame.to_csv(path, index=False)
                truth = rows.form, FORMS[rows.form][1], rows.errors
                found.append(WildTable(title, rb.read_table(path), *truth, note))
        found.append(_imported(folder))
    return tuple(found)


def main() -> None:
    """Write every table as a CSV file, with a list of what they are."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--out", type=Path, default=Path("tables-in-the-wild"))
    folder = parser.parse_args().out
    folder.mkdir(parents=True, exist_ok=True)
    for one in tables():
        one.table.write(folder / f"{one.name}.csv")
        errors = ", ".join(f"{name} {value:g}" for name, value in one.errors.items())
        print(f"{one.name}: {len(one.table)} rows, {one.form}, {errors}; {one.note}")


if __name__ == "__main__":
    main()
