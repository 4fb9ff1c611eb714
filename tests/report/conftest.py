"""Fixtures that the tests of the report share, beside those of all tests."""

from dataclasses import replace

import pytest

from ridgebayes.checks.report_data import report_data
from ridgebayes.report.figures.gallery import Gallery
from tests.once import once


@pytest.fixture(scope="session")
def gallery_of(tmp_path_factory):
    """What a report shows is made once, whichever worker asks first."""

    def gallery_of(name, comparison):
        return Gallery(once(tmp_path_factory, f"shown: {name}", lambda: report_data(comparison)))

    return gallery_of


@pytest.fixture(scope="session")
def gallery(gallery_of, comparison):
    """Figures of the embedded sweep: each is drawn once, for the pages and for its own tests."""
    return gallery_of("embedded", comparison)


@pytest.fixture(scope="session")
def second_gallery(gallery_of, reference):
    return gallery_of("reference", reference)


@pytest.fixture(scope="session")
def odd_gallery(gallery_of, odd):
    return gallery_of("odd", odd)


@pytest.fixture(scope="session")
def failed(comparison):
    """The comparison as it would be if one form had not been fitted."""
    fits = {name: fit for name, fit in comparison.fits.items() if name != "classic"}
    factors = comparison.bayes_factors
    return replace(
        comparison,
        fits=fits,
        evidence=comparison.evidence[comparison.evidence["form"] != "classic"],
        bayes_factors=factors[factors["form_a"] != "classic"],
        loo=comparison.loo[comparison.loo["form"] != "classic"],
        prior_sensitivity=comparison.prior_sensitivity.query("form != 'classic'"),
        failures={"classic": "no interior mode at <c> = 0"},
    )
