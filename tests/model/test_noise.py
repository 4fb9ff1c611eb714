import re

import pytest

from ridgebayes import InputError, Noise


def test_noise__refuses_an_error_model_that_it_does_not_know():
    rule = "expected one of iid, .*, step-smooth, each also with .series, got structure '{}'"
    for structure in ("cauchy", "+series", "series+series", "series+iid", "step+series+series"):
        with pytest.raises(InputError, match=rule.format(re.escape(structure))):
            Noise(structure)
    with pytest.raises(
        InputError, match="noise: expected one of normal, student, got tail 'cauchy'"
    ):
        Noise("step", "cauchy")


@pytest.mark.parametrize("noise", Noise.candidates(2))
def test_named__is_the_inverse_of_name(noise):
    assert Noise.named(noise.name) == noise
    assert Noise.named(f"{noise.structure}:{noise.tail}") == noise


def test_named__series_alone_is_the_short_name_of_independent_rows_with_series():
    for name in ("series", "iid+series"):
        assert Noise.named(name) == Noise("series") == Noise("iid+series")
        assert Noise.named(f"{name}:student").name == "series:student"


def test_candidates__are_the_ten_and_of_several_series_also_each_with_series():
    assert Noise.candidates(1) == Noise.every()
    found = Noise.candidates(3)
    assert found[:10] == Noise.every()
    assert [noise.name for noise in found[10:15]] == [
        "series",
        "texture+series",
        "step+series",
        "texture+step+series",
        "step-smooth+series",
    ]
    assert [noise.tail for noise in found[10:]] == ["normal"] * 5 + ["student"] * 5


@pytest.mark.parametrize("nugget", [0.0, -1e-8, 1.01e-4, float("nan"), float("inf")])
def test_nugget__is_above_zero_and_small(nugget):
    with pytest.raises(InputError, match=r"nugget: expected a number > 0 and <= 0\.0001, got "):
        Noise("step-smooth", nugget=nugget)


@pytest.mark.parametrize("name", ["", "cauchy", "step:", "step:cauchy", ":student", "step+texture"])
def test_named__refuses_what_is_no_structure_and_tail(name):
    with pytest.raises(
        InputError, match="expected STRUCTURE or STRUCTURE:student, STRUCTURE one of "
    ):
        Noise.named(name)
