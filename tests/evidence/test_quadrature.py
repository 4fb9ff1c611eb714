import numpy as np
import pytest
from scipy import integrate, stats

from ridgebayes.evidence import quadrature_evidence
from ridgebayes.inference.laplace import fit_laplace
from ridgebayes.model.forms import Hybrid, Modified
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations

# Reference: log evidence of the 41 rows, iid, default priors; independent code, printed to 1e-4.
KNOWN = {"hybrid": 83.3869, "modified": 78.8628, "classic": 19.1987}


@pytest.mark.parametrize("name", KNOWN)
def test_quadrature_evidence__of_the_sweep_is_the_reference_value(fits, laplaces, name):
    found = quadrature_evidence(fits[name].model.log_density, laplaces[name])
    assert found.ok
    assert found.method == "quadrature"
    assert found.value == pytest.approx(KNOWN[name], abs=1e-4)  # printed digits
    assert 0 < found.se < 1e-6


@pytest.mark.parametrize(
    "name",
    ["modified", *(pytest.param(one, marks=pytest.mark.long) for one in ("classic", "half-plane"))],
)
def test_quadrature_evidence__is_scipys_double_integral(fe_models, fe_laplaces, name):
    # In theta itself, not in unconstrained or whitened coordinates.
    model, laplace = fe_models[name], fe_laplaces[name]
    peak = float(model.log_density(laplace.mode))
    c, sigma = model.to_theta(laplace.mode)

    def density(c, sigma):
        theta = np.array([c, sigma])
        return float(np.exp(model.log_prior(theta) + model.log_likelihood(theta) - peak))

    # Given sigma, log c is known to sigma/(2 sqrt(n)): twelve of those either way.
    def reach(sigma):
        known = np.sqrt(np.mean(model.data.rel_se**2))
        return np.exp(6 * np.hypot(sigma, known) / np.sqrt(len(model.data)))

    total = sum(
        integrate.dblquad(
            density, s0, s1, lambda s: c / reach(s), lambda s: c * reach(s), epsabs=0, epsrel=1e-6
        )[0]
        for s0, s1 in ((0, sigma / 3), (sigma / 3, 3 * sigma), (3 * sigma, 20 * sigma))
    )
    found = quadrature_evidence(model.log_density, laplace)
    # Discretisation: 1e-6 each, and what lies beyond the limits.
    assert found.value == pytest.approx(peak + np.log(total), abs=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_quadrature_evidence__of_one_row_without_known_error_is_the_closed_form_over_sigma(
    observed, seed
):
    # That row alone lets sigma go to zero, where it alone says what c is.
    rng = np.random.default_rng(seed)
    Q = np.array([4, 6, 8])
    rel_se = np.where(np.arange(3) == rng.integers(3), 0.0, 0.03)
    log_shape = 2 * np.log((Q / 2 - 1) * 0.042)
    log_load = log_shape - 2 * np.log(1.35) + 0.03 * rng.standard_normal(3)
    model = Model(observed(0 * Q, Q, log_load, rel_se=rel_se), Modified())
    found = quadrature_evidence(model.log_density, fit_laplace(model))
    # log c is normal, and so are the rows given sigma, which is summed over in its logarithm.
    log_sigma = np.arange(-18.0, 0.5, 0.01)
    sigma = np.exp(log_sigma)
    centre, prior = log_shape - 2 * np.log(1.382), stats.halfnorm(scale=0.05).pdf(sigma)
    given = [
        stats.multivariate_normal(centre, 4 * 0.1**2 + np.diag(s * s + rel_se**2)).pdf(log_load)
        for s in sigma
    ]
    exact = np.log(0.01 * (given * prior * sigma).sum())
    # Discretisation: 1e-6 of the quadrature, 1e-7 of the sum and the tail below exp(-18).
    assert found.value == pytest.approx(exact, abs=2e-6)


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_quadrature_evidence__of_a_normal_is_exact(n, affine):
    rng = np.random.default_rng(n)
    factor = np.tril(rng.uniform(-0.5, 0.5, (n, n)), -1) + np.diag(rng.uniform(0.1, 3, n))
    mean = rng.standard_normal(n)
    truth = stats.multivariate_normal(mean, factor @ factor.T)
    # The approximation is off by half an sd and a fifth in width.
    laplace = affine(mean + 0.5 * factor[:, 0], 1.2 * factor)
    found = quadrature_evidence(lambda u: 3.25 + np.atleast_1d(truth.logpdf(u)), laplace)
    assert found.ok
    assert found.value == pytest.approx(3.25, abs=1e-7)  # discretisation: better than tol
    assert 1e-12 <= found.se < 1e-6


def test_quadrature_evidence__of_heavy_tails_widens_its_box(affine):
    # Logistic: its tails fall off as exp(-|u|), 24 and more beyond the first box of 6.
    truth = stats.logistic(1.0, 1.0)
    found = quadrature_evidence(lambda u: truth.logpdf(u[:, 0]), affine([0.0], [[1.0]]))
    assert found.value == pytest.approx(0, abs=1e-6)  # discretisation: tol


@pytest.mark.parametrize("wide", [0, 1])
def test_quadrature_evidence__of_heavy_tails_along_one_axis_widens_that_one(wide, affine):
    heavy, light = stats.logistic(1.0, 1.0), stats.norm(0.5, 1.0)

    def log_density(u):
        return heavy.logpdf(u[:, wide]) + light.logpdf(u[:, 1 - wide])

    found = quadrature_evidence(log_density, affine([0.0, 0.0], np.eye(2)))
    assert found.value == pytest.approx(0, abs=1e-6)  # discretisation: tol


def test_quadrature_evidence__says_so_where_the_tails_do_not_fall_off(affine):
    found = quadrature_evidence(lambda u: -0.01 * np.abs(u[:, 0]), affine([0.0], [[1.0]]))
    assert not found.ok
    assert np.isnan(found.value)
    assert "does not fall off within 200 sds" in found.status


@pytest.mark.parametrize("side", [-1, 1])
def test_quadrature_evidence__says_so_where_one_tail_does_not_fall_off(side, affine):
    def log_density(u):
        x = side * u[:, 0]
        return np.where(x > 0, -0.01 * x, -0.5 * x**2)

    found = quadrature_evidence(log_density, affine([0.0], [[1.0]]))
    assert np.isnan(found.value)
    assert "does not fall off within 200 sds" in found.status


def test_quadrature_evidence__finds_a_ridge_that_slips_through_the_faces_of_its_first_box(affine):
    # Along the ridge 6 is three sds, and no point of a face lies on it: the box looks wide enough.
    along, across = stats.norm(0, 2), stats.norm(0, 0.16)

    def log_density(u):
        return along.logpdf(u[:, 0]) + across.logpdf(u[:, 1] - 0.5 * u[:, 0])

    found = quadrature_evidence(log_density, affine([0.0, 0.0], np.eye(2)), tol=1e-3)
    assert found.ok
    # Discretisation: tol; what three sds leave out is 2.7e-3.
    assert found.value == pytest.approx(0, abs=1e-3)


def test_quadrature_evidence__widens_a_box_that_a_tail_leaves_by_a_corner(affine):
    along, across = stats.logistic(0, 0.8), stats.norm(0, 0.18)

    def log_density(u):
        return along.logpdf((u[:, 0] + u[:, 1]) / 2**0.5) + across.logpdf(
            (u[:, 0] - u[:, 1]) / 2**0.5
        )

    # Seen at once, or found on the way with a far finer grid.
    found = quadrature_evidence(log_density, affine([0.0, 0.0], np.eye(2)), points_max=200_000)
    assert found.ok
    assert found.value == pytest.approx(0, abs=1e-6)  # discretisation: tol


def test_quadrature_evidence__refuses_more_than_four_parameters(fits, laplaces):
    found = quadrature_evidence(fits["power-law"].model.log_density, laplaces["power-law"])
    assert (found.value, found.se) == (pytest.approx(np.nan, nan_ok=True),) * 2
    assert found.status == "10 parameters; quadrature is for up to four"


def test_quadrature_evidence__says_so_where_the_tolerance_needs_too_many_points(affine):
    def cusp(u):  # no derivative at its peak: converges slowly
        return -3 * np.abs(u).sum(axis=1)

    found = quadrature_evidence(cusp, affine([0.05, 0.0], np.eye(2)), tol=1e-12, points_max=500)
    assert not found.ok
    assert found.status == "the log evidence still changes by more than 1e-12"


def test_quadrature__settles_for_three_rows_of_two_coefficients(paper):
    # One misfit is left: sigma's density ends abruptly towards zero.
    data = Observations.from_table(paper)
    first = [np.flatnonzero(data.texture == j)[0] for j in range(3)]
    model = Model(data.take(np.isin(np.arange(len(data)), first)), Hybrid())
    found = quadrature_evidence(model.log_density, fit_laplace(model))
    assert found.ok
    # Reference: the same integral about one fixed centre, not turned, at half the step.
    assert found.value == pytest.approx(4.2572780251, abs=1e-6)
