import emcee
import numpy as np
import pytest
from scipy import stats

from ridgebayes.autocorrelation import autocorrelation_time
from ridgebayes.moves import student_independence

N_STEP, N_WALKER = 1_500, 64


def worst_z(move, log_density, exact, start, seed=1):
    """Largest |estimate - exact| of E[x] and E[x^2], in Monte Carlo standard errors."""
    n_dim = start.shape[1]
    sampler = emcee.EnsembleSampler(len(start), n_dim, log_density, moves=move, vectorize=True)
    state = emcee.State(start)
    state.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(state, N_STEP + 200)
    x = sampler.get_chain(discard=200)
    worst = 0.0
    for power, moments in zip((1, 2), exact, strict=True):
        values = x**power
        ess = values.shape[0] * values.shape[1] / autocorrelation_time(values)
        se = values.std(axis=(0, 1)) / np.sqrt(ess)
        worst = max(worst, np.abs((values.mean(axis=(0, 1)) - moments) / se).max())
    return worst


def normal_check(move):
    """A standard normal of five dimensions, started from exact draws of it."""
    start = np.random.default_rng(0).standard_normal((N_WALKER, 5))
    return worst_z(move, lambda z: -0.5 * (z * z).sum(axis=1), (np.zeros(5), np.ones(5)), start)


def skewed_check(move):
    """Two gamma variables by their logarithms: x = log g, E[x] and E[x^2] by quadrature."""
    shape = np.array([6.0, 12.0])
    oracle = [stats.loggamma(k) for k in shape]
    moments = np.array([[d.moment(1), d.moment(2)] for d in oracle]).T
    centre, sd = moments[0], np.sqrt(moments[1] - moments[0] ** 2)
    start = (np.log(np.random.default_rng(0).gamma(shape, size=(N_WALKER, 2))) - centre) / sd

    def log_density(z):
        x = centre + sd * z
        return (shape * x - np.exp(x)).sum(axis=1)

    return worst_z(move, log_density, (np.zeros(2), np.ones(2)), start)


OURS = {
    "independence": lambda: emcee.moves.MHMove(student_independence()),
    "differential evolution": emcee.moves.DEMove,
    "mix": lambda: [(emcee.moves.MHMove(student_independence()), 0.8), (emcee.moves.DEMove(), 0.2)],
}


@pytest.mark.parametrize("check", [normal_check, skewed_check])
@pytest.mark.parametrize("name", OURS)
def test_move__alone_and_in_the_mix_keeps_means_and_spreads(name, check):
    assert check(OURS[name]()) < 4  # Monte Carlo: the largest of ten or four, in standard errors


def test_move__a_wrong_one_fails_the_same_check():
    # emcee 3.1.6's DESnookerMove draws sds that are a third too small.
    assert normal_check(emcee.moves.DESnookerMove()) > 10


def test_student_independence__candidates_are_students_t():
    propose = student_independence(df=7.0, scale=1.3)
    candidates, _ = propose(np.zeros((20_000, 3)), np.random.RandomState(2))
    for column in candidates.T / 1.3:
        # Monte Carlo: Kolmogorov-Smirnov, p above 1e-4 (3.9 standard errors) at a fixed seed.
        assert stats.kstest(column, stats.t(7).cdf).pvalue > 1e-4


def test_student_independence__ratio_is_that_of_the_proposals_densities():
    propose = student_independence(df=7.0, scale=1.3)
    old = np.random.default_rng(3).standard_normal((50, 3))
    new, log_ratio = propose(old, np.random.RandomState(2))
    oracle = stats.multivariate_t(np.zeros(3), 1.3**2 * np.eye(3), df=7.0)
    expected = oracle.logpdf(old) - oracle.logpdf(new)
    np.testing.assert_allclose(log_ratio, expected, rtol=1e-9, atol=1e-11)  # algebra


def test_student_independence__remembers_nothing_of_where_walkers_stand():
    propose = student_independence()
    here, _ = propose(np.zeros((5, 2)), np.random.RandomState(1))
    there, _ = propose(np.full((5, 2), 9.0), np.random.RandomState(1))
    assert here.tolist() == there.tolist()
