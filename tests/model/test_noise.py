import pytest

from ridgebayes.errors import InputError
from ridgebayes.model.noise import Noise


def test_noise__default_is_independent_rows_with_one_parameter_and_a_caution():
    noise = Noise()
    assert noise.name == "iid"
    assert noise.parameter_names == ("sigma",)
    assert noise.caution == "rows are not independent"


def test_noise__refuses_an_error_model_that_it_does_not_know():
    rule = "expected one of iid, texture, step, texture.step, step-smooth, got structure 'cauchy'"
    with pytest.raises(InputError, match=rule):
        Noise("cauchy")
    with pytest.raises(
        InputError, match="noise: expected one of normal, student, got tail 'cauchy'"
    ):
        Noise("step", "cauchy")


@pytest.mark.parametrize("noise", Noise.every())
def test_named__is_the_inverse_of_name(noise):
    assert Noise.named(noise.name) == noise
    assert Noise.named(f"{noise.structure}:{noise.tail}") == noise


def test_every__holds_each_structure_with_each_tail_once():
    names = [noise.name for noise in Noise.every()]
    assert len(names) == len(set(names)) == 10
    assert names[0] == "iid"
    assert {"step-smooth", "texture+step:student", "iid:student"} < set(names)


@pytest.mark.parametrize("name", ["", "cauchy", "step:", "step:cauchy", ":student", "step+texture"])
def test_named__refuses_what_is_no_structure_and_tail(name):
    with pytest.raises(
        InputError, match="expected STRUCTURE or STRUCTURE:student, STRUCTURE one of "
    ):
        Noise.named(name)


@pytest.mark.parametrize(
    ("structure", "own"),
    [
        ("iid", ()),
        ("texture", ("tau_texture",)),
        ("step", ("tau_step",)),
        ("texture+step", ("tau_texture", "tau_step")),
        ("step-smooth", ("tau_step", "length_h", "length_ratio")),
    ],
)
def test_parameter_names__are_sigma_then_the_structures_then_the_tails(structure, own):
    assert Noise(structure).parameter_names == ("sigma", *own)
    assert Noise(structure, "student").parameter_names == ("sigma", *own, "df")
    assert Noise(structure, "student").distribution.name == "student"


def test_caution__is_for_independent_rows_alone():
    for noise in Noise.every():
        assert (noise.caution is None) == (noise.structure != "iid")
