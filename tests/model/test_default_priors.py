import pytest

from ridgebayes import (
    Classic,
    Gamma,
    HalfNormal,
    HalfPlane,
    Hybrid,
    LogNormal,
    Modified,
    Noise,
    Normal,
    PowerLaw,
)
from ridgebayes.model.default_priors import default_priors


def test_default_priors__of_each_error_model_follow_the_coefficients():
    everything = {
        "sigma": HalfNormal(0.05),
        "tau_texture": HalfNormal(0.03),
        "tau_step": HalfNormal(0.03),
        "tau_series": HalfNormal(0.1),
        "length_h": LogNormal(1.0, 0.7),
        "length_ratio": LogNormal(0.3, 0.7),
        "df": Gamma(2.0, 0.1),
    }
    for noise in Noise.candidates(2):
        priors = default_priors(Hybrid(), noise)
        assert tuple(priors) == ("c1", "c2", *noise.parameter_names)
        for name in noise.parameter_names:
            assert priors[name] == everything[name]


def test_default_priors__are_those_of_the_design():
    assert default_priors(Classic()) == {"c": LogNormal(1.382, 0.1), "sigma": HalfNormal(0.05)}
    assert default_priors(Modified()) == default_priors(Classic())
    assert default_priors(HalfPlane())["c"] == LogNormal(1.0, 0.1)
    hybrid = default_priors(Hybrid())
    assert list(hybrid) == ["c1", "c2", "sigma"]
    assert hybrid["c1"] == LogNormal(1.382, 0.1)
    assert hybrid["c2"] == Normal(0.0, 0.05)
    power = default_priors(PowerLaw().bind(((0.01, 0.03), (0.02, 0.03)), ("x", "y")))
    assert list(power) == ["K[x]", "K[y]", "sigma"]
    # Algebra: 2 x 1.382 / L, one division.
    assert power["K[x]"].median == pytest.approx(69.1, rel=1e-14)
    assert power["K[y]"].median == pytest.approx(55.28, rel=1e-14)
    assert power["K[y]"].log_sd == 0.3
