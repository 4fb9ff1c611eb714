"""Student errors with shared offsets: ``python -m tests.validation.student_structures``.

Hybrid's loads of the nine textures with 1 % noise, three rows times 0.8, 1.25 and 1.3. For each of
step, texture+step and step-smooth, five seeds draw the posterior just as `run` does. A reference
takes 32 times their draws, in 8 parts of independent proposals, whose scatter gives its error.
docs/validation/student_structures.csv says what each seed is off by: ln evidence, the largest error
of a posterior mean in posterior sds, the Pareto shape of its weights, and its CPU seconds.

Every fit that is done stands in build/student_structures.jsonl; a run that was stopped goes on from
there. A seed takes some 10 to 40 CPU seconds, the reference of a structure some minutes.

Run it from the repository's root with OMP_NUM_THREADS=1.
"""

import argparse
import itertools
import time
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np
import pandas as pd

import ridgebayes as rb
from ridgebayes.evidence.candidates import Weighing, evaluate
from ridgebayes.evidence.error_models import _UNSURE, _efforts
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.inference.pareto_smoothing import pareto_k
from ridgebayes.inference.presets import STANDARD
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from tests.tables_in_the_wild import tables
from tests.validation.simulated import resumed

OUT = Path("docs/validation/student_structures.csv")
DONE = Path("build/student_structures.jsonl")
CPU_S = {"step": 15.0, "texture+step": 15.0, "step-smooth": 40.0}  # asked of a fit
N_SEED = 5
EVIDENCE, MEAN, SHAPE = 0.05, 0.1, 0.7  # asked: of ln evidence, of means in sds, Pareto k
REFERENCE = "reference"
# One after the other: together they would be gigabytes of offsets.
_PARTS, _EFFORT = 8, STANDARD.effort | {"n_draw": 4_096, "n_per_round": 1_024}


def observations() -> Observations:
    """Return the rows of the table `outliers`."""
    (table,) = (one.table for one in tables() if one.name == "outliers")
    return Observations.from_table(table)


class Task(NamedTuple):
    """One fit: of a seed, or the reference."""

    structure: str
    seed: str


def done(task: Task) -> dict[str, object]:
    """Do one fit."""
    is_long = task.seed == REFERENCE
    return referred(task.structure) if is_long else fitted(task.structure, int(task.seed))


def fitted(structure: str, seed: int) -> dict[str, object]:
    """Fit as `run` weighs a pair whose form and error model lead."""
    shapes: list[float] = []

    def noted(log_weights: np.ndarray) -> float:
        shapes.append(pareto_k(log_weights))
        return shapes[-1]

    began = time.process_time()
    noise = Noise.named(f"{structure}:student")
    task = Weighing(observations(), rb.Hybrid(), noise, {}, seed)
    screened = evaluate(task)
    own = screened.evidence.value
    efforts = _efforts(screened, own, own, STANDARD, is_main=True)
    task = replace(task, screened=screened, efforts=efforts, se_most=_UNSURE)
    with mock.patch("ridgebayes.inference.importance_sampling.pareto_k", noted):
        found = evaluate(task)
    seconds = time.process_time() - began
    assert found.posterior is not None, found.evidence.status
    return {
        "structure": structure,
        "seed": str(seed),
        "log_evidence": found.evidence.value,
        "log_evidence_se": found.evidence.se,
        "pareto_k": shapes[-1],
        "cpu_s": seconds,
        "mean": found.posterior.draws.mean(axis=0).tolist(),
    }


def referred(structure: str) -> dict[str, object]:
    """Fit far longer, in parts with proposals of their own."""
    began = time.process_time()
    model = Model(observations(), rb.Hybrid(), Noise.named(f"{structure}:student"))
    laplace = fit_laplace(model, search_others=True)
    values, means, squares = [], [], []
    for part in range(_PARTS):
        drawn, evidence = importance_posterior(model, laplace, seed=1_000 + part, **_EFFORT)
        print(f"{structure}: part {part + 1} of {_PARTS}, {evidence.value:.4f}", flush=True)
        values.append(evidence.value)
        means.append(drawn.draws.mean(axis=0))
        squares.append((drawn.draws**2).mean(axis=0))
    each = np.exp(np.array(values) - max(values))
    mean = np.average(means, axis=0, weights=each)
    sd = np.sqrt(np.average(squares, axis=0, weights=each) - mean**2)
    return {
        "structure": structure,
        "seed": REFERENCE,
        "log_evidence": max(values) + float(np.log(each.mean())),
        "log_evidence_se": float(each.std(ddof=1) / each.mean() / np.sqrt(_PARTS)),
        "pareto_k": np.nan,
        "cpu_s": time.process_time() - began,
        "mean": mean.tolist(),
        "sd": sd.tolist(),
        "mean_se": float((np.std(means, axis=0, ddof=1) / np.sqrt(_PARTS) / sd).max()),
    }


def summarised(found: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each fit: what it is off by, and whether that is what was asked."""
    rows = []
    for structure, part in found.groupby("structure", sort=False):
        by_seed = part.set_index("seed")
        if REFERENCE not in by_seed.index:
            continue
        truth = by_seed.loc[REFERENCE]
        for seed, one in by_seed.iterrows():
            is_truth = seed == REFERENCE
            off = one["log_evidence"] - truth["log_evidence"]
            apart = np.abs(np.subtract(one["mean"], truth["mean"]) / truth["sd"]).max()
            apart = truth["mean_se"] if is_truth else apart
            limits = ((abs(off), EVIDENCE), (apart, MEAN), (one["pareto_k"], SHAPE))
            kept = all(value <= most for value, most in (*limits, (one["cpu_s"], CPU_S[structure])))
            numbers = (one["log_evidence"], one["log_evidence_se"], off, apart, one["pareto_k"])
            rows.append((structure, seed, *numbers, one["cpu_s"], "" if is_truth else kept))
    columns = ["structure", "seed", "log_evidence", "log_evidence_se", "log_evidence_error"]
    columns += ["largest_mean_error_sd", "pareto_k", "cpu_s", "kept"]
    return pd.DataFrame(rows, columns=columns).round(dict.fromkeys(columns[2:-2], 4) | {"cpu_s": 1})


def main() -> None:
    """Fit what is not fitted yet, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--structures", nargs="+", default=list(CPU_S), choices=list(CPU_S))
    asked = parser.parse_args()
    seeds = (*map(str, range(N_SEED)), REFERENCE)
    tasks = itertools.starmap(Task, itertools.product(asked.structures, seeds))
    table = summarised(resumed(DONE, tasks, Task._fields, done))
    table.to_csv(OUT, index=False)
    print(table.to_string(index=False))


if __name__ == "__main__":
    main()
