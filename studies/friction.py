"""How often do 90 % intervals of friction's parameters hold the truth?

``python -m studies.friction`` writes docs/validation/friction.csv. For each table the
truth is drawn from the priors, rows are simulated on a fixed plan, and calibrated. Of 50 tables
each parameter should be inside 41 to 49 times: a binomial leaves that range in 3 % of the cases.
A run that was stopped goes on.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

import ridgebayes as rb
from ridgebayes.friction.calibration import rows_of, sampled
from ridgebayes.friction.density import FrictionDensity, FrictionRows
from ridgebayes.friction.terms import PARAMETERS, terms
from ridgebayes.runtime.randomness import stream

TARGET = Path(__file__).parents[1] / "docs" / "validation" / "friction.csv"
COLUMNS = ["n_table", "n_inside", "n_converged"]
SURFACES = ((None, None), (0.022, 0.02), (0.012, 0.03))


def plan(n_subject: int = 8) -> pd.DataFrame:
    """Return rows without mu: subjects on two days each, two rigs, three surfaces, two loads."""
    rows = [
        (a, b, p, f"S{i}", str(day), f"rig {i % 2}", 0.0)
        for i in range(n_subject)
        for day in (1, 2)
        for a, b in SURFACES
        for p in (0.004, 0.01)
    ]
    names = ["a_over_R", "b_over_R", "p_over_E", "subject", "session", "rig", "mu_se"]
    return pd.DataFrame(rows, columns=names)


def simulated(
    rows: FrictionRows, theta: np.ndarray, rng: np.random.Generator, relative_se: float = 0.02
) -> FrictionRows:
    """Return the rows with mu of parameters (9,), measured with a relative standard error."""
    contact = rows.contact + rows.spread @ rng.standard_normal(rows.spread.shape[2])
    log_mu = np.log(terms(contact, np.broadcast_to(theta, (len(contact), 9))).sum(axis=1))
    for codes, scale in zip(rows.groups, theta[5:8], strict=True):
        log_mu += scale * rng.standard_normal(codes.max() + 1)[codes]
    log_mu += np.hypot(theta[8], relative_se) * rng.standard_normal(len(log_mu))
    mu = np.exp(log_mu)
    return FrictionRows(mu, relative_se * mu, rows.contact, rows.spread, rows.groups)


def hits(rows: FrictionRows, model: rb.FrictionModel, index: int, seed: int) -> pd.DataFrame:
    """Return of one simulated table which parameters' intervals hold the truth."""
    rng = stream(seed, f"table {index}")
    theta = model.theta(rng.standard_normal(len(model.unknown)))
    density = FrictionDensity(model, simulated(rows, theta, rng))
    chains, summary, _ = sampled(density, seed)
    truth = theta[[PARAMETERS.index(name) for name in model.unknown]]
    inside = (summary["eti_lower"] <= truth) & (truth <= summary["eti_upper"])
    found = summary[["parameter", "eti_lower", "eti_upper"]].assign(truth=truth, inside=inside)
    return found.assign(table=index, converged=not chains.convergence_failures)


def rows_to_fit(seed: int) -> FrictionRows:
    """Return the plan's rows with their contacts."""
    fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=seed)
    return rows_of(plan().assign(mu=1.0), fit, 0.5, seed, edges=True)


def main() -> None:
    """Write how often each parameter was inside."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("-o", type=Path, default=TARGET)
    asked = parser.parse_args()
    counted = pd.read_csv(asked.o, index_col="parameter") if asked.o.exists() else None
    first = 0 if counted is None else int(counted["n_table"].max())
    rows = rows_to_fit(asked.seed)
    for i in range(first, asked.n):
        found = hits(rows, rb.FrictionModel(), i, asked.seed).set_index("parameter").assign(one=1)
        new = found[["one", "inside", "converged"]].astype(int).set_axis(COLUMNS, axis=1)
        counted = new if counted is None else counted + new
        counted.to_csv(asked.o)
        print(i, counted["n_inside"].to_dict(), flush=True)


if __name__ == "__main__":
    main()
