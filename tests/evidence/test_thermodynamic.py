import numpy as np
import pytest

from ridgebayes.evidence.thermodynamic import thermodynamic_evidence


@pytest.mark.parametrize("name", ["modified", "hybrid"])
def test_thermodynamic__is_the_quadratures_evidence(fits, name):
    # References: log evidences of the 41 rows by quadrature, printed to 1e-4 and 1e-3.
    reference = {"modified": 78.8628, "hybrid": 83.387}[name]
    coarse, fine = (
        thermodynamic_evidence(fits[name].model, n_temperature=n, seed=1).value for n in (16, 64)
    )
    # Discretisation: the midpoint rule's error falls by 16 from 16 temperatures to 64.
    assert fine == pytest.approx(reference, abs=0.1)
    assert abs(fine - reference) < 0.5 * abs(coarse - reference) + 0.05


def test_thermodynamic__has_the_error_of_its_draws(fits):
    values = [
        thermodynamic_evidence(fits["modified"].model, n_temperature=16, n_draw=500, seed=seed)
        for seed in range(6)
    ]
    spread = max(one.value for one in values) - min(one.value for one in values)
    # Monte Carlo: the range of six is 2.5 sds, and seven would be one in 10,000.
    assert 0.3 * values[0].se < spread < 7 * values[0].se


def test_thermodynamic__claims_the_error_that_seeds_spread_by(fits):
    found = [
        thermodynamic_evidence(fits["modified"].model, n_temperature=64, n_draw=100, seed=seed)
        for seed in range(8)
    ]
    spread = np.std([one.value for one in found], ddof=1)
    claimed = np.mean([one.se for one in found])
    # Monte Carlo: the spread of eight is known to 27 %; the limits are four of that, and a fifth.
    assert 0.2 * claimed < spread < 2.1 * claimed
