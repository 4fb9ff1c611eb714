"""Log evidences by independent methods: ``python -m tests.validation.evidences``.

For every form and error model on the embedded sweep: bridge, importance sampling, dynesty, and
quadrature where there are at most four coordinates or the power law's K integrate exactly. Rows are
added to docs/validation/evidences.csv as they are computed; what is there already is not computed
again. The quick methods of all models come first, then walks and dynesty. In the end a table of
disagreements is printed: bridge less each other method, in combined standard errors.

Run it from the repository's root with OMP_NUM_THREADS=1. Hours, nearly all of them dynesty's.
"""

import argparse
import csv
import itertools
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd

import ridgebayes as rb
from ridgebayes.errors import RidgebayesError
from ridgebayes.evidence import LogEvidence, quadrature_evidence
from ridgebayes.evidence.nested import nested_evidence
from ridgebayes.evidence.tables import evidences
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.model.forms import form_named
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.randomness import stream

OUT = Path("docs/validation/evidences.csv")
COLUMNS = ["form", "noise", "method", "log_evidence", "log_evidence_se", "cpu_s", "status"]
FORMS = ("hybrid", "modified", "classic", "power-law")
# The cheapest first, by the time of a run of dynesty.
NOISE = (
    "iid",
    "iid:student",
    "texture",
    "step",
    "texture+step",
    "step-smooth",
    "step:student",
    "texture:student",
    "texture+step:student",
    "step-smooth:student",
)
SEED = 1
N_CALL_MAX = 4_000_000
COMBINED, FROM_QUADRATURE = 3.0, 0.02  # largest difference: in standard errors, and of ln Z


def model_of(form: str, noise: str) -> Model:
    return Model(Observations.from_table(rb.paper_sweep()), form_named(form), Noise.named(noise))


def walked(form: str, noise: str, n_live: int) -> Iterator[LogEvidence]:
    """Bridge from a walk; and what `evidences` computes beside it."""
    fit = rb.calibrate(rb.paper_sweep(), form_named(form), noise=noise, rng=SEED)
    for found in evidences(fit):
        if found.method == "bridge" and not fit.converged:
            status = f"walk not converged: {fit.convergence_failures[0]}"
            found = LogEvidence(found.method, found.value, found.se, status)
        if found.method != "laplace":
            yield found


def importance(form: str, noise: str, n_live: int) -> Iterator[LogEvidence]:
    yield importance_posterior(model_of(form, noise), seed=SEED)[1]


def quadrature(form: str, noise: str, n_live: int) -> Iterator[LogEvidence]:
    model = model_of(form, noise)
    # Plain rows have theirs from `evidences` already.
    if model.n_coordinate <= 4 and not model.is_iid_gaussian:
        laplace = fit_laplace(model)
        yield quadrature_evidence(model.log_density, laplace, tol=1e-3, points_max=3_000_000)


def nested(form: str, noise: str, n_live: int) -> Iterator[LogEvidence]:
    model = model_of(form, noise)
    rng = stream(SEED, "dynesty", form, noise)
    n_live = n_live if model.n_coordinate < 10 else n_live // 2
    yield nested_evidence(model, rng=rng, n_live=n_live, n_call_max=N_CALL_MAX)


Method = Callable[[str, str, int], Iterator[LogEvidence]]
QUICK: dict[str, Method] = {"importance": importance, "quadrature": quadrature}
SLOW: dict[str, Method] = {"bridge": walked, "dynesty": nested}


def known() -> pd.DataFrame:
    return pd.read_csv(OUT) if OUT.exists() else pd.DataFrame(columns=COLUMNS)


def compute(method: str, way: Method, form: str, noise: str, n_live: int) -> None:
    """Append what a method finds, or why it does not."""
    start = time.process_time()
    try:
        found = list(way(form, noise, n_live))
    except RidgebayesError as error:
        found = [LogEvidence(method, np.nan, np.nan, str(error))]
    seconds = time.process_time() - start
    new = not OUT.exists()
    OUT.parent.mkdir(parents=True, exist_ok=True)
    with OUT.open("a", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        if new:
            writer.writerow(COLUMNS)
        for e in found:
            row = [form, noise, e.method, f"{e.value:.6f}", f"{e.se:.2g}", f"{seconds:.1f}"]
            writer.writerow([*row, e.status])
            print(*row, e.status, flush=True)


def disagreements(table: pd.DataFrame) -> pd.DataFrame:
    """Bridge less each other method, one row per form, error model and method."""
    rows = []
    for (form, noise), group in table[table["status"] == "ok"].groupby(["form", "noise"]):
        by_method = group.set_index("method")[["log_evidence", "log_evidence_se"]]
        if "bridge" not in by_method.index:
            continue
        bridge, bridge_se = by_method.loc["bridge"]
        for method, (value, se) in by_method.drop("bridge").iterrows():
            apart = bridge - value
            # A bound on an error of discretisation and a standard error do not add as variances;
            # beside the bridge's own the former is nothing.
            combined = np.hypot(bridge_se, se)
            passed = abs(apart) <= COMBINED * combined
            if method == "quadrature":
                passed &= abs(apart) <= FROM_QUADRATURE
            rows.append((form, noise, method, apart, combined, apart / combined, passed))
    names = ["form", "noise", "method", "difference", "combined_se", "in_se", "passed"]
    return pd.DataFrame(rows, columns=names)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--forms", nargs="+", default=FORMS, choices=FORMS)
    parser.add_argument("--noise", nargs="+", default=NOISE, choices=NOISE)
    parser.add_argument("--methods", nargs="+", default=(*QUICK, *SLOW), choices=(*QUICK, *SLOW))
    parser.add_argument("--n-live", type=int, default=1_000, help="half of it from 10 coordinates")
    asked = parser.parse_args()
    for methods in (QUICK, SLOW):
        for form, noise in itertools.product(asked.forms, asked.noise):
            for method, way in methods.items():
                done = known()
                here = (done["form"] == form) & (done["noise"] == noise)
                if method in asked.methods and method not in set(done["method"][here]):
                    compute(method, way, form, noise, asked.n_live)
    table = disagreements(known())
    print(table.round(4).to_string(index=False))
    print(f"{len(table)} comparisons, {int((~table['passed']).sum())} outside the criterion")


if __name__ == "__main__":
    main()
