import pytest

from ridgebayes import LogNormal, Normal, Truncated, Uniform
from ridgebayes.distributions.auto import at_place
from ridgebayes.distributions.grammar import parse_distribution, priors_from_json, priors_to_json


@pytest.mark.parametrize(
    ("text", "settled"),
    [
        ("lognormal(auto, 5 %)", LogNormal(66.0, 0.05)),
        ("truncated(lognormal(auto, 5 %), 10, 90)", Truncated(LogNormal(66.0, 0.05), 10.0, 90.0)),
        ("lognormal(40, 5 %)", LogNormal(40.0, 0.05)),
        ("truncated(normal(40, 5), 0, inf)", Truncated(Normal(40.0, 5.0), 0.0, float("inf"))),
        ("uniform(1, 2)", Uniform(1.0, 2.0)),
    ],
)
def test_text__has_its_median_settled_at_a_place_also_from_a_file(text, settled):
    prior = parse_distribution(text, auto=True)
    assert at_place(prior, 66.0) == settled
    (back,) = priors_from_json(priors_to_json({"K": prior})).values()
    assert back == prior
    assert at_place(settled, 3.0) == settled
