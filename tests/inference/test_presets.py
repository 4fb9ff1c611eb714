import re

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes import InputError, Noise, generate
from ridgebayes.evidence.pairs import weigh_pairs
from ridgebayes.inference.presets import PRESETS
from ridgebayes.model.observations import Observations
from ridgebayes.simulate.solvers import LOAD_PRESETS


@pytest.mark.parametrize("name", ["best", None, ["quick"]])
def test_accuracy__of_another_name_is_refused(paper, name):
    words = f"accuracy: expected one of quick, standard, reference, got {name!r}"
    with pytest.raises(InputError, match=re.escape(words)):
        rb.calibrate(paper, "modified", accuracy=name)


@pytest.fixture(scope="module")
def exact(paper):
    """A hundred thousand draws of Hybrid's posterior."""
    found = weigh_pairs(Observations.from_table(paper), [rb.Hybrid()], [Noise()], seed=11)
    return found.posteriors(["hybrid"], "iid", 100_000)["hybrid"]["iid"]


def moments(x):
    return np.stack([x.mean(axis=0), x.std(axis=0), *np.quantile(x, (0.05, 0.95), axis=0)])


@pytest.mark.slow
@pytest.mark.parametrize("name", list(PRESETS))
@pytest.mark.parametrize("seed", [1, 2])
def test_accuracy__keeps_what_it_promises_of_posteriors_and_evidences(paper, exact, name, seed):
    wanted = PRESETS[name]
    data = Observations.from_table(paper)
    weighed = weigh_pairs(data, [rb.Hybrid()], [Noise()], seed=seed, accuracy=wanted)
    posterior = weighed.posteriors(["hybrid"], "iid", wanted.n_kept)["hybrid"]["iid"]
    found, theta = (one.model.to_theta(one.chains.u).reshape(-1, 3) for one in (posterior, exact))
    gap = (moments(found) - moments(theta)) / theta.std(axis=0)
    # The exact draws' own Monte Carlo error is 1/150 of an sd.
    assert np.abs(gap).max() < wanted.moment_error + 0.007
    # The evidence of the sweep by quadrature.
    assert abs(weighed.evidence["log_evidence"][0] - 83.387) < wanted.evidence_error


@pytest.mark.parametrize("name", list(PRESETS))
def test_accuracy__keeps_what_it_promises_of_loads(name):
    scene = rb.Scene.of([(0.022, 0.02), (0.012, 0.09), (0.04, 0.004)], p_over_E=0.02)
    exact = generate(scene, rel_tol=1e-12).column("p_over_E")
    found = generate(scene, accuracy=name).column("p_over_E")
    # The finest tolerance has an error of its own: rounding, 1e-13 of a load.
    assert np.abs(found / exact - 1).max() < LOAD_PRESETS[name].load_error + 1e-12
