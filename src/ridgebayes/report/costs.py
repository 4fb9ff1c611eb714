"""The section on what accuracy costs in time."""

import numpy as np

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.inference.presets import Preset
from ridgebayes.report.blocks import Section, Table, Text, table
from ridgebayes.report.numbers import number

_ERRORS = {
    "loads": "of a load, relative to the table's",
    "posterior": "of a mean, in posterior sds",
    "evidence": "in ln Z",
}


def cost_section(comparison: Comparison) -> Section:
    """Return what was promised, and what a few ways to the answer cost on the run's machine."""
    costs, wanted = comparison.cost, Preset.named(comparison.accuracy)
    if not len(costs):
        return Section("What accuracy costs in time", "cost", ())
    words = (
        f"Accuracy {wanted.name}: promised are posterior means, sds and quantiles to "
        f"{wanted.moment_error:g} posterior sds and log evidences to {wanted.evidence_error:g}. "
    )
    if not wanted.extras:
        words += (
            "A quick look: normal error models weighed by Laplace's approximation, posteriors "
            "drawn by importance sampling; no textures left out, no finite elements compared. "
        )
    words += (
        "CPU seconds are of the machine that made this run, each taken once, and no other run "
        "repeats them; the long version, with more settings and repeats, is `ridgebayes cost`."
    )
    rows = [
        [
            row["task"],
            row["method"],
            number(row["error"], 2),
            _ERRORS.get(row["task"], ""),
            "not taken" if np.isnan(row["cpu_s"]) else number(row["cpu_s"], 2),
        ]
        for row in costs.to_dict("records")
    ]
    blocks: tuple[Text | Table, ...] = (
        Text(words),
        table(
            ["Of", "By", "Error", "What error", "CPU s"],
            rows,
            "Errors of other ways are their distances from this run's own numbers; those of this "
            "run are Monte Carlo standard errors.",
            text=(0, 1, 3),
        ),
    )
    return Section("What accuracy costs in time", "cost", blocks)
