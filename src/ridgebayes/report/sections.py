# ruff: noqa: RUF001  (typographic minus is meant: readers see it)
"""The sections of a report in reading order: answer first, how it was reached after."""

from collections.abc import Callable

from ridgebayes.checks.report_data import ReportData
from ridgebayes.report import evidence, inputs, posteriors, predictions, study
from ridgebayes.report.blocks import Block, Picture, Section, Table, Text
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.report.first_screen import first_screen
from ridgebayes.report.wording import decimals, with_error


def contents(gallery: Gallery, reference: Gallery | None) -> list[Section]:
    """Return every section that applies.

    Parameters
    ----------
    gallery : Gallery
        What to report, with its figures.
    reference : Gallery or None
        Second comparison, on finite-element rows.

    Returns
    -------
    list of Section
        Without figures that do not apply, and sections that are empty then.
    """
    drawn = {False: gallery, True: {} if reference is None else reference}
    found = []
    for title, anchor, blocks_of in _SECTIONS:
        subject = reference if blocks_of is reference_section else gallery
        blocks = [
            block
            for block in ([] if subject is None else blocks_of(subject.data))
            if not isinstance(block, Picture) or block.name in drawn[block.of_reference]
        ]
        if blocks:
            found.append(Section(title, anchor, blocks))
    return found


def reference_section(reference: ReportData) -> list[Block]:
    """Return the comparison on finite-element rows, of the first-principles form as well."""
    answer = first_screen(reference)
    blocks: list[Block] = [
        Text(
            "The same comparison on loads from finite-strain finite elements: this package's own, "
            "with loads of CalculiX held out. None of them came from the half-plane equation, so "
            "that equation is compared as well. Its only coefficient is a scale c that should be 1."
        ),
        Text(f"{answer.headline} {answer.sentence}", "strong"),
        *(Text(words, "note") for words in answer.cautions),
        *(Text(words, "warning") for words in answer.problems),
    ]
    if "half-plane" in reference.ranked:
        blocks.append(Text(_scale(reference)))
    blocks += [
        evidence.ranking_table(reference),
        Picture("evidence", "ln Bayes factors on the finite-element rows.", of_reference=True),
    ]
    if len(reference.comparison.probabilities) > 1:
        blocks.append(evidence.pairs_table(reference))
    blocks += [one for one in posteriors.coefficients_section(reference) if isinstance(one, Table)]
    caption = "100 (p form / p data − 1) on the finite-element rows, held-out repeats included."
    blocks.append(Picture("percent-error", caption, of_reference=True))
    return blocks


def _scale(reference: ReportData) -> str:
    summary = reference.comparison.fits["half-plane"].summary.set_index("parameter")
    mean, sd = float(summary["mean"].loc["c"]), float(summary["sd"].loc["c"])
    load = 100 * (mean**-2 - 1)
    return (
        f"Half-plane: c = {with_error(mean, sd, 6)}, where theory says 1. The difference is "
        f"{decimals(abs(mean - 1) / sd, 1)} posterior standard deviations, but only "
        f"{decimals(load, 2)} % in load."
    )


_SECTIONS: tuple[tuple[str, str, Callable[[ReportData], list[Block]]], ...] = (
    ("Evidence", "evidence", evidence.evidence_section),
    ("Error models", "error-models", evidence.error_models_section),
    ("Data", "data", inputs.data_section),
    ("Coefficients", "coefficients", posteriors.coefficients_section),
    ("Q against load", "bands", predictions.bands_section),
    ("Held-out rows", "held-out", predictions.held_out_section),
    ("Coverage of the bands", "coverage", predictions.coverage_section),
    ("Percent error of each form", "errors", predictions.errors_section),
    ("K against pitch", "slopes", predictions.slopes_section),
    ("Smooth cylinder against Hertz", "smooth", study.smooth_section),
    ("Finite-element reference", "reference", reference_section),
    ("The study's claims", "claims", study.claims_section),
    ("Prior sensitivity", "priors", evidence.prior_section),
    ("Sensitivity to prior and likelihood", "power-scaling", posteriors.power_scaling_section),
    ("Cross-validation", "loo", predictions.score_section),
    ("Predictive checks", "checks", posteriors.checks_section),
    ("Convergence", "convergence", posteriors.convergence_section),
    ("Accuracy and run time", "cost", inputs.cost_section),
    ("Posteriors", "posteriors", posteriors.corner_section),
    ("Traces", "traces", posteriors.trace_section),
    ("Glossary", "reading", inputs.glossary_section),
    ("Made with", "versions", inputs.versions_section),
)
