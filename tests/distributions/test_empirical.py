import itertools

import numpy as np
import pytest
from scipy import integrate, stats

from ridgebayes import Empirical, InputError
from ridgebayes.distributions.empirical import read_sample


@pytest.fixture(scope="module", params=["log-normal", "normal"])
def sample(request):
    rng = np.random.default_rng(5)
    values = rng.normal(0.5, 0.2, 2_000)
    return np.exp(values) if request.param == "log-normal" else values - 0.5


def test_quantiles__are_the_samples(sample):
    own = Empirical.of(sample)
    assert own.support[0] == (0.0 if sample.min() > 0 else -np.inf)
    for share in (0.005, 0.05, 0.3, 0.5, 0.8, 0.99):
        # Discretisation: between knots a quarter of an sd apart, of a sample of noise 1/sqrt(n p).
        seen = float(own.value_at(stats.norm.ppf(share)))
        assert np.mean(sample < seen) == pytest.approx(share, abs=0.006)
    few = sample[:100]
    ends = Empirical.of(few).value_at(stats.norm.ppf([0.005, 0.995]))  # Hazen's shares of the ends
    np.testing.assert_allclose(ends, [few.min(), few.max()], rtol=1e-9)  # rounding


@pytest.mark.slow
def test_density__is_that_of_the_transform_and_integrates_to_one(sample):
    own, u, h = Empirical.of(sample), np.linspace(-6, 6, 49), 1e-5
    x = own.value_at(u)
    np.testing.assert_allclose(own.score(x), u, atol=1e-10)  # rounding, halved 60 times
    slope = (own.value_at(u + h) - own.value_at(u - h)) / (2 * h)
    np.testing.assert_allclose(own.slope_at(u, x), slope, rtol=1e-4)  # h at a knot's kink
    edges = own.value_at(np.array([-9.0, *own.scores, 9.0]))
    pieces = [
        integrate.quad(lambda x: np.exp(own.log_pdf(np.array(x))), low, high)[0]
        for low, high in itertools.pairwise(edges)
    ]
    assert sum(pieces) == pytest.approx(1, abs=1e-7)  # discretisation: quad's own tolerance


@pytest.mark.parametrize(
    ("sample", "message"),
    [
        (np.arange(9.0), "expected 10 finite values or more, got 9"),
        (np.r_[np.arange(10.0), np.nan], "expected 10 finite values"),
        (np.ones(50), "nearly equal ones"),
    ],
)
def test_of__refuses_a_sample_that_tells_too_little(sample, message):
    with pytest.raises(InputError, match=message):
        Empirical.of(sample)


def test_empirical__refuses_quantiles_out_of_order():
    with pytest.raises(InputError, match="increasing quantiles"):
        Empirical((-1.0, 0.0, 1.0), (1.0, 3.0, 2.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "expected a column 'c', got a, b"),
        ("c\n1\nx\n", "row 3, c: expected a finite number, got 'x'"),
        ("c\n1\ninf\n", "row 3, c: expected a finite number, got 'inf'"),
        ("a,c\n1\n", "row 2, c: expected a finite number, got ''"),
        ("", "expected a column 'c'"),
        ('c\n"\n', "expected a finite number|not a CSV file"),
    ],
)
def test_read_sample__names_file_row_and_cell(tmp_path, text, message):
    path = tmp_path / "s.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message) as refused:
        read_sample(path, "c", float)
    assert str(path) in str(refused.value)
