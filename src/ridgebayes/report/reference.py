# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""The section on the finite-element rows, where the first-principles form stands trial as well."""

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import problems
from ridgebayes.report.blocks import Picture, Section, Table, Text
from ridgebayes.report.evidence import pairs_table, ranking_table
from ridgebayes.report.numbers import decimals, with_error
from ridgebayes.report.posterior import coefficients_section
from ridgebayes.report.verdict import verdict


def reference_section(reference: Comparison) -> Section:
    """Return the comparison on finite-element rows in one section."""
    answer = verdict(reference)
    blocks: list[Text | Table | Picture] = [
        Text(
            "The same comparison on loads from finite-strain finite elements: this package's own, "
            "with loads of CalculiX held out beside them. None of them came from the half-plane "
            "equation, so here that equation, which has no coefficient to fit but a scale c that "
            "should be 1, is compared as well."
        ),
        Text(f"{answer.headline} {answer.sentence}", "strong"),
        *(Text(words, "note") for words in answer.cautions),
        *(Text(words, "warning") for words in problems(reference)),
    ]
    if "half-plane" in reference.fits:
        blocks.append(Text(_scale(reference)))
    blocks += [
        ranking_table(reference),
        Picture(reference, "evidence", "ln Bayes factors on the finite-element rows."),
    ]
    if len(reference.probabilities) > 1:
        blocks.append(pairs_table(reference))
    blocks += [
        block for block in coefficients_section(reference).blocks if isinstance(block, Table)
    ]
    blocks.append(
        Picture(
            reference,
            "percent-error",
            "100 (p form / p data − 1) on the finite-element rows, held-out repeats included.",
        )
    )
    return Section("Finite-element reference", "reference", tuple(blocks))


def _scale(reference: Comparison) -> str:
    summary = reference.fits["half-plane"].summary.set_index("parameter")
    mean, sd = float(summary["mean"].loc["c"]), float(summary["sd"].loc["c"])
    load = 100 * (mean**-2 - 1)
    return (
        f"Half-plane: c = {with_error(mean, sd, 6)} where theory says 1: "
        f"{decimals(abs(mean - 1) / sd, 1)} posterior standard deviations away, but only "
        f"{decimals(load, 2)} % in load."
    )
