"""Comparisons that the tests of figures, claims and reports look at and none changes."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb


@pytest.fixture(scope="session")
def comparison(paper):
    return rb.compare(paper, rng=0)


@pytest.fixture(scope="session")
def reference(fe_table):
    forms = [rb.Classic(), rb.PowerLaw(), rb.Modified(), rb.Hybrid(), rb.HalfPlane()]
    return rb.compare(fe_table, forms, rng=0)


@pytest.fixture(scope="session")
def odd_table():
    """One texture of a hostile name, loads of its own, rows that failed and rows held out."""
    q = np.arange(4, 18, 2)
    s = (q - 2) / 70 * (1 + 0.02 * np.cos(q))
    frame = pd.DataFrame(
        {
            "a_over_R": 0.02,
            "b_over_R": 0.021,
            "Q": q,
            "p_over_E": s**2,
            "texture": "<script>alert('$x$')</script> & | *",
            "role": ["calibration"] * 5 + ["held-out"] * 2,
            "solver": "my <b>solver</b>",
            "status": "ok",
        }
    )
    failed = frame.tail(1).assign(Q=20, p_over_E=np.nan, status="diverged <i>at</i> step 3")
    return rb.ContactTable.from_frame(pd.concat([frame, failed]), where="/home/me/<odd>.csv")


@pytest.fixture(scope="session")
def odd(odd_table):
    return rb.compare(odd_table, [rb.Modified(), rb.PowerLaw()], rng=3)


@pytest.fixture(scope="session")
def single(odd_table):
    """One form, sampled for too short a time to have converged."""
    settings = rb.SampleSettings(n_step_max=20)
    return rb.compare(odd_table, [rb.Modified()], rng=3, settings=settings)


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
