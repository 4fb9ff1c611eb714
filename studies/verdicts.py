"""How often a verdict names the wrong form: ``python -m studies.verdicts``.

Tables are drawn from a known form with known errors, and each is compared as `rb.compare` does by
default, but that nothing is walked and nothing left out, and that evidences by importance sampling
take the draws of a quick run. (`--check 10` compares ten tables both ways.)
docs/validation/verdicts.csv says of each cell of truth, errors and textures how many tables ended
in each grade, and with which form named.

    python -m studies.verdicts --tables 40 --workers 2

Every table that is done stands in docs/validation/verdicts.jsonl; a run that was stopped goes on
from there. A table takes one to two CPU minutes, so all cells with 40 tables take days.

Run it from the repository's root with OMP_NUM_THREADS=1.
"""

import argparse
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pandas as pd

import ridgebayes as rb
from ridgebayes.comparison.verdict import GRADES, Verdict
from ridgebayes.drawing.style import as_bytes
from ridgebayes.errors import RidgebayesError
from ridgebayes.inference.presets import QUICK, STANDARD
from ridgebayes.runtime.pool import executor_for
from ridgebayes.runtime.randomness import stream
from studies.resumed import resumed
from studies.verdicts_figure import plot_verdicts

OUT = Path("docs/validation/verdicts.csv")
DONE = Path("docs/validation/verdicts.jsonl")
TRUTHS = ("classic", "modified", "hybrid", "hybrid c2 = 0.03", "power-law")
ERRORS = ("iid 0.01", "iid 0.03", "iid 0.10", "texture+step", "series")
N_TEXTURE = (9, 4)
_UNWALKED = replace(STANDARD, walks=False)
_QUICK = replace(QUICK, extras=True)  # Student error models too


@dataclass(frozen=True)
class Cell:
    """One table to be drawn and compared."""

    truth: str
    errors: str
    n_texture: int
    index: int


def drawn(cell: Cell) -> rb.ContactTable:
    """Return a table of the paper's places with loads of the truth and its errors."""
    rng = stream(0, cell.truth, cell.errors, str(cell.n_texture), str(cell.index))
    frame = rb.paper_sweep().calibration.frame[["a_over_R", "b_over_R", "Q"]]
    textures = frame.drop_duplicates(["a_over_R", "b_over_R"]).iloc[
        :: 1 if cell.n_texture == 9 else 2
    ]
    textures = textures.iloc[: cell.n_texture]
    frame = frame.merge(textures[["a_over_R", "b_over_R"]], on=["a_over_R", "b_over_R"])
    a, b, Q = (frame[name].to_numpy() for name in ("a_over_R", "b_over_R", "Q"))
    texture = frame.groupby(["a_over_R", "b_over_R"], sort=False).ngroup().to_numpy()
    step = frame.groupby("Q").ngroup().to_numpy()
    while True:  # the contract asks for loads that rise with Q
        table = frame.assign(
            p_over_E=_load(cell.truth, Q, a, b, texture, rng)
            * np.exp(_error(cell.errors, frame, texture, step, rng))
        )
        if cell.errors == "series":
            table["series"] = np.where(np.arange(len(frame)) % 2, "one", "two")
        try:
            return rb.ContactTable.from_frame(table)
        except rb.InputError:
            continue


def _load(truth, Q, a, b, texture, rng):
    if truth == "power-law":
        wiggle = 0.1 * rng.standard_normal(texture.max() + 1)
        return ((Q / 2 - 1) / (2 * 1.382 / (a + b) * np.exp(wiggle[texture]) / 2)) ** 2
    form, theta = {
        "classic": (rb.Classic(), [1.382]),
        "modified": (rb.Modified(), [1.38]),
        "hybrid": (rb.Hybrid(), [1.348, 0.01583]),
        "hybrid c2 = 0.03": (rb.Hybrid(), [1.348, 0.03]),
    }[truth]
    return (form.shape(Q, a, b) / form.rate(np.array(theta), a, b)) ** 2


def _error(errors, frame, texture, step, rng):
    n = len(frame)
    if errors.startswith("iid"):
        return float(errors.split()[1]) * rng.standard_normal(n)
    if errors == "series":
        offset = 0.05 * (np.arange(n) % 2)  # two series 5 % apart
        return offset + 0.01 * rng.standard_normal(n)
    shared = (
        rng.standard_normal(texture.max() + 1)[texture],
        rng.standard_normal(step.max() + 1)[step],
    )
    return 0.02 * shared[0] + 0.02 * shared[1] + 0.005 * rng.standard_normal(n)


def compared(cell: Cell) -> dict[str, object]:
    """Return the verdict on one table; a table that cannot be compared says why."""
    try:
        verdict = verdict_on(drawn(cell), cell.index)
    except RidgebayesError as error:
        return vars(cell) | {"grade": "failed", "form": "", "why": str(error)}
    told = {name: getattr(verdict, name) for name in ("grade", "form", "ln_bf", "ln_bf_range")}
    return vars(cell) | told


def verdict_on(table: rb.ContactTable, seed: int) -> Verdict:
    """Return what a comparison says of the default forms, with draws of a quick run."""
    return rb.compare(table, rng=seed, accuracy=_QUICK).verdict


def check(cells: list[Cell]) -> None:
    """Print how far ln Bayes factors and grades of some tables are from those of a comparison."""
    for cell in cells:
        quick = verdict_on(drawn(cell), cell.index)
        whole = rb.compare(drawn(cell), rng=cell.index, accuracy=_UNWALKED).verdict
        values = [
            (v.form, v.grade, round(v.ln_bf, 3), np.round(v.ln_bf_range, 2)) for v in (quick, whole)
        ]
        print(*cell.__dict__.values(), *values, flush=True)


def cells(n_table: int, only: str) -> Iterator[Cell]:
    """Give every table that is wanted, cell by cell."""
    for index, *names in itertools.product(range(n_table), TRUTHS, ERRORS, N_TEXTURE):
        cell = Cell(*names, index)
        if only in f"{cell.truth}, {cell.errors}, {cell.n_texture}":
            yield cell


def summarised(found: pd.DataFrame) -> pd.DataFrame:
    """Return one row for each cell and grade."""
    right = found["form"] == found["truth"].str.partition(" ")[0]
    found = found.assign(n_right=right, n_wrong=~right)
    keys = ["truth", "errors", "n_texture"]
    n = found.groupby(keys, sort=False).size().rename("n_tables")
    counts = found.groupby([*keys, "grade"], sort=False)[["n_right", "n_wrong"]].sum()
    table = counts.reset_index().merge(n.reset_index(), on=keys)
    table["grade"] = pd.Categorical(table["grade"], [*GRADES, "failed"])
    columns = [*keys, "n_tables", "grade", "n_right", "n_wrong"]
    return table.sort_values([*keys, "grade"])[columns]


def main() -> None:
    """Compare what is not compared yet, and write the summary."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=40)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", default="", help="part of 'TRUTH, ERRORS, N_TEXTURE'")
    parser.add_argument("--check", type=int, default=0, help="compare so many with a comparison")
    asked = parser.parse_args()
    if asked.check:
        check(list(cells(asked.tables, asked.only))[::5][: asked.check])
        return
    with executor_for(asked.workers, None) as executor:
        wanted, keys = cells(asked.tables, asked.only), [one.name for one in fields(Cell)]
        table = summarised(resumed(DONE, wanted, keys, compared, executor))
    table.to_csv(OUT, index=False)
    OUT.with_suffix(".png").write_bytes(as_bytes(plot_verdicts(table), "png"))
    sure = table[table["grade"].isin(("decisive", "supports"))]
    n = int(table.groupby(["truth", "errors", "n_texture"])["n_tables"].first().sum())
    share = sure["n_wrong"].sum() / n
    se = math.sqrt(max(share, 1 / n) / n)
    print(f"{n} tables: wrong form at supports or more {share:.2%} (standard error {se:.2%})")
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
