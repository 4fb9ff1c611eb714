# ruff: noqa: RUF001  (typographic minus is meant: readers see it)
"""The sections of a report in reading order: answer first, how it was reached after."""

from collections.abc import Iterator
from dataclasses import replace

from ridgebayes.checks.report_data import ReportData
from ridgebayes.report.blocks import Block, Picture, Section, Table, Text
from ridgebayes.report.evidence import (
    error_models_section,
    evidence_section,
    pairs_table,
    prior_section,
    ranking_table,
)
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.report.first_screen import first_screen
from ridgebayes.report.inputs import cost_section, data_section, glossary_section, versions_section
from ridgebayes.report.posteriors import (
    checks_section,
    coefficients_section,
    convergence_section,
    corner_section,
    power_scaling_section,
    trace_section,
)
from ridgebayes.report.predictions import (
    bands_section,
    coverage_section,
    errors_section,
    held_out_section,
    score_section,
    slopes_section,
)
from ridgebayes.report.study import study_sections
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
    for section in _sections(gallery.data, None if reference is None else reference.data):
        blocks = [
            block
            for block in section.blocks
            if not isinstance(block, Picture) or block.name in drawn[block.of_reference]
        ]
        if blocks:
            found.append(replace(section, blocks=blocks))
    return found


def _sections(data: ReportData, reference: ReportData | None) -> Iterator[Section]:
    smooth, claims = study_sections(data.study) if data.study is not None else (None, None)
    yield evidence_section(data)
    yield error_models_section(data)
    yield data_section(data)
    yield coefficients_section(data)
    yield bands_section(data)
    yield held_out_section(data)
    yield coverage_section(data)
    yield errors_section(data)
    yield slopes_section(data)
    if smooth is not None:
        yield smooth
    if reference is not None:
        yield reference_section(reference)
    if claims is not None:
        yield claims
    yield prior_section(data)
    yield power_scaling_section(data)
    yield score_section(data)
    yield checks_section(data)
    yield convergence_section(data)
    yield cost_section(data)
    yield corner_section(data)
    yield trace_section(data)
    yield glossary_section()
    yield versions_section()


def reference_section(reference: ReportData) -> Section:
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
        ranking_table(reference),
        Picture("evidence", "ln Bayes factors on the finite-element rows.", of_reference=True),
    ]
    if len(reference.comparison.probabilities) > 1:
        blocks.append(pairs_table(reference))
    blocks += [one for one in coefficients_section(reference).blocks if isinstance(one, Table)]
    caption = "100 (p form / p data − 1) on the finite-element rows, held-out repeats included."
    blocks.append(Picture("percent-error", caption, of_reference=True))
    return Section("Finite-element reference", "reference", blocks)


def _scale(reference: ReportData) -> str:
    summary = reference.comparison.fits["half-plane"].summary.set_index("parameter")
    mean, sd = float(summary["mean"].loc["c"]), float(summary["sd"].loc["c"])
    load = 100 * (mean**-2 - 1)
    return (
        f"Half-plane: c = {with_error(mean, sd, 6)}, where theory says 1. The difference is "
        f"{decimals(abs(mean - 1) / sd, 1)} posterior standard deviations, but only "
        f"{decimals(load, 2)} % in load."
    )
