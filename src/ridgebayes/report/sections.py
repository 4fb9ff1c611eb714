"""Sections of a report in reading order: first the answer, then how it was obtained."""

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
_FINGERTIP_MM_KPA = 8, 60  # radius in mm, modulus in kPa


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
        Figures that do not apply are left out, and so are sections that become empty.
    """
    drawn: dict[bool, Container[str]] = {False: gallery, True: reference or {}}
    sections = []
    for anchor, title in _TITLES.items():
        subject = reference if anchor == "reference" else gallery
        if subject is None:
            continue
        blocks: list[Block] = []
        for section, heading, blocks_of in _PARTS:
            if section == anchor and (kept := _applicable(blocks_of(subject.data), drawn)):
                blocks += [Heading(heading), *kept] if heading else kept
        if blocks:
            sections.append(Section(title, anchor, blocks))
    return sections


def _applicable(blocks: Sequence[Block], drawn: Mapping[bool, Container[str]]) -> list[Block]:
    """Return blocks without figures that do not apply, and without details that become empty."""
    kept: list[Block] = []
    for block in blocks:
        if isinstance(block, Folded):
            inner = _applicable(block.blocks, drawn)
            kept += [replace(block, blocks=inner)] if inner else []
        elif not isinstance(block, Picture) or block.name in drawn[block.of_reference]:
            kept.append(block)
    return kept


def own_texture(data: ReportData) -> list[Block]:
    """Return input fields for the reader's texture, or the reason why there are none."""
    table = data.own_texture.table
    if table is None:
        return [Text(say("no_own_texture", why=data.own_texture.why), "note")]
    # Initial values describe a fingertip, with widths and a load in the calibrated ranges.
    ranges, (radius, modulus) = table["calibrated"], _FINGERTIP_MM_KPA
    ridge, groove = (
        f"{1000 * radius * math.sqrt(math.prod(ranges[name])):.3g}"
        for name in ("a_over_R", "b_over_R")
    )
    load = f"{modulus * ranges['p_over_E_max'] / 2:.2g}"
    content = json.dumps(table, separators=(",", ":"))
    return [TextureFields(content, ridge, groove, load, f"{radius}", f"{modulus}")]


def reference_section(reference: ReportData) -> list[Block]:
    """Return the comparison on finite-element rows, which includes the half-plane form."""
    answer = first_screen(reference)
    blocks: list[Block] = [
        Text(say("reference")),
        Text(" ".join([answer.headline, *answer.sentences[1:2]]), "strong"),
        *(Text(words, "note") for words in answer.cautions),
        *(Text(words, "warning") for words in answer.problems),
    ]
    if "half-plane" in reference.ranked:
        blocks.append(Text(_scale(reference)))
    several = len(reference.comparison.probabilities) > 1
    details: list[Block] = [
        Picture("evidence", say("reference_evidence_caption"), of_reference=True),
        *([evidence.pairs_table(reference)] if several else []),
        *posteriors.coefficients_section(reference)[1:],
        Picture("percent-error", say("reference_errors_caption"), of_reference=True),
    ]
    return [*blocks, evidence.ranking_table(reference), Folded("Details", details)]


def _scale(reference: ReportData) -> str:
    summary = reference.comparison.fits["half-plane"].summary.set_index("parameter")
    mean, sd = float(summary["mean"].loc["c"]), float(summary["sd"].loc["c"])
    load = 100 * (mean**-2 - 1)
    n_sd = decimals(abs(mean - 1) / sd, 1)
    return say("scale", c=with_error(mean, sd, 6), n_sd=n_sd, load=decimals(load, 2))


def _folded(title: str, blocks_of: _BlocksOf) -> _BlocksOf:
    """Return a part whose blocks open on demand."""
    return lambda data: [Folded(title, blocks_of(data))]


_TITLES = {
    "texture": "Your own texture",
    "data": "Data and priors",
    "evidence": "Forms and evidence",
    "predictions": "Predictions",
    "checks": "Does the model hold?",
    "computation": "How it was computed",
    "reference": "Finite-element reference",
    "appendix": "Appendix",
}
# Parts in reading order: section, heading if any, and function that returns the blocks.
_PARTS: tuple[tuple[str, str, _BlocksOf], ...] = (
    ("texture", "", own_texture),
    ("data", "", inputs.data_section),
    ("data", "Priors", lambda data: [evidence.prior_table(data)]),
    ("data", "", _folded("Prior predictive check", posteriors.prior_check)),
    ("evidence", "", inputs.forms_section),
    ("evidence", "Evidence", evidence.evidence_section),
    ("evidence", "Prior sensitivity", evidence.prior_section),
    ("evidence", "Error models", evidence.error_models_section),
    ("evidence", "Coefficients", posteriors.coefficients_section),
    ("predictions", "", predictions.bands_section),
    ("predictions", "Held-out rows", predictions.held_out_section),
    ("predictions", "Coverage of the bands", predictions.coverage_section),
    ("predictions", "", _folded("K against pitch", predictions.slopes_section)),
    ("checks", "Posterior predictive check", posteriors.checks_section),
    ("checks", "Sense check", posteriors.sense_section),
    ("checks", "Load error of each form", predictions.errors_section),
    ("checks", "Cross-validation", predictions.score_section),
    ("computation", "", inputs.goal_section),
    ("computation", "Convergence", posteriors.convergence_section),
    ("computation", "", posteriors.repeat_section),
    ("computation", "", _folded("Evidence by independent methods", evidence.agreement_section)),
    ("computation", "", _folded("Sensitivity to prior and likelihood", posteriors.power_section)),
    ("computation", "", _folded("Accuracy and run time", inputs.cost_section)),
    ("computation", "", _folded("Posteriors", posteriors.corner_section)),
    ("reference", "", reference_section),
    ("appendix", "", _folded("Glossary", inputs.glossary_section)),
    ("appendix", "", inputs.versions_section),
)
