import numpy as np

from ridgebayes import PowerLaw

TEXTURES = ((0.012, 0.03), (0.032, 0.01))
FORM = PowerLaw().bind(TEXTURES)
K = np.array([50.0, 80.0])
ROUNDING = 1e-14  # algebra: a few roundings of condition 1


def test_load_and_count__is_equation_5_with_one_K_per_texture():
    a, b = np.transpose(TEXTURES)
    p, Q = np.geomspace(1e-4, 0.02, 5)[:, None], np.arange(2, 14, 2)[:, None]
    expected = 2 + K * np.sqrt(p)  # eq. (5) of doi:10.1016/j.ijssolstr.2019.06.026
    np.testing.assert_allclose(FORM.continuous_count(p, a, b, K), expected, rtol=ROUNDING)
    np.testing.assert_allclose(FORM.load(Q, a, b, K), ((Q - 2) / K) ** 2, rtol=ROUNDING)
    np.testing.assert_array_equal(FORM.slope(a, b, K), K)


def test_load__finds_the_K_of_a_texture_wherever_it_stands():
    draws = K * np.array([[1.0], [1.1], [1.2]])
    a, b = np.transpose(TEXTURES[::-1])
    loads = FORM.load(6, a[:, None], b[:, None], draws)
    np.testing.assert_allclose(loads[:, :, 0], (4 / draws[:, ::-1]) ** 2, rtol=ROUNDING)


def test_parameter_names__tell_the_texture_by_its_label_or_widths():
    assert FORM.parameter_names == ("K[a0.012_b0.03]", "K[a0.032_b0.01]")
    assert PowerLaw().bind(TEXTURES, ("wide", "narrow")).parameter_names == ("K[wide]", "K[narrow]")
