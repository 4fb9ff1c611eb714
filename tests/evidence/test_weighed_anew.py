"""Forms weighed anew under another prior of the error models, against one dimension by hand."""

from functools import partial

import numpy as np
import pytest
from scipy.special import logsumexp

import ridgebayes as rb
from ridgebayes.distributions.distribution import HalfNormal
from ridgebayes.evidence import quadrature_evidence
from ridgebayes.evidence.error_models import weigh_error_models
from ridgebayes.evidence.weighed_anew import weighed_anew
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations


@pytest.mark.parametrize("priors", [{}, {"noise": {"sigma": HalfNormal(0.02)}}])
def test_evidences__are_those_of_models_with_that_prior(priors):
    data = Observations.from_table(rb.paper_sweep())
    forms, noises = [rb.Classic(), rb.Modified()], [Noise("iid"), Noise("texture")]
    weigh = partial(weigh_error_models, data, noises=noises, seed=2)
    found = weighed_anew(weigh, forms, priors, "sigma", 0.3, ["modified"])
    assert list(found) == ["modified"]
    scale = 0.3 * (0.02 if priors else 0.05)
    values = []
    for noise in noises:
        model = Model(data, rb.Modified(), noise, {"sigma": HalfNormal(scale)})
        values.append(quadrature_evidence(model.log_density, fit_laplace(model), tol=1e-3).value)
    assert np.ptp(values) < 10  # both are seen
    # Monte Carlo: standard error of a quick run.
    assert abs(found["modified"] - logsumexp(values)) < 4 * 0.03
