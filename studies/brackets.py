"""What stepping the load costs, and what brackets repair: ``python -m studies.brackets``.

A solver that raises the load in steps sees each transition at the first step at or above its load:
half an increment too late on average. The embedded sweep is stepped so, at geometric steps of 1, 5
and 20 %, and Hybrid is fitted to it twice: that load taken as exact, and as the upper end of a
bracket whose lower end is the step before. Means over equally spaced phases of the steps, beside
the fit to the exact loads, are written to docs/validation/brackets.csv.

Fits are by importance sampling, or by a walk where the weights have too heavy a tail (n_walked).

Run it from the repository's root with OMP_NUM_THREADS=1. Some ten minutes.
"""

import argparse
import math
from pathlib import Path

import numpy as np
import pandas as pd

import ridgebayes as rb
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from tests.drawn import drawn_posterior

OUT = Path("docs/validation/brackets.csv")
INCREMENTS = (0.01, 0.05, 0.20)
NAMES = ("c1", "c2", "sigma")


def stepped(table: rb.ContactTable, increment: float, phase: float) -> rb.ContactTable:
    """Return the table as seen at loads (1 + increment)^(k + phase), k any integer, as brackets."""
    frame = table.calibration.frame
    step = math.log1p(increment)
    k = np.ceil(np.log(frame["p_over_E"]) / step - phase)
    frame["p_over_E"] = np.exp((k + phase) * step)
    frame["p_over_E_lower"] = np.exp((k - 1 + phase) * step)
    return rb.read_table(frame)


def as_exact(table: rb.ContactTable) -> rb.ContactTable:
    """Return the table without its brackets: the upper ends taken as the loads."""
    return rb.read_table(table.frame.drop(columns="p_over_E_lower"))


def moments(table: rb.ContactTable, noise: str) -> tuple[pd.DataFrame, bool]:
    """Return posterior mean and sd of Hybrid's parameters, and whether it took a walk."""
    model = Model(Observations.from_table(table), rb.Hybrid(), Noise.named(noise))
    fit = drawn_posterior(model)
    walked = not fit.converged
    if walked:
        fit = rb.calibrate(table, rb.Hybrid(), noise=noise, rng=1, settings=rb.SampleSettings())
    if not fit.converged:
        raise SystemExit(f"{table.where}, {noise}: {fit.convergence_failures}")
    return fit.summary.set_index("parameter")[["mean", "sd"]].loc[list(NAMES)], walked


def summary(noise: str, increment: float, loads: str, fits: list, exact: pd.DataFrame) -> dict:
    """Return one row: means over phases, and how far the coefficients are from the exact fit's."""
    found = [each for each, _ in fits]
    mean = sum(each["mean"] for each in found) / len(found)
    sd = sum(each["sd"] for each in found) / len(found)
    apart = [(each["mean"] - exact["mean"]) / exact["sd"] for each in found]
    row = {"noise": noise, "increment": increment, "loads": loads, "n_phase": len(found)}
    row["n_walked"] = sum(walked for _, walked in fits)
    for name in NAMES:
        row |= {name: mean[name], f"{name}_sd": sd[name]}
    for name in ("c1", "c2"):
        row[f"{name}_off_in_sd"] = (mean[name] - exact["mean"][name]) / exact["sd"][name]
        row[f"{name}_off_in_sd_worst"] = max(abs(each[name]) for each in apart)
    row["c1_off_percent"] = 100 * (mean["c1"] / exact["mean"]["c1"] - 1)
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--noise", nargs="+", default=["iid", "step"])
    parser.add_argument("--phases", nargs="+", type=int, default=[8, 4], help="one per --noise")
    asked = parser.parse_args()
    rows = []
    for noise, n_phase in zip(asked.noise, asked.phases, strict=True):
        exact = moments(rb.paper_sweep(), noise)
        rows.append(summary(noise, 0.0, "exact", [exact], exact[0]))
        for increment in INCREMENTS:
            tables = [stepped(rb.paper_sweep(), increment, i / n_phase) for i in range(n_phase)]
            for loads, seen in (("bracket", tables), ("upper end", [*map(as_exact, tables)])):
                found = [moments(table, noise) for table in seen]
                rows.append(summary(noise, increment, loads, found, exact[0]))
            print(pd.DataFrame(rows).round(4).to_string(index=False), flush=True)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows).to_csv(OUT, index=False, float_format="%.5g", lineterminator="\n")


if __name__ == "__main__":
    main()
