"""The sections of a report in reading order: answer first, how it was reached after."""

from collections.abc import Iterator

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.inference.presets import QUICK
from ridgebayes.report.blocks import Section
from ridgebayes.report.checks import (
    checks_section,
    coverage_section,
    power_scaling_section,
)
from ridgebayes.report.costs import cost_section
from ridgebayes.report.error_models import error_models_section
from ridgebayes.report.evidence import evidence_section, prior_section
from ridgebayes.report.posterior import (
    coefficients_section,
    convergence_section,
    corner_section,
    trace_section,
)
from ridgebayes.report.predictions import (
    bands_section,
    errors_section,
    held_out_section,
    slopes_section,
    smooth_section,
)
from ridgebayes.report.reference import reference_section
from ridgebayes.report.scores import score_section
from ridgebayes.report.sources import (
    claims_section,
    data_section,
    reading_section,
    versions_section,
)


def contents(comparison: Comparison, reference: Comparison | None) -> tuple[Section, ...]:
    """Return every section that applies.

    Parameters
    ----------
    comparison : Comparison
        What to report.
    reference : Comparison or None
        Second comparison, on finite-element rows.

    Returns
    -------
    tuple of Section
        A section that does not apply is left out, or says why it is empty.
    """
    return tuple(section for section in _sections(comparison, reference) if section.blocks)


def _sections(comparison: Comparison, reference: Comparison | None) -> Iterator[Section]:
    yield evidence_section(comparison)
    yield error_models_section(comparison)
    yield data_section(comparison)
    yield coefficients_section(comparison)
    yield bands_section(comparison)
    yield held_out_section(comparison)
    yield coverage_section(comparison)
    yield errors_section(comparison)
    yield slopes_section(comparison)
    yield smooth_section(comparison)
    if reference is not None:
        yield reference_section(reference)
    yield claims_section(comparison)
    yield prior_section(comparison)
    yield power_scaling_section(comparison)
    yield score_section(comparison)
    yield checks_section(comparison)
    yield convergence_section(comparison)
    yield cost_section(comparison)
    yield corner_section(comparison)
    if comparison.accuracy != QUICK.name:  # which walks nowhere
        yield trace_section(comparison)
    yield reading_section(comparison)
    yield versions_section()
