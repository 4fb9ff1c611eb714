# ruff: noqa: RUF001  (typographic minus is meant: readers see it)
"""The sections of a report in reading order: answer first, how it was reached after."""

import json
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ridgebayes.checks.report_data import ReportData
from ridgebayes.report import evidence, inputs, posteriors, predictions
from ridgebayes.report.blocks import Block, Folded, Heading, Picture, Section, Text, TextureFields
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.report.first_screen import first_screen
from ridgebayes.report.wording import decimals, say, with_error


def contents(gallery: Gallery, reference: Gallery | None) -> list[Section]:
    """Return every section that applies.

    Parameters
    ----------
    gallery : Gallery
        Comparison to report, with its figures.
    reference : Gallery or None
        Second comparison, on finite-element rows.

    Returns
    -------
    list of Section
        Without figures that do not apply, and sections that are empty then.
    """
    drawn: dict[bool, Container[str]] = {
        False: gallery,
        True: {} if reference is None else reference,
    }
    found = []
    for title, anchor, blocks_of in _SECTIONS:
        subject = reference if blocks_of is reference_section else gallery
        blocks = _that_apply([] if subject is None else blocks_of(subject.data), drawn)
        if blocks:
            found.append(Section(title, anchor, blocks))
    return found


def _that_apply(blocks: Sequence[Block], drawn: Mapping[bool, Container[str]]) -> list[Block]:
    """Return blocks without figures that do not apply, and parts without what is left empty."""
    found: list[Block] = []
    for block in blocks:
        if isinstance(block, Folded):
            inner = _that_apply(block.blocks, drawn)
            if inner:
                found.append(replace(block, blocks=inner))
        elif not isinstance(block, Picture) or block.name in drawn[block.of_reference]:
            if isinstance(block, Heading) and found and isinstance(found[-1], Heading):
                found.pop()  # nothing stands under it
            found.append(block)
    while found and isinstance(found[-1], Heading):
        found.pop()
    return found


def own_texture(data: ReportData) -> list[Block]:
    """Return fields for the reader's own texture, or why there are none."""
    found = data.own_texture
    if found.table is None:
        return [Text(f"This page cannot predict textures of your own: {found.why}.", "note")]
    # Initial values: a body such as a fingertip, with widths and a load in the calibrated ranges.
    known = found.table["calibrated"]
    ridge, groove = (float(np.sqrt(np.prod(known[name]))) for name in ("a_over_R", "b_over_R"))
    radius, modulus = 8, 60
    return [
        TextureFields(
            json.dumps(found.table, separators=(",", ":")),
            f"{1000 * radius * ridge:.3g}",
            f"{1000 * radius * groove:.3g}",
            f"{modulus * known['p_over_E_max'] / 2:.2g}",
            str(radius),
            str(modulus),
        )
    ]


def reference_section(reference: ReportData) -> list[Block]:
    """Return the comparison on finite-element rows, of the first-principles form as well."""
    answer = first_screen(reference)
    blocks: list[Block] = [
        Text(say("reference")),
        Text(" ".join([answer.headline, *answer.sentences[1:2]]), "strong"),
        *(Text(words, "note") for words in answer.cautions),
        *(Text(words, "warning") for words in answer.problems),
    ]
    if "half-plane" in reference.ranked:
        blocks.append(Text(_scale(reference)))
    caption = "100 (p form / p data − 1) on the finite-element rows, held-out repeats included."
    details: list[Block] = [
        Picture("evidence", "ln Bayes factors on the finite-element rows.", of_reference=True),
    ]
    if len(reference.comparison.probabilities) > 1:
        details.append(evidence.pairs_table(reference))
    details += posteriors.coefficients_section(reference)[1:]
    details.append(Picture("percent-error", caption, of_reference=True))
    return [*blocks, evidence.ranking_table(reference), Folded("Details", details)]


def _scale(reference: ReportData) -> str:
    summary = reference.comparison.fits["half-plane"].summary.set_index("parameter")
    mean, sd = float(summary["mean"].loc["c"]), float(summary["sd"].loc["c"])
    load = 100 * (mean**-2 - 1)
    return say(
        "scale",
        c=with_error(mean, sd, 6),
        n_sd=decimals(abs(mean - 1) / sd, 1),
        load=decimals(load, 2),
    )


def data_and_priors(data: ReportData) -> list[Block]:
    """Return what went in: rows, priors, and what the priors say before the rows."""
    return [
        *inputs.data_section(data),
        Heading("Priors"),
        evidence.prior_table(data),
        Folded("Prior predictive check", posteriors.prior_check(data)),
    ]


def forms_and_evidence(data: ReportData) -> list[Block]:
    """Return the forms, their evidence, and what it owes to priors and error models."""
    return [
        *inputs.forms_section(data),
        Heading("Evidence"),
        *evidence.evidence_section(data),
        Heading("Prior sensitivity"),
        *evidence.prior_section(data),
        Heading("Error models"),
        *evidence.error_models_section(data),
        Heading("Coefficients"),
        *posteriors.coefficients_section(data),
    ]


def predictions_section(data: ReportData) -> list[Block]:
    """Return bands, held-out rows, coverage, and K against pitch."""
    return [
        *predictions.bands_section(data),
        Heading("Held-out rows"),
        *predictions.held_out_section(data),
        Heading("Coverage of the bands"),
        *predictions.coverage_section(data),
        Folded("K against pitch", predictions.slopes_section(data)),
    ]


def model_checks(data: ReportData) -> list[Block]:
    """Return what tells whether the model holds."""
    return [
        Heading("Posterior predictive check"),
        *posteriors.checks_section(data),
        Heading("Sense check"),
        *posteriors.sense_section(data),
        Heading("Load error of each form"),
        *predictions.errors_section(data),
        Heading("Cross-validation"),
        *predictions.score_section(data),
    ]


def computation(data: ReportData) -> list[Block]:
    """Return how the posteriors were drawn, and what they depend on."""
    return [
        *inputs.goal_section(data),
        Heading("Convergence"),
        *posteriors.convergence_section(data),
        *posteriors.repeat_section(data),
        Folded("Evidence by independent methods", [evidence.agreement_table(data)]),
        Folded("Sensitivity to prior and likelihood", posteriors.power_scaling_section(data)),
        Folded("Accuracy and run time", inputs.cost_section(data)),
        Folded("Posteriors", posteriors.corner_section(data)),
    ]


def appendix(data: ReportData) -> list[Block]:
    """Return words and versions."""
    return [
        Folded("Glossary", inputs.glossary_section(data)),
        *inputs.versions_section(data),
    ]


_SECTIONS: tuple[tuple[str, str, Callable[[ReportData], list[Block]]], ...] = (
    ("Your own texture", "texture", own_texture),
    ("Data and priors", "data", data_and_priors),
    ("Forms and evidence", "evidence", forms_and_evidence),
    ("Predictions", "predictions", predictions_section),
    ("Does the model hold?", "checks", model_checks),
    ("How it was computed", "computation", computation),
    ("Finite-element reference", "reference", reference_section),
    ("Appendix", "appendix", appendix),
)
