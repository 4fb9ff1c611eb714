"""The section on error models: every form under each, and which was chosen."""

import pandas as pd

from ridgebayes.comparison.bayes_factors import SUMMED
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import forms_by_probability
from ridgebayes.evidence.error_models import mean_evidence
from ridgebayes.report.blocks import Picture, Section, Table, Text, table
from ridgebayes.report.names import form_name, noise_name, said
from ridgebayes.report.numbers import ABSENT, decimals, probability, with_error


def error_models_section(comparison: Comparison) -> Section:
    """Return evidences by form and error model; nothing where one error model alone was weighed."""
    means = mean_evidence(comparison.evidence)
    if len(means) < 2:
        return Section("Error models", "error-models", ())
    blocks: list[Text | Table | Picture] = [
        Text(
            "What is left of a load after a form is fitted repeats from texture to texture and "
            "from step to step. An error model says what repeats; taken as independent the rows "
            "promise too narrow bands and too loud Bayes factors. The run uses the error model of "
            f"the highest mean evidence over the forms: {noise_name(comparison.noise.name)}."
        ),
        _evidence_table(comparison, means),
        *_summed_table(comparison),
        Text(
            "A texture and a step that were calibrated on keep the offset that their rows tell of; "
            "a new one draws a new one. An offset smooth in log h and a/pitch is borrowed from the "
            "neighbours instead; beyond the calibrated range of either it widens.",
            "note",
        ),
    ]
    return Section("Error models", "error-models", tuple(blocks))


def _evidence_table(comparison: Comparison, means: pd.DataFrame) -> Table:
    forms = [*forms_by_probability(comparison), *comparison.failures]
    usable = comparison.evidence[comparison.evidence["used"]].set_index(["form", "noise"])
    rows = []
    for mean in means.to_dict("records"):
        cells = [mean["noise"]]
        for form in forms:
            if (form, mean["noise"]) in usable.index:
                row = usable.loc[(form, mean["noise"])]
                cells.append(with_error(row["log_evidence"], row["log_evidence_se"]))
            else:
                cells.append(ABSENT)
        cells += [decimals(mean["log_mean_evidence"], 1), probability(mean["probability"])]
        rows.append(cells)
    return table(
        ["Error model", *map(form_name, forms), "ln of the mean", "Probability"],
        rows,
        "ln evidence of every form under every error model, and the log of its mean over the forms "
        "(a form without a usable evidence counts as zero). Error models that were not chosen: by "
        "importance sampling where near the best, else by Laplace's approximation, without an "
        "error; independent rows (iid) by quadrature. Names are those that --noise takes.",
        strong=(0,),
        wide=True,
    )


def _summed_table(comparison: Comparison) -> list[Table]:
    factors = comparison.bayes_factors
    rows = []
    for row in factors[factors["noise"] == SUMMED].to_dict("records"):
        ahead, behind = row["form_a"], row["form_b"]
        if row["ln_bf"] < 0:
            ahead, behind = behind, ahead
        rows.append(
            [
                f"{form_name(ahead)} over {form_name(behind)}",
                with_error(abs(row["ln_bf"]), row["ln_bf_se"]),
                decimals(abs(row["log10_bf"]), 2),
                said(row["reading"].partition(" (")[0] + " ").strip(),
            ]
        )
    if not rows:
        return []
    return [
        table(
            ["Pair", "ln BF", "log₁₀ BF", "Reading"],
            rows,
            "Bayes factors with the error models summed out, each as probable as the next: what "
            "the forms are worth whatever the errors are.",
            text=(0, 3),
        )
    ]
