import numpy as np
import pytest
from scipy import stats

import ridgebayes as rb
from ridgebayes.errors import InputError
from ridgebayes.predict.extrapolation import LOAD, RIDGE
from ridgebayes.predict.load_draws import survival

# Two loads: P(Q >= 2), P(Q >= 4), ... typed by hand. All numbers are exact in binary.
SURVIVAL = np.array([[1.0, 0.75, 0.25, 0.0], [1.0, 1.0, 0.5, 0.125]])
Q = rb.QDistribution(SURVIVAL, np.array([False, True]), 6, "simulation")


def random_distribution(seed, n=50, n_step=8):
    steps = np.sort(np.random.default_rng(seed).random((n, n_step)), axis=1)[:, ::-1]
    steps[:, 0] = 1
    return rb.QDistribution(steps, np.zeros(n, bool), 100, "simulation")


def test_at_least__counts_odd_numbers_up_and_ends_at_one_and_zero():
    assert Q.at_least(4).tolist() == [0.75, 1.0]
    assert Q.at_least(5).tolist() == Q.at_least(6).tolist() == [0.25, 0.5]
    assert Q.at_least(0).tolist() == Q.at_least(2).tolist() == [1.0, 1.0]
    assert Q.at_least(10).tolist() == [0.0, 0.0]


def test_quantile__is_the_smallest_count_that_reaches_the_probability():
    assert Q.quantile(0.25).tolist() == [2, 4]
    assert Q.quantile(0.2500001).tolist() == [4, 4]
    assert Q.quantile(0.5).tolist() == Q.median().tolist() == [4, 4]
    assert Q.quantile(0.0).tolist() == [2, 2]
    assert Q.quantile(1.0).tolist() == [6, 8]
    assert [bound.tolist() for bound in Q.interval(0.5)] == [[2, 4], [4, 6]]


def test_extrapolation__flags_textures_and_counts_that_were_not_calibrated():
    assert Q.extrapolation(0.5).tolist() == [False, True]
    marked = rb.QDistribution(SURVIVAL, np.array([LOAD, RIDGE], np.uint8), 6, "simulation")
    assert marked.extrapolation_of(0.99).tolist() == ["load", "Q,a/R"]
    inside = rb.QDistribution(SURVIVAL, np.array([False, False]), 6, "simulation")
    assert inside.extrapolation(0.5).tolist() == [False, False]
    assert inside.extrapolation_of(0.5).tolist() == ["", ""]
    assert inside.extrapolation(0.99).tolist() == [False, True]  # its upper end is 8


@pytest.mark.slow
def test_rvs__follows_the_probabilities_reproducibly():
    n = 40_000
    draws = Q.rvs(n, 1)
    assert draws.shape == (n, 2)
    share = (draws[..., None] == Q.q).mean(axis=0)
    # Monte Carlo: 4.5 standard errors of a share.
    assert np.all(np.abs(share - Q.pmf) <= 4.5 * np.sqrt(Q.pmf * (1 - Q.pmf) / n))
    assert draws.tolist() == Q.rvs(n, 1).tolist()
    assert draws.tolist() == Q.rvs(size=n, random_state=np.random.default_rng(1)).tolist()
    assert draws.tolist() == Q.rvs(n, rng=1).tolist()
    with pytest.raises(rb.InputError, match="expected rng or random_state, got both"):
        Q.rvs(n, 1, random_state=1)


def scipys(survival):
    """The same distribution as scipy has it."""
    q = 2 + 2 * np.arange(len(survival))
    return stats.rv_discrete(values=(q, survival - np.append(survival[1:], 0)))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_names_of_scipy__give_what_scipy_gives(seed):
    mine, k = random_distribution(seed, n=1), np.arange(-3, 25).astype(float)
    theirs, prob = scipys(mine.survival[0]), np.array([0.01, 0.3, 0.5, 0.77, 0.999])
    for name in ("pmf", "cdf", "sf"):
        expected = getattr(theirs, name)(k)
        np.testing.assert_allclose(getattr(mine, name)(k[:, None])[:, 0], expected, atol=1e-14)
        np.testing.assert_allclose(
            getattr(mine, name)[0], getattr(theirs, name)(mine.q), atol=1e-14
        )
    assert mine.ppf(prob).tolist() == theirs.ppf(prob).tolist()
    assert mine.mean()[0] == pytest.approx(theirs.mean(), rel=1e-13)  # algebra
    assert mine.std()[0] == pytest.approx(theirs.std(), rel=1e-12)
    assert [float(end[0]) for end in mine.interval(0.8)] == list(theirs.interval(0.8))


def test_names_of_scipy__broadcast_counts_and_probabilities_with_places():
    assert Q.sf([3, 4]).tolist() == [0.75, 0.5]
    assert Q.pmf([[4], [6], [5]]).tolist() == [[0.5, 0.5], [0.25, 0.375], [0.0, 0.0]]
    assert Q.ppf([[0.2], [0.9]]).tolist() == [[2, 4], [6, 8]]
    assert Q.at_least([4, 8]).tolist() == [0.75, 0.125]
    for ask in (Q.pmf, Q.cdf, Q.sf, Q.at_least, Q.quantile):
        with pytest.raises(
            rb.InputError, match=r"shapes broadcast, got .* \(3,\), distribution \(2,\)"
        ):
            ask([0.1, 0.2, 0.3])
    with pytest.raises(rb.InputError, match="k: expected numbers, got 'many'"):
        Q.pmf("many")


def test_what_is_worked_out_of_probabilities__is_an_ordinary_array():
    assert type(1 - Q.cdf) is type(Q.pmf.sum(axis=-1)) is np.ndarray
    assert isinstance(Q.pmf.sum(), float)


@pytest.mark.parametrize(
    ("size", "shape"), [(None, (2,)), (3, (3, 2)), ((2, 3), (2, 3, 2)), (0, (0, 2)), ((), (2,))]
)
def test_rvs__puts_size_before_the_places(size, shape):
    assert Q.rvs(size, random_state=1).shape == shape
    assert Q.rvs(size).shape == shape  # of other draws each time


@pytest.mark.parametrize("size", ["5", 2.5, -1, (2, -1), np.random.default_rng(1)])
def test_rvs__refuses_sizes_that_are_none(size):
    with pytest.raises(rb.InputError, match="size: expected whole numbers from 0, got"):
        Q.rvs(size)


def test_to_dataframe__has_the_columns_of_bands_and_its_html_the_first_rows():
    places = {"a_over_R": np.array(0.02), "p_over_E": np.array([0.01, 0.02])}
    frame = rb.QDistribution(SURVIVAL, np.array([0, LOAD]), 6, "curve", places=places).to_dataframe(
        0.5
    )
    assert frame["kind_of_band"].tolist() == ["curve", "curve"]
    assert frame["a_over_R"].tolist() == [0.02, 0.02]
    assert frame["p_over_E"].tolist() == [0.01, 0.02]
    assert frame[["q_lower", "q_median", "q_upper"]].to_numpy().tolist() == [[2, 4, 4], [4, 4, 6]]
    assert frame["extrapolation_of"].tolist() == ["", "load"]
    assert frame["p_q_ge_8"].tolist() == [0.0, 0.125]
    html = random_distribution(1)._repr_html_()
    assert "QDistribution(simulation, shape (50,), Q &lt;= 16)" in html
    assert html.count("<tr") == 1 + 20
    assert "the first 20 rows" in html
    assert Q._repr_html_().count("<tr") == 1 + 2


def test_survival__asks_for_no_count_far_beyond_the_loads():
    def columns(ids):
        if ids.max() >= 500:  # as the half-plane form, which has 500 pairs of edges
            raise InputError("expected at most 500 pairs")
        return np.log1p(ids)[None], np.full((1, len(ids)), 1e-6)

    # Draws reach the count 4 + 2 i at the load 1 + i.
    assert survival(columns, np.log([300.5]))[0, [0, 300, 301]].tolist() == [1, 1, 0]
    with pytest.raises(InputError, match="expected at most 500 pairs"):
        survival(columns, np.array([0.0, 99.0]))
