"""Expensive things that many tests look at and none changes: tables, fits, approximations."""

from types import MappingProxyType

import hypothesis
import pytest

import ridgebayes as rb
from ridgebayes.laplace import fit_laplace

# No clock in a test; and a test that fails today has to fail tomorrow.
hypothesis.settings.register_profile("steady", deadline=None, derandomize=True, database=None)
hypothesis.settings.load_profile("steady")


@pytest.fixture(scope="session")
def paper():
    return rb.paper_sweep()


@pytest.fixture(scope="session")
def fe_table():
    return rb.reference_fe()


@pytest.fixture(scope="session")
def fits(paper):
    """A calibrated fit of each printed form on the paper sweep, by name."""
    forms = (rb.Classic(), rb.PowerLaw(), rb.Modified(), rb.Hybrid())
    return MappingProxyType({form.name: rb.calibrate(paper, form, rng=1) for form in forms})


@pytest.fixture(scope="session")
def fe_fits(fe_table):
    """A calibrated fit of each form on the finite-element rows, by name."""
    forms = (rb.Classic(), rb.PowerLaw(), rb.Modified(), rb.Hybrid(), rb.HalfPlane())
    return MappingProxyType({form.name: rb.calibrate(fe_table, form, rng=1) for form in forms})


@pytest.fixture(scope="session")
def laplaces(fits):
    return MappingProxyType({name: fit_laplace(fit.model) for name, fit in fits.items()})


@pytest.fixture(scope="session")
def fe_laplaces(fe_fits):
    return MappingProxyType({name: fit_laplace(fit.model) for name, fit in fe_fits.items()})
