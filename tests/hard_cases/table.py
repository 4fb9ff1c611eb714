"""All edge cases, area by area, in the order of the page."""

from tests.hard_cases import (
    determinism,
    evidence,
    faults,
    files,
    geometry,
    likelihood,
    prediction,
    sampling,
)
from tests.hard_cases.case import CASES, HardCase

AREAS = {
    "geometry": (geometry, "Geometry and forms"),
    "likelihood": (likelihood, "Likelihood"),
    "evidence": (evidence, "Evidence"),
    "sampling": (sampling, "Sampling"),
    "prediction": (prediction, "Prediction"),
    "files": (files, "Untrusted files"),
    "faults": (faults, "System failures"),
    "determinism": (determinism, "Reproducibility"),
}


def cases_of(area: str) -> list[HardCase]:
    """Return the cases of one area, as they stand in its module."""
    return [case for case in CASES if case.area == area]


def every_case() -> list[HardCase]:
    """Return every case of the table."""
    return [case for area in AREAS for case in cases_of(area)]
