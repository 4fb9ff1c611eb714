"""What the tests of the report share beside what all tests do."""

from dataclasses import replace

import pytest


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
