import pytest

from ridgebayes.errors import InputError
from ridgebayes.noise import Noise


def test_noise__default_is_independent_rows_with_one_parameter_and_a_caution():
    noise = Noise()
    assert noise.name == "iid"
    assert noise.parameter_names == ("sigma",)
    assert noise.caution == "rows are not independent"


def test_noise__refuses_an_error_model_that_it_does_not_know():
    rule = (
        "noise: structure 'cauchy' given; rule: one of iid, texture, step, texture.step, step-smo"
    )
    with pytest.raises(InputError, match=rule):
        Noise("cauchy")
    with pytest.raises(
        InputError, match="noise: tail 'cauchy' given; rule: one of normal, student"
    ):
        Noise("step", "cauchy")
