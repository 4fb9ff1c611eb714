"""How often 90 % bands hold new loads: ``python -m studies.load_coverage``.

Hybrid's coefficients and an error model's scales are drawn from the priors, and a table from them.
It is fitted as `rb.calibrate` does by default, error models averaged. Then the same truth makes new
loads: at the table's textures, and at two new ones inside its range. Each has a new error of its
row; a fitted texture keeps its offset and a new one has its own; steps keep theirs; the series is
new. docs/validation/load_coverage.csv says how many of them the bands hold.

    python -m studies.load_coverage --tables 100 --workers 2 --only "series, 41"

Truth `prior` draws the error model too, from all that are weighed for two series, and asks about
twenty new series: averaged over such truths a right mixture holds 0.90.

Every table that is done stands in docs/validation/load_coverage.jsonl; a run that was stopped goes
on from there. A table of 20 or 41 rows takes some 5 CPU seconds, one of 200 rows a minute or two.

Run it from the repository's root with OMP_NUM_THREADS=1.
"""

import argparse
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import qmc

import ridgebayes as rb
from ridgebayes.evidence.pairs import weigh_pairs
from ridgebayes.inference.presets import PRESETS
from ridgebayes.model.model import Model
from ridgebayes.model.noise import AUTO, Noise, error_models_for
from ridgebayes.model.observations import Observations
from ridgebayes.model.replicated import prior_draws, simulate_log_loads
from ridgebayes.runtime.pool import executor_for
from ridgebayes.runtime.randomness import stream
from studies.resumed import resumed
from tests.drawn import drawn_posterior
from tests.simulated import simulated

OUT = Path("docs/validation/load_coverage.csv")
DONE = Path("docs/validation/load_coverage.jsonl")
PRIOR = "prior"  # the error model is drawn too, all with the same probability
TRUTHS = {
    "iid": "iid",
    "series": "series",
    "texture+step": "texture+step",
    "student": "iid:student",
    PRIOR: "",
}
N_NEW_SERIES = {PRIOR: 20}  # one elsewhere: with several, a table says more of the chance of all
N_ROW = (20, 41, 200)
PROB = 0.9
NEW = ((0.017, 0.015), (0.027, 0.024))  # textures inside every table's range
_WIDTHS = (0.012, 0.01), (0.032, 0.03)
_KEYS = ["truth", "n_row", "noise", "accuracy", "index"]


@dataclass(frozen=True)
class Cell:
    """One table to be drawn and fitted."""

    truth: str
    n_row: int
    index: int
    accuracy: str = "standard"
    noise: str = AUTO  # what is fitted


def places(n_row: int) -> pd.DataFrame:
    """Return textures and counts of a table: the paper's, or every count of spread textures."""
    if n_row == 41:
        return rb.paper_sweep().calibration.frame[["a_over_R", "b_over_R", "Q"]]
    n_texture = {20: 5, 200: 20}[n_row]
    widths = qmc.scale(qmc.Sobol(2, seed=3).random(32)[:n_texture], *_WIDTHS)
    widths[:2] = _WIDTHS  # the range's corners
    frame = pd.DataFrame(widths, columns=["a_over_R", "b_over_R"])
    return frame.merge(pd.DataFrame({"Q": 4 + 2 * np.arange(n_row // n_texture)}), how="cross")


def drawn(cell: Cell) -> tuple[Observations, pd.DataFrame]:
    """Return a table's rows, and new loads of the same truth."""
    rng = stream(0, "load coverage", cell.truth, str(cell.n_row), str(cell.index))
    table = places(cell.n_row)
    new = pd.DataFrame(NEW, columns=["a_over_R", "b_over_R"]).merge(
        pd.DataFrame({"Q": sorted(table["Q"].unique())}), how="cross"
    )
    n, of_series = len(table), cell.truth in ("series", PRIOR)
    series = np.where(np.arange(n) % 2, "one", "two") if of_series else "one"
    table = table.assign(series=series)
    once = pd.concat([table, new]).assign(is_new=np.arange(n + len(new)) >= n)
    n_new = N_NEW_SERIES.get(cell.truth, 1)
    fresh = pd.concat([once.assign(series=f"new {i}") for i in range(n_new)])
    model = Model(_rows(pd.concat([table, fresh])), rb.Hybrid(), _truth(cell, rng))
    theta = prior_draws(model, rng, 1)[0]
    log_load = simulate_log_loads(model, theta, rng)[0]
    return simulated(_rows(table), log_load[:n]), fresh.assign(log_load=log_load[n:])


def _truth(cell: Cell, rng: np.random.Generator) -> Noise:
    if cell.truth != PRIOR:
        return Noise.named(TRUTHS[cell.truth])
    every = Noise.candidates(2)
    return every[rng.integers(len(every))]


def _rows(frame: pd.DataFrame) -> Observations:
    """Return observations of places; their loads only have to be loads."""
    a, b, Q = (frame[name].to_numpy() for name in ("a_over_R", "b_over_R", "Q"))
    return Observations.from_table(
        rb.ContactTable.from_frame(frame.assign(p_over_E=rb.Modified().load(Q, a, b)))
    )


def covered(cell: Cell) -> dict[str, object]:
    """Return how many new loads a fit's bands hold, at fitted and at new textures."""
    data, fresh = drawn(cell)
    fit = _fitted(data, cell)
    n_new = N_NEW_SERIES.get(cell.truth, 1)  # the same places in each series
    once = fresh.iloc[: len(fresh) // n_new]
    where = (once[name].to_numpy() for name in ("a_over_R", "b_over_R", "Q"))
    low, high = np.tile(np.log(fit.predict_load(*where).interval(PROB)), n_new)
    held = (low <= fresh["log_load"]) & (fresh["log_load"] <= high)
    known = ~fresh["is_new"]
    return vars(cell) | {
        "fitted": [int(held[known].sum()), int(known.sum())],
        "new": [int(held[~known].sum()), int((~known).sum())],
        "log_width": float((high - low).mean()),
        "error_model": fit.noise.name,
    }


def _fitted(data: Observations, cell: Cell) -> rb.Fit:
    form, accuracy = rb.Hybrid(), PRESETS[cell.accuracy]
    if cell.noise != AUTO:
        model = Model(data, form, Noise.named(cell.noise))
        posterior = drawn_posterior(model, seed=cell.index, **asdict(accuracy.effort))
        return rb.Fit.of(posterior, {cell.noise: 1.0}, {cell.noise: posterior})
    noises = error_models_for(AUTO, data.n_series)
    weighed = weigh_pairs(data, [form], noises, seed=cell.index, accuracy=accuracy)
    weights = weighed.weights(form.name)
    printed = max(weights, key=lambda name: weights[name])
    posteriors = weighed.posteriors([form.name], printed, accuracy.n_kept)[form.name]
    return rb.Fit.of(posteriors[printed], weights, posteriors)


def summarised(found: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each cell and kind of texture; loads of one table are no two tables."""
    rows = []
    for key, part in found.groupby(_KEYS[:-1], sort=False):
        for kind in ("fitted", "new"):
            counts = np.array(part[kind].tolist())
            share = counts[:, 0] / counts[:, 1]
            se = share.std(ddof=1) / np.sqrt(len(share)) if len(share) > 1 else np.nan
            rows.append((*key, kind, len(part), counts[:, 1].sum(), share.mean(), se))
    columns = [*_KEYS[:-1], "textures", "n_tables", "n_loads", "share", "share_se"]
    return pd.DataFrame(rows, columns=columns).round({"share": 4, "share_se": 4})


def cells(n_table: int, only: str, accuracy: str, noise: str) -> Iterator[Cell]:
    """Give every table that is wanted, small ones first."""
    for n_row in N_ROW:
        for index in range(n_table):
            for truth in TRUTHS:
                if only in f"{truth}, {n_row}":
                    yield Cell(truth, n_row, index, accuracy, noise)


def main() -> None:
    """Fit what is not fitted yet, and write the summary."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--tables", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--only", default="", help="part of 'TRUTH, N_ROW'")
    parser.add_argument("--accuracy", choices=PRESETS, default="standard", help="of the draws")
    parser.add_argument("--noise", default=AUTO, help="error model that is fitted")
    asked = parser.parse_args()
    with executor_for(asked.workers, None) as executor:
        wanted = cells(asked.tables, asked.only, asked.accuracy, asked.noise)
        table = summarised(resumed(DONE, wanted, _KEYS, covered, executor))
    table.to_csv(OUT, index=False)
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
