"""The study's claims: every number is computed from loads, so it is checked by another road."""

import re
from dataclasses import replace

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.checks.study import study_of
from ridgebayes.checks.study.claims import (
    CONFIRMED,
    DEPENDS,
    NOT_CONFIRMED,
    NOT_TESTED,
    VERDICTS,
    coefficients_claim,
    exact_loads,
    load_error,
)


@pytest.fixture(scope="module")
def claims(comparison):
    return study_of(comparison).claims


def _claim(claims, words):
    (found,) = [claim for claim in claims if words in claim.text]
    return found


def _numbers(text):
    return [
        float(x.replace("\N{MINUS SIGN}", "-")) for x in re.findall(r"[+\u2212]?\d+\.\d+", text)
    ]


def test_each_claim_has_text_place_numbers_and_a_known_verdict(claims):
    assert len({claim.text for claim in claims}) == len(claims) == 17
    for claim in claims:
        assert claim.text
        assert claim.where
        assert claim.verdict in VERDICTS
        assert re.search(r"\d", claim.ours)
        assert "nan" not in claim.ours


@pytest.mark.parametrize(
    ("words", "verdict"),
    [
        ("Smooth cylinder", CONFIRMED),
        ("R² > 0.999", CONFIRMED),
        ("R² = 0.999", CONFIRMED),
        ("c = 1.38.", CONFIRMED),
        ("c₂ = 0.01583", CONFIRMED),
        ("Classic over-predicts", CONFIRMED),
        ("by 1-2 %", NOT_CONFIRMED),
        ("by 3-5 %", NOT_CONFIRMED),
        ("up to 15 %", NOT_CONFIRMED),
        ("within 2 %", NOT_CONFIRMED),
        ("Errors fall", NOT_CONFIRMED),
        ("worst near Q = 8", NOT_CONFIRMED),
        ("needs more load than Modified", CONFIRMED),
        ("load increment", NOT_CONFIRMED),
        ("longer, not shorter", DEPENDS),
        ("b/R of 0.3", NOT_CONFIRMED),
        ("displacement control", NOT_TESTED),
    ],
)
def test_verdicts_on_the_embedded_sweep(claims, words, verdict):
    assert _claim(claims, words).verdict == verdict


def test_exact_loads_are_those_of_the_reference_table():
    # Reference: transition loads of the half-plane equation, printed digits.
    np.testing.assert_allclose(
        exact_loads((0.012, 0.09), 3), [0.0048116545, 0.0186210147, 0.0423179351], atol=5e-11
    )


def test_load_error_of_modified_by_hand():
    # Algebra: (L/1.38)^2 at Q = 4 over the printed reference load.
    found = load_error(rb.Modified(), (0.032, 0.01), np.array([4]))
    assert found[0] == pytest.approx(100 * ((0.042 / 1.38) ** 2 / 0.0009778101 - 1), abs=1e-5)


def test_modified_claim_gives_printed_and_calibrated_ranges(claims, comparison):
    printed_low, printed_high, own_low, own_high, *_ = _numbers(_claim(claims, "by 3-5 %").ours)
    q = np.array([4, 6, 8, 10])
    exact = exact_loads((0.012, 0.03), 4)
    c = comparison.fits["modified"].summary["mean"].iloc[0]
    for coefficient, low, high in ((1.38, printed_low, printed_high), (c, own_low, own_high)):
        error = 100 * ((0.042 * (q / 2 - 1) / coefficient) ** 2 / exact - 1)
        assert [low, high] == pytest.approx([error.min(), error.max()], abs=0.05)


def test_without_a_fit_of_the_form_only_printed_coefficients_speak(comparison):
    fits = {"power-law": comparison.fits["power-law"]}
    claim = _claim(study_of(replace(comparison, fits=fits)).claims, "by 3-5 %")
    assert "calibrated" not in claim.ours
    assert "printed" in claim.ours


def test_lengths_against_hertz_are_on_both_sides_of_one(claims):
    # Reference: 0.86 and 1.09, measured by independent code.
    assert _numbers(_claim(claims, "longer").ours)[-2:] == [0.86, 1.09]


def test_groove_effect_depends_on_the_ratio_of_widths_alone(claims):
    claim = _claim(claims, "b/R of 0.3")
    percents = [int(x) for x in re.findall(r"(\d+) %", claim.ours)]
    assert percents[:4] == sorted(percents[:4])
    assert percents[4] == percents[2]


def test_ridge_pressures_at_the_extreme_texture(claims):
    # Reference: 0.40 E, 0.78 E and 1.18 E at Q = 4, 6, 8.
    found = re.findall(r"(\d\.\d\d) E", _claim(claims, "displacement control").ours)
    assert found == ["0.40", "0.78", "1.18"]


def test_coefficients_far_from_the_printed_ones_are_not_confirmed(odd_table):
    assert coefficients_claim(rb.Modified(), odd_table, "eq. (6)").verdict == NOT_CONFIRMED
