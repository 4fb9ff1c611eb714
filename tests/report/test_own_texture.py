"""The reader's own texture in the page: what a browser shows, against `predict` of the same."""

import math

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.report.figures.gallery import Gallery
from tests.report.browser import CHROMIUM, Browser

pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
]
# R in mm, E in kPa, nu, widths in um, load in kPa: none of these textures was fitted.
TEXTURES = [
    (8, 60, 0.5, 157, 139, 0.58),
    (8, 60, 0.5, 250, 250, 1.2),
    (12, 100, 0.45, 180, 300, 0.9),
    (5, 30, 0.5, 60, 140, 0.31),
    (20, 250, 0.3, 500, 220, 4.1),
    (8, 60, 0.5, 120, 90, 0.4),
    (8, 1000, 0.49, 300, 500, 8.0),
    (10, 60, 0.5, 400, 60, 0.7),  # a/pitch, a/R beyond
    (10, 60, 0.5, 100, 900, 2.4),  # a/pitch, b/R, load beyond
    (8, 60, 0.5, 100, 100, 3.0),  # load and Q beyond
]
READ = """
(() => {
  const part = name => document.querySelector(`[data-part=${name}]`);
  const rows = [...part('rows').children].map(row => [Number(row.firstChild.textContent),
    Number(row.dataset.p), ...row.dataset.load.split(' ').map(Number), row.lastChild.textContent]);
  const {low, median, high} = part('said').dataset;
  return {band: [low, median, high].map(Number), of: part('beyond').dataset.of, rows,
          said: part('said').textContent, beyond: part('beyond').textContent,
          told: part('told').textContent, hidden: part('answer').hidden,
          unit: part('unit').textContent, plot: part('plot').innerHTML};
})()
"""


@pytest.fixture(scope="module")
def averaged(compare, paper):
    return compare(paper, [rb.Modified(), rb.Hybrid()], rng=0, accuracy="quick")


def written(compared, folder):
    """Write a page without figures, which takes a tenth of the time."""
    with pytest.MonkeyPatch.context() as patch:
        dot = b"<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'/>"
        patch.setattr(Gallery, "file", lambda self, name, kind: dot)
        rb.write_report(compared, folder / "page.html")
    return folder / "page.html"


@pytest.fixture(scope="module")
def browser(averaged, tmp_path_factory):
    with Browser() as found:
        found.open(written(averaged, tmp_path_factory.mktemp("own")), 1280)
        yield found


def fill(browser, **values):
    """Type into fields and choose units, and return what the page then shows."""
    for name, value in values.items():
        one = f"document.querySelector('form[data-texture]').elements['{name}']"
        if name.endswith("unit"):
            change = "dispatchEvent(new Event('input', {bubbles: true}))"
            browser.run(f"{one}.value = '{value}'; {one}.{change}")
        else:
            browser.run(f"{one}.select()")
            browser.ask("Input.insertText", text=f"{value}")
    return browser.run(READ)


def start(browser):
    browser.run("document.querySelector('form[data-texture] button').click()")
    browser.run("new Promise(done => setTimeout(done, 20))")


@pytest.mark.parametrize("line", [False, True], ids=["kPa", "N/m"])
@pytest.mark.parametrize("case", TEXTURES)
def test_page__predicts_what_predict_does(browser, averaged, case, line):
    R, E, nu, a, b, load = case
    start(browser)
    per_E = 2 * R * E if line else E  # N/m: 2 R E, of mm and kPa
    found = fill(
        browser,
        **{"R": R, "E": E, "nu": nu, "a": a, "b": b},
        load_unit="N/m" if line else "kPa",
        load=load / E * per_E,
    )
    a, b = a / R / 1000, b / R / 1000
    q = averaged.predict(a, b, load / E, nu=nu)
    low, high = q.interval(0.9)
    assert found["band"] == [low, q.median(), high]
    assert found["of"] == str(q.extrapolation_of(0.9))
    assert found["unit"] == ("N/m" if line else "kPa")
    shown = np.array([row[:5] for row in found["rows"]])
    counts = shown[:, 0].astype(int)
    np.testing.assert_allclose(shown[:, 1], q.at_least(counts), rtol=0, atol=0.005)
    loads = averaged.predict_load(a, b, counts, nu=nu)
    expected = np.array([loads.median(), *loads.interval(0.9)]) * per_E
    # Discretisation: a/pitch is interpolated.
    np.testing.assert_allclose(shown[:, 2:].T, expected, rtol=0.005)
    names = [set(row[5].split(", ")) - {"–"} for row in found["rows"]]
    of_texture = {"a/pitch", "a/R", "b/R", "texture", ""}
    assert names == [set(of.split(",")) - of_texture for of in loads.extrapolation_of]
    assert ("Extrapolation: " in found["beyond"]) == bool(found["of"])


def test_page__widths_may_be_shares_of_the_radius_and_loads_p_over_E(browser, averaged):
    start(browser)
    found = fill(browser, width_unit="R", a="0,02", b="0.017", load_unit="p/E", load="0.004:0.012")
    q = averaged.predict(0.02, 0.017, 0.012)
    assert found["band"][1] == q.median()
    assert found["said"].startswith(f"At 0.012 p/E: Q = {int(q.median())}, 90\u00a0% band ")
    assert found["plot"].count('class="load"') == 2  # both ends of the range


@pytest.mark.parametrize(
    ("fields", "sd"),
    [
        pytest.param({"E_sd": 20}, math.log(1.2), marks=pytest.mark.long),
        pytest.param({"R_sd": 5}, 2 * math.log(1.05), marks=pytest.mark.long),
        ({"R_sd": 5, "E_sd": 20}, math.hypot(math.log(1.2), 2 * math.log(1.05))),
        pytest.param({"R_sd": 5, "load_unit": "N/m"}, math.log(1.05), marks=pytest.mark.long),
        ({"R_sd": 5, "width_unit": "R", "a": 0.02, "b": 0.0175}, 0.0),
        ({"E_sd": 20, "load_unit": "p/E", "load": 0.009}, 0.0),
    ],
)
def test_page__uncertain_modulus_and_radius_widen_loads_and_counts(browser, averaged, fields, sd):
    start(browser)
    found = fill(browser, a=160, b=140, load=0.55)
    found = fill(browser, **fields)
    per_E = {"N/m": 2 * 8 * 60, "p/E": 1}.get(fields.get("load_unit"), 60)
    load = fields.get("load", 0.55)
    counts = [row[0] for row in found["rows"]]
    loads = averaged.predict_load(0.02, 0.0175, counts)
    # Quadrature over the error of ln load, to 1e-6 where a distribution is as wide as a step.
    z = np.linspace(-6, 6, 2001)
    weight = np.exp(-(z**2) / 2) / np.exp(-(z**2) / 2).sum()
    cdf = loads.cdf(load / per_E * np.exp(sd * z)[:, None]).T @ weight
    np.testing.assert_allclose([row[1] for row in found["rows"]], cdf, rtol=0, atol=0.005)
    for k, p in ((3, 0.05), (2, 0.5), (4, 0.95)):
        there = np.array([row[k] for row in found["rows"]]) / per_E
        share = np.einsum("zn,z->n", loads.cdf(there * np.exp(sd * z)[:, None]), weight)
        if sd:
            np.testing.assert_allclose(share, p, atol=0.005)
        else:
            np.testing.assert_allclose(there, loads.quantile(p), rtol=0.005)


def test_page__heavy_tails_reach_no_count_beyond_the_body(compare, paper, tmp_path):
    heavy = compare(paper, ["modified"], noise="iid:student", rng=0, accuracy="quick")
    with Browser() as browser:
        browser.open(written(heavy, tmp_path), 1280)
        # Pitches of 0.5 R: the third pair of ridges is at 1.1 R from the axis.
        found = fill(browser, width_unit="R", a=0.3, b=0.2, load_unit="p/E", load=2)
    q = heavy.predict(0.3, 0.2, 2)
    assert q.at_least(6) == 0 < heavy.predict_load(0.3, 0.2, 6).cdf(2)
    shown = {row[0]: row[1] for row in found["rows"]}
    np.testing.assert_allclose(list(shown.values()), q.at_least(list(shown)), rtol=0, atol=0.005)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"R": ""}, "Expected Radius: a number above 0."),
        ({"E": "soft"}, "Expected Young’s modulus: a number above 0."),
        ({"nu": 0.6}, "Expected Poisson’s ratio: 0 to 0.5."),
        ({"a": -1, "b": 0}, "Ridge width: a number above 0; Groove width, in the same unit: a"),
        ({"load": "2 to 1"}, "Load: a number above 0, or a range such as 0.2 to 1.2"),
        ({"E_sd": 80}, "Uncertainty of young’s modulus in per cent: 0 to 50 %"),
        ({"a": 1000, "b": 10}, "This page knows a/pitch from 0.04 to 0.96, and this is 0.99"),
    ],
)
def test_page__what_makes_no_sense_is_said_and_answers_nothing(browser, fields, words):
    start(browser)
    found = fill(browser, **fields)
    assert words in found["told"]
    assert found["hidden"] is True
    start(browser)
    again = browser.run(READ)
    assert (again["told"], again["hidden"]) == ("", False)


def test_page__says_which_quantity_is_extrapolated_and_by_how_much(browser):
    start(browser)
    said = fill(browser, a=157, b=2000, load=2.5)["beyond"]
    # Calibrated: a/pitch from 0.286, b/R to 0.03, p/E to 0.0194.
    assert "a/pitch = 0.0728 is 0.25 times the smallest calibrated, 0.286" in said
    assert "b/R = 0.25 is 8.3 times the largest calibrated, 0.03" in said
    assert "p/E = 0.0417 is 2.1 times the largest calibrated, 0.0194" in said
    assert "a/R" not in said
    assert fill(browser, b=139, load=0.5)["beyond"] == "Nothing is extrapolated."


def test_page__works_by_keyboard_alone_without_errors(browser):
    start(browser)
    browser.run("document.querySelector('form[data-texture]').elements['R'].focus()")
    seen = []
    for _ in range(11):
        seen.append(browser.run("document.activeElement.name"))
        for kind in ("keyDown", "keyUp"):
            browser.ask(
                "Input.dispatchKeyEvent", type=kind, key="Tab", code="Tab", windowsVirtualKeyCode=9
            )
    assert " ".join(seen) == "R R_unit R_sd E E_unit E_sd nu a width_unit b load"
    assert browser.messages == []


@pytest.mark.long
def test_page__of_fitted_textures_with_offsets_of_their_own_says_so(browser, odd, tmp_path):
    browser.open(written(odd, tmp_path), 390)
    known = fill(browser, width_unit="R", a=0.02, b=0.021)["beyond"]
    assert known.endswith(
        "ridgebayes predict uses its own offset, this page takes it as a new one."
    )
    other = fill(browser, a=0.02, b=0.022)
    assert "texture" in other["of"].split(",")
    assert "the power law has no K for this texture" in other["beyond"]
