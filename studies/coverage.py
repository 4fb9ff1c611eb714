"""Do bands hold what they say? Hybrid on the embedded sweep, half-plane textures never fitted.

Run ``python -m studies.coverage [ERROR_MODEL ...]``; it prints a line per set of textures.
"""

import sys

import numpy as np
import pandas as pd
from scipy.stats import qmc

from ridgebayes import Hybrid, calibrate, paper_sweep
from ridgebayes.checks.coverage import COVERAGE_COLUMNS, PROBS, count_covered, covered_rows
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.errors import InputError
from ridgebayes.model.observations import Observations
from ridgebayes.table.table import ContactTable

Q_MAX = 18  # the highest calibrated count


def textures_table(textures, p_max):
    """Return the half-plane's transitions of some textures up to a load and the calibrated Q."""
    rows = []
    for a, b in textures:
        loads = transition_loads(a, b, Q_MAX // 2 - 1).p_over_E(a + b)
        rows += [(a, b, 2 * k + 4, p) for k, p in enumerate(loads) if p <= p_max]
    frame = pd.DataFrame(rows, columns=["a_over_R", "b_over_R", "Q", "p_over_E"])
    return ContactTable.from_frame(frame.assign(role="held-out", solver="half-plane"))


def sets():
    """Return tables by name."""
    inside = qmc.scale(qmc.Sobol(2, seed=1).random(256)[:200], (0.012, 0.01), (0.032, 0.03))
    ratio = 0.1 + 0.18 * qmc.Sobol(1, seed=2).random(64)[:, 0]
    outside = [(0.05 * r, 0.05 * (1 - r)) for r in ratio]
    return {
        "200 Sobol textures, p/E to 0.02": textures_table(inside, 0.02),
        "the same, every calibrated Q": textures_table(inside, np.inf),
        "a/pitch 0.1 to 0.28, every calibrated Q": textures_table(outside, np.inf),
        "(0.015, 0.012) to 0.02": textures_table([(0.015, 0.012)], 0.02),
        "(0.027, 0.025) to 0.02": textures_table([(0.027, 0.025)], 0.02),
        "(0.012, 0.09) to 0.045": textures_table([(0.012, 0.09)], 0.045),
    }


def coverage_of(fit, table, *, probs=PROBS):
    """Count how many transitions of unseen textures lie inside the bands of a fit."""
    for a, b in set(table.textures) & set(fit.model.data.textures):
        raise InputError(f"texture a/R = {a}, b/R = {b} was fitted; expected unseen textures only")
    # The rows of an unseen texture have no role to play in a fit.
    everything = ContactTable.from_frame(table.frame.assign(role="calibration"))
    data = Observations.from_table(everything)
    found = covered_rows(fit, data.take(data.is_exact), probs), fit.converged
    rows = count_covered(fit.form.name, fit.noise.name, probs, [("all", found)])
    return pd.DataFrame(rows, columns=COVERAGE_COLUMNS)


def main(names):
    """Print how often bands of each error model hold, and how wide they are."""
    for name in names:
        fit = calibrate(paper_sweep(), Hybrid(), noise=name, rng=1)
        for title, table in sets().items():
            found = coverage_of(fit, table, probs=(0.5, 0.8, 0.9, 0.95, 0.99))
            print(f"\n{name}: {title}")
            columns = ["prob", "n", "covered", "share", "share_se", "mean_width"]
            print(found[columns].to_string(index=False))


if __name__ == "__main__":
    main(sys.argv[1:] or ["iid", "step-smooth"])
