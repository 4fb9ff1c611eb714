"""SciPy's frozen distributions, taken as those of the package."""

import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.request import Request


@pytest.mark.parametrize(
    "frozen",
    [
        stats.norm(1.3, 0.2),
        stats.norm(loc=1.3, scale=0.2),
        stats.lognorm(0.1, scale=1.382),
        stats.uniform(1, 2),
        stats.truncnorm(-1, 3, loc=1.3, scale=0.2),
        stats.gamma(40, scale=0.03),
        stats.halfnorm(scale=2),
    ],
    ids=lambda frozen: frozen.dist.name,
)
def test_scipy__densities_are_scipys(paper, frozen):
    prior = Request.of(paper, "hybrid", priors={"hybrid": {"c2": frozen}}).priors["hybrid"]["c2"]
    x = np.linspace(1.05, 1.6, 9)
    # Algebra: rounding.
    assert prior.log_pdf(x) == pytest.approx(frozen.logpdf(x), rel=1e-12)


@pytest.mark.parametrize(
    ("frozen", "words"),
    [
        (stats.t(4), r"priors: \[hybrid\] c1: expected one of scipy.stats' norm, .*, got t with"),
        (stats.lognorm(0.1, loc=1), "with loc = 0.*, got lognorm with loc = 1"),
        (stats.norm, "expected one of"),
        (stats.norm(1, -1), r"priors: \[hybrid\] c1: normal distribution: expected finite and > 0"),
    ],
)
def test_scipy__others_are_refused_by_name(paper, frozen, words):
    with pytest.raises(rb.InputError, match=words):
        rb.calibrate(paper, "hybrid", priors={"hybrid": {"c1": frozen}})
