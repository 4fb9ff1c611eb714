"""Pages as a browser shows them: nothing cut, nothing on top of other text, nothing missing."""

import os
import shutil
import subprocess
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ridgebayes as rb
from ridgebayes.report.wording import probability
from tests.report.browser import CHROMIUM, Browser

SCREEN = 800  # pixels of height
if CHROMIUM is None and os.environ.get("RIDGEBAYES_NEEDS_CHROMIUM"):
    raise RuntimeError("no chromium on the path, and RIDGEBAYES_NEEDS_CHROMIUM asks for it")
pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed"),
]
LAYOUT = r"""
(() => {
  const wide = [], texts = [];
  const scrolls = element => element.closest('.scroll, nav') !== null;
  for (const element of document.body.querySelectorAll('*')) {
    const box = element.getBoundingClientRect();
    if (!scrolls(element) && box.width && (box.right > innerWidth + 1 || box.left < -1))
      wide.push(element.tagName + ': ' + element.textContent.slice(0, 60));
  }
  const walk = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walk.nextNode()) {
    const node = walk.currentNode;
    if (!node.textContent.trim() || !node.parentElement.checkVisibility()) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects())
      if (box.width > 1) texts.push([box.top, box.bottom, box.left, box.right, node.textContent]);
  }
  texts.sort((a, b) => a[0] - b[0]);
  const overlapping = [];
  texts.forEach((a, i) => {
    for (let j = i + 1; j < texts.length && texts[j][0] < a[1] - 2; j++) {
      const b = texts[j];
      const high = Math.min(a[1], b[1]) - b[0];
      // Boxes of a line are taller than its letters: lines of one block may touch.
      if (high > 6 && Math.min(a[3], b[3]) - Math.max(a[2], b[2]) > 1)
        overlapping.push([a[4].slice(0, 40), b[4].slice(0, 40)]);
    }
  });
  const images = [...document.images].filter(one => !one.complete || !one.naturalWidth);
  return {wide, overlapping, missing: images.map(one => one.alt), n_text: texts.length,
          page: document.documentElement.scrollWidth, window: innerWidth};
})()
"""
OPEN = "document.querySelectorAll('details').forEach(one => { one.open = true; })"
POSTERIOR = "document.querySelector('[aria-label=\"Posterior probability of {}\"]').value"
HEIGHT = "document.documentElement.scrollHeight"


@pytest.fixture(scope="module")
def browser():
    with Browser() as found:
        yield found


@pytest.fixture(scope="session")
def pages(comparison, reference, odd, failed, tmp_path_factory):
    """Write a report when it is asked for: of the embedded sweep, of a user's, and of a failure."""
    folder, written = tmp_path_factory.mktemp("pages"), {}
    made = {
        "embedded": (comparison, reference),
        "user": (odd, None),
        "failed": (replace(failed), None),
    }

    def path(name):
        if name not in written:
            comparison, second = made[name]
            written[name] = folder / f"{name}.html"
            rb.write_report(comparison, written[name], reference=second)
        return written[name]

    return path


REPORTS = [
    "user",
    pytest.param("embedded", marks=pytest.mark.long),
    pytest.param("failed", marks=pytest.mark.long),
]


@pytest.mark.parametrize("name", REPORTS)
@pytest.mark.parametrize("width", [1280, 390])
def test_page__is_whole(browser, pages, name, width):
    browser.open(pages(name), width)
    for script in ("", OPEN):
        browser.run(script)
        found = browser.run(LAYOUT)
        assert found["page"] <= found["window"] == width
        assert (found["wide"], found["overlapping"], found["missing"]) == ([], [], [])
        assert found["n_text"] > 100
    assert browser.messages == []


@pytest.mark.parametrize("name", REPORTS)
def test_page__is_short_and_its_first_screen_holds_the_answer(browser, pages, name, tmp_path):
    browser.open(pages(name), 1280)
    assert browser.run(HEIGHT) <= (12 if name == "embedded" else 10) * SCREEN
    bottom = browser.run("document.querySelector('#answer').getBoundingClientRect().bottom")
    # Forms that are not complete are listed above the answer.
    assert bottom <= SCREEN or name == "failed"
    assert browser.pdf(tmp_path / "page.pdf") <= 12


def typed(browser, label, text):
    """Replace what a field holds by keyboard alone."""
    browser.run(f"document.querySelector('[aria-label=\"{label}\"]').select()")
    browser.ask("Input.insertText", text=text)


@pytest.mark.parametrize("own", [("1e-3", "2"), ("0,25", "1e30"), ("1", "0"), ("1e-290", "1e5")])
def test_own_priors__give_posterior_probabilities_at_once(browser, pages, odd, own):
    browser.open(pages("user"), 1280)
    browser.run(OPEN)
    titles = {"modified": "Modified", "power-law": "Power law"}
    for title, text in zip(titles.values(), own, strict=True):
        typed(browser, f"Prior probability of {title}", text)
    used = odd.evidence[odd.evidence["used"]].set_index("form")["log_evidence"]
    priors = [float(text.replace(",", ".")) for text in own]
    weights = np.array(priors) * np.exp(used[list(titles)].to_numpy())  # algebra
    for title, share in zip(titles.values(), (weights / weights.sum()).tolist(), strict=True):
        written = probability(share) if share else "0"
        assert browser.run(POSTERIOR.format(title)) == written
    assert browser.messages == []


def test_own_priors__that_make_no_sense_are_said_and_reset(browser, pages, odd):
    browser.open(pages("user"), 1280)
    browser.run(OPEN)
    form = "document.querySelector('form[data-odds]')"
    for bad in ("-1", "", "much", "inf"):
        typed(browser, "Prior probability of Modified", bad)
        assert browser.run(POSTERIOR.format("Modified")) == "–"
        assert browser.run("document.activeElement.getAttribute('aria-invalid')") == "true"
        said = browser.run(f"{form}.querySelector('[role=status]').textContent")
        assert said == "Type a number of 0 or more for each form, one above 0."
    browser.run(f"{form}.querySelector('button').click()")
    browser.run("new Promise(done => setTimeout(done, 20))")
    for form, title in {"modified": "Modified", "power-law": "Power law"}.items():
        expected = probability(odd.probabilities[form])
        assert browser.run(POSTERIOR.format(title)) == expected
    assert browser.messages == []


def test_layout_script__sees_what_it_looks_for(browser, tmp_path):
    page = tmp_path / "page.html"
    page.write_text(
        "<body><p style='position:absolute;top:0'>under</p><p style='position:absolute;top:3px'>"
        "over</p><div style='width:3000px;margin-top:99px'>wide</div><img src='no.png' alt='lost'>",
        encoding="utf-8",
    )
    browser.open(page, 390)
    found = browser.run(LAYOUT)
    assert found["overlapping"] == [["under", "over"]]
    assert found["missing"] == ["lost"]
    assert any("wide" in one for one in found["wide"])
    assert browser.messages  # of the picture that is not there


@pytest.fixture(scope="session")
def axe(tmp_path_factory):
    """The source of axe-core, from npm."""
    npm, folder = shutil.which("npm"), tmp_path_factory.mktemp("axe")
    found = Path(os.environ.get("RIDGEBAYES_AXE", folder / "node_modules/axe-core/axe.min.js"))
    if npm and not found.is_file():
        fetch = [npm, "install", "--silent", "--no-audit", "--no-fund", "axe-core@4"]
        with suppress(subprocess.TimeoutExpired):
            subprocess.run(fetch, cwd=folder, capture_output=True, timeout=60, check=False)
    if not found.is_file():
        pytest.skip("axe-core is not installed, and npm cannot fetch it")
    return found.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", REPORTS)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_page__has_no_violation_of_wcag_2_1_aa(browser, pages, axe, name, scheme):
    for width in (1280, 390):
        browser.open(pages(name), width, scheme=scheme)
        browser.run(OPEN)
        browser.run(axe)
        tags = "['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']"
        found = browser.run(
            f"axe.run({{runOnly: {tags}}}).then(x => x.violations.map(v => "
            "[v.id, v.nodes.slice(0, 3).map(n => n.html.slice(0, 200))]))"
        )
        assert found == []
