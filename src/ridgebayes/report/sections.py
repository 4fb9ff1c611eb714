"""The sections of a report in reading order: answer first, how it was reached after."""

import json
import math
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import replace

from ridgebayes.checks.report_data import ReportData
from ridgebayes.report import evidence, inputs, posteriors, predictions
from ridgebayes.report.blocks import Block, Folded, Heading, Picture, Section, Text, TextureFields
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.report.first_screen import first_screen
from ridgebayes.report.wording import decimals, say, with_error

_BlocksOf = Callable[[ReportData], Sequence[Block]]
_FINGERTIP = 8, 60  # radius in mm, modulus in kPa


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
    sections = []
    for title, anchor, parts in _SECTIONS:
        subject = reference if anchor == "reference" else gallery
        if subject is None:
            continue
        blocks: list[Block] = []
        for heading, blocks_of in parts:
            that_apply = _that_apply(blocks_of(subject.data), drawn)
            if heading and that_apply:
                blocks.append(Heading(heading))
            blocks += that_apply
        if blocks:
            sections.append(Section(title, anchor, blocks))
    return sections


def _that_apply(blocks: Sequence[Block], drawn: Mapping[bool, Container[str]]) -> list[Block]:
    """Return blocks without figures that do not apply, and details that are empty then."""
    kept: list[Block] = []
    for block in blocks:
        if isinstance(block, Folded):
            inner = _that_apply(block.blocks, drawn)
            kept += [replace(block, blocks=inner)] if inner else []
        elif not isinstance(block, Picture) or block.name in drawn[block.of_reference]:
            kept.append(block)
    return kept


def own_texture(data: ReportData) -> list[Block]:
    """Return fields for the reader's own texture, or why there are none."""
    table = data.own_texture.table
    if table is None:
        return [Text(say("no_own_texture", why=data.own_texture.why), "note")]
    # Initial values: a body such as a fingertip, with widths and a load in the calibrated ranges.
    ranges, (radius, modulus) = table["calibrated"], _FINGERTIP
    ridge, groove = (
        f"{1000 * radius * math.sqrt(math.prod(ranges[name])):.3g}"
        for name in ("a_over_R", "b_over_R")
    )
    load = f"{modulus * ranges['p_over_E_max'] / 2:.2g}"
    content = json.dumps(table, separators=(",", ":"))
    return [TextureFields(content, ridge, groove, load, f"{radius}", f"{modulus}")]


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
    details: list[Block] = [
        Picture("evidence", say("reference_evidence_caption"), of_reference=True)
    ]
    if len(reference.comparison.probabilities) > 1:
        details.append(evidence.pairs_table(reference))
    details += posteriors.coefficients_section(reference)[1:]
    details.append(Picture("percent-error", say("reference_errors_caption"), of_reference=True))
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


def _folded(title: str, blocks_of: _BlocksOf) -> tuple[str, _BlocksOf]:
    """Return a part that opens on demand."""
    return "", lambda data: [Folded(title, blocks_of(data))]


# Title and anchor of each section, and its parts: a heading, if any, and what makes its blocks.
_SECTIONS: tuple[tuple[str, str, Sequence[tuple[str, _BlocksOf]]], ...] = (
    ("Your own texture", "texture", [("", own_texture)]),
    (
        "Data and priors",
        "data",
        [
            ("", inputs.data_section),
            ("Priors", lambda data: [evidence.prior_table(data)]),
            _folded("Prior predictive check", posteriors.prior_check),
        ],
    ),
    (
        "Forms and evidence",
        "evidence",
        [
            ("", inputs.forms_section),
            ("Evidence", evidence.evidence_section),
            ("Prior sensitivity", evidence.prior_section),
            ("Error models", evidence.error_models_section),
            ("Coefficients", posteriors.coefficients_section),
        ],
    ),
    (
        "Predictions",
        "predictions",
        [
            ("", predictions.bands_section),
            ("Held-out rows", predictions.held_out_section),
            ("Coverage of the bands", predictions.coverage_section),
            _folded("K against pitch", predictions.slopes_section),
        ],
    ),
    (
        "Does the model hold?",
        "checks",
        [
            ("Posterior predictive check", posteriors.checks_section),
            ("Sense check", posteriors.sense_section),
            ("Load error of each form", predictions.errors_section),
            ("Cross-validation", predictions.score_section),
        ],
    ),
    (
        "How it was computed",
        "computation",
        [
            ("", inputs.goal_section),
            ("Convergence", posteriors.convergence_section),
            ("", posteriors.repeat_section),
            _folded(
                "Evidence by independent methods", lambda data: [evidence.agreement_table(data)]
            ),
            _folded("Sensitivity to prior and likelihood", posteriors.power_scaling_section),
            _folded("Accuracy and run time", inputs.cost_section),
            _folded("Posteriors", posteriors.corner_section),
        ],
    ),
    ("Finite-element reference", "reference", [("", reference_section)]),
    (
        "Appendix",
        "appendix",
        [_folded("Glossary", inputs.glossary_section), ("", inputs.versions_section)],
    ),
)
