"""The report: the answer first, everything escaped, nothing raw, the same bytes again."""

import re
from dataclasses import replace
from functools import partial
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.checks.coverage import COVERAGE_COLUMNS
from ridgebayes.checks.left_out import LEFT_OUT_COLUMNS
from ridgebayes.checks.report_data import report_data
from ridgebayes.comparison.verdict import Verdict
from ridgebayes.report import _rendered, render_report
from ridgebayes.report.evidence import prior_table
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.report.first_screen import headline, lead
from ridgebayes.report.predictions import held_out_section
from ridgebayes.report.wording import number
from tests.once import once

SCRIPTS = [{"type": "application/json"}, {}]  # a table, and the page's own code


class Page(HTMLParser):
    """Tags with their attributes, and the text between them."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.words, self.open = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in {"meta", "img", "br", "input"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] not in ("style", "script"):
            self.words.append(data)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())

    def all(self, tag):
        return [attrs for name, attrs in self.tags if name == tag]


@pytest.fixture(scope="session")
def full(gallery, second_gallery, tmp_path_factory):
    page = partial(_rendered, gallery, second_gallery, [".html"])
    return once(tmp_path_factory, "page of the embedded sweep", page)[0]


@pytest.fixture(scope="session")
def page(full):
    return Page(full)


@pytest.fixture(scope="session")
def markdown(gallery, second_gallery):
    return _rendered(gallery, second_gallery, [".md"])[0]


@pytest.fixture(scope="session")
def odd_page(odd_gallery):
    """A small report with its figures."""
    return _rendered(odd_gallery, None, [".html"])[0]


@pytest.fixture
def undrawn(monkeypatch):
    """Leave figures out of pages whose words are looked at: drawing takes most of a report."""
    monkeypatch.setattr(Gallery, "file", lambda self, name, kind: b"")


def shown(gallery, suffix=".html", **tables):
    """Return the page of a comparison with other tables; its other results stay as they are."""
    comparison = replace(gallery.data.comparison, **tables)
    return _rendered(Gallery(replace(gallery.data, comparison=comparison)), None, [suffix])[0]


def test_page_is_well_formed_and_self_contained(full, page):
    assert page.open == []
    assert page.all("script") == SCRIPTS
    assert not page.all("link")
    starts = ("data:image/png;base64,", "data:image/svg+xml;base64,")
    assert all(image["src"].startswith(starts) for image in page.all("img"))
    assert all(link["href"].startswith(("#", "data:")) for link in page.all("a"))
    assert "http" not in re.sub(r"base64,[^\"]*", "", full)
    assert len(full) < 5e6


def test_details_are_closed_and_the_order_is_kept(page):
    assert len(page.all("details")) > 10
    assert not any("open" in attrs for attrs in page.all("details"))
    anchors = [attrs["id"] for attrs in page.all("h2")]
    wanted = ["texture", "data", "evidence", "predictions", "checks", "computation"]
    assert anchors == [*wanted, "reference", "appendix"]


def test_every_image_has_words_for_those_who_do_not_see_it(page):
    assert len(page.all("img")) == 15
    assert all(len(image["alt"]) > 20 for image in page.all("img"))


def test_first_words_are_the_answer(page, comparison):
    head = page.text[: page.text.index("rows fitted") if "rows fitted" in page.text else 4000]
    factor = comparison.bayes_factors.iloc[5]
    assert "Which contact form describes paper_sweep.csv?" in head
    assert "The evidence supports Hybrid among the forms compared." in head
    assert "were compared on 41 rows of 9 textures" in head
    assert {factor["form_a"], factor["form_b"]} == {"modified", "hybrid"}
    assert f"ln Bayes factor of Hybrid over Modified, the next, is {-factor['ln_bf']:.1f};" in head
    assert "On these 9 textures up to the observed loads, Hybrid and Modified predict" in head
    assert "Errors of rows were taken as independent" in head
    assert "The evidence for Half-plane is decisive among the forms compared." in head
    assert f"table SHA-256 {comparison.table.digest()[:12]} · ridgebayes" in head


def test_no_nan_and_no_endless_digits(page, markdown):
    assert not [attrs for attrs in page.all("div") if attrs.get("class") == "banner"]
    assert "NOT COMPLETE" not in markdown
    for text in (page.text, markdown):
        assert not re.search(r"\b(nan|None(?! of)|inf)\b", text)
        assert not re.search(r"\d\.\d{9}", text)


def test_published_and_least_squares_stand_beside_the_posterior(page):
    # Reference: least squares on Q, 41 rows: c1 = 1.3486, c2 = 0.0180, c = 1.3844.
    for words in (r"1.3486 ± \S+ 1.348 ", r"0.0180 ± \S+ 0.01583 ", r"1.3844 ± \S+ 1.38 "):
        assert re.search(words, page.text)


@pytest.mark.long
def test_same_comparison_same_bytes(comparison, reference, markdown, odd, odd_page):
    again = render_report(replace(comparison), ".md", reference=replace(reference))
    assert again == markdown
    assert render_report(replace(odd)) == odd_page


@pytest.mark.usefixtures("undrawn")
def test_a_comparison_read_back_gives_the_same_report(odd, odd_gallery, tmp_path):
    fits = {}
    for name, fit in odd.fits.items():
        fit.to_netcdf(tmp_path / f"{name}.nc")
        fits[name] = rb.Fit.from_netcdf(tmp_path / f"{name}.nc")
    back = Gallery(report_data(replace(odd, fits=fits)))
    for suffix in (".html", ".md"):
        assert shown(back, suffix) == shown(odd_gallery, suffix)


@pytest.mark.usefixtures("undrawn")
def test_rows_left_out_are_counted_aloud(odd_gallery):
    text = Page(shown(odd_gallery)).text
    assert "5 rows of 1 texture fitted, 2 held out, 1 left out" in text
    assert "1 row: diverged <i>at</i> step 3" in text


def test_held_out_brackets_are_shown_whole_and_textures_left_undrawn_are_counted(comparison):
    frame = comparison.table.frame
    held = frame.assign(role="held-out", p_over_E_lower=0.5 * frame["p_over_E"])
    rows = rb.ContactTable.from_frame(pd.concat([frame.iloc[:1], held.iloc[1:]]))
    data = report_data(replace(comparison, table=rows))
    _, picture, _, details = held_out_section(data)
    assert "The first 3 of 10 textures." in picture.caption
    low, high = (number(frame["p_over_E"][1] * share) for share in (0.5, 1))
    assert details.blocks[0].rows[0][3] == f"{low} to {high}"
    # All K share a row of the priors; medians are 2 * 1.382 over the widest and narrowest pitch.
    ends = [f"log-normal, median {2.764 / pitch:.4g}, log-sd 0.3" for pitch in (0.062, 0.022)]
    named = [row for row in prior_table(data).rows if row[0].startswith("K of ")]
    expected = ["K of a0.012_b0.01 and of the others", ", to ".join(ends)]
    assert [row[:2] for row in named] == [expected]


@pytest.mark.usefixtures("undrawn")
def test_one_form_that_did_not_converge_says_so_in_red(single):
    assert not single.complete
    page = Page(render_report(single))
    assert [attrs for attrs in page.all("div") if attrs.get("class") == "banner"]
    assert "This comparison is not complete." in page.text
    assert single.fits["modified"].convergence_failures[0] in page.text
    assert "was fitted, so there is no comparison" in page.text
    assert "What to do: a fit that did not converge needs more time" in page.text
    assert "NOT COMPLETE" in render_report(single, ".md")


@pytest.mark.usefixtures("undrawn")
def test_a_failed_form_is_named_with_its_reason(failed):
    page = Page(render_report(failed))
    assert "classic: could not be fitted: no interior mode at <c> = 0" in page.text
    assert "What to do: a form without a fit or an evidence needs other priors" in page.text
    assert "Classic – – – – FAILED" in page.text


def test_headline__undecided_names_every_form_that_is_nearly_as_probable():
    shares = {"modified": 0.4, "hybrid": 0.3, "power-law": 0.2462, "classic": 0.0538}
    verdict = Verdict("modified", "undecided", 0.3, (-1.0, 1.0), "hybrid", 0.99, "iid", {}, "")
    # e^-2 of 0.4 is 0.0541.
    said = "The evidence does not decide among Modified, Hybrid and Power law."
    assert headline(verdict, shares) == said
    # The lead is never rounded to a number that its grade contradicts: 1.55 is under 2.
    wide = replace(verdict, ln_bf=1.55, ln_bf_range=(-1.2, 16.3))
    assert lead(wide).endswith("is 1.6; across priors and error models it lies between −1 and 16.")
    two = {"modified": 0.9, "hybrid": 0.1}
    said = "The evidence does not decide between Modified and Hybrid."
    assert headline(verdict, two) == said


@pytest.mark.usefixtures("undrawn")
def test_the_study_is_named_for_its_own_sweep_and_for_no_other_table(
    page, odd_gallery, second_gallery
):
    words = ("notebooks/study.ipynb", "doi:10.1016", "ublished")
    assert all(one in page.text for one in words)
    for other in (odd_gallery, second_gallery):
        text = Page(shown(other)).text
        assert not [one for one in words if one in text]


@pytest.mark.usefixtures("undrawn")
def test_tables_that_a_run_did_not_write_leave_their_sections_out(single):
    bare = replace(
        single,
        bayes_factors=single.bayes_factors.iloc[:0],
        loo=pd.DataFrame(),
        prior_sensitivity=pd.DataFrame(),
    )
    text = Page(render_report(bare)).text
    assert "Cross-validation" not in text
    assert "Coverage of the bands" not in text
    # The priors themselves are known; how Bayes factors depend on their scales is not.
    assert "Priors of this run" in text
    assert "log-normal, median 1.382, log-sd 0.1" in text
    assert "is varied by a factor of" not in text


@pytest.mark.usefixtures("undrawn")
def test_disagreement_of_loo_with_the_bayes_factors_is_explained(comparison, gallery):
    loo = comparison.loo.assign(elpd=[90.0, 1.0, 2.0, 3.0], n_bad_k=0)
    text = Page(shown(gallery, loo=loo)).text
    assert "Classic by score and Hybrid by weight for one more row" in text


@pytest.mark.usefixtures("undrawn")
def test_left_out_scores_are_shown_and_read(gallery):
    scores = pd.DataFrame(
        [
            ["hybrid", "iid", "texture", 9, 89.7, 1.7, 0.0149, 1.0, ""],
            ["modified", "iid", "texture", 9, 82.3, 4.4, 0.0182, 0.0, ""],
            ["hybrid", "iid", "step", 8, 31.9, 63.5, 0.0204, 0.2, ""],
            ["modified", "iid", "step", 8, 75.8, 13.8, 0.0215, 0.8, ""],
            ["classic", "iid", "step", 8, np.nan, np.nan, np.nan, 0.0, "Q = 4: no <mode>"],
        ],
        columns=LEFT_OUT_COLUMNS,
    )
    text = Page(shown(gallery, left_out=scores)).text
    assert "9 textures in turn Hybrid 89.7 ± 1.7 0.015 1.000" in text
    assert "Bayes factors favour Hybrid, but some scores put another form first: Modified" in text
    assert "Not fitted: classic, Q = 4: no <mode>." in text
    agreeing = Page(shown(gallery, left_out=scores[:2])).text
    assert "All agree with the Bayes factors: Hybrid leads." in agreeing


@pytest.mark.usefixtures("undrawn")
def test_coverage_is_shown_with_its_figure(gallery):
    shares = pd.DataFrame(
        [
            ["hybrid", noise, prob, 41, n, n / 41, 0.052, 0.0064, 0.2439, 9, 0, 0, ""]
            for noise, prob, n in [("step", 0.5, 25), ("step", 0.9, 38), ("iid", 0.9, 35)]
        ],
        columns=COVERAGE_COLUMNS,
    )
    page = Page(shown(gallery, coverage=shares))
    assert "step 90 % 38 of 41 93 ± 5 % 0.0064" in page.text.replace("\xa0", " ")
    assert "9 textures left out in turn, Hybrid fitted to the others" in page.text
    assert "24 % lie beyond" in page.text.replace("\xa0", " ")
    assert any("Share of left-out transitions inside" in image["alt"] for image in page.all("img"))


@pytest.mark.usefixtures("undrawn")
def test_write_report_leaves_one_whole_file(odd, odd_gallery, tmp_path):
    target = tmp_path / "report.md"
    target.write_text("old", encoding="utf-8")
    rb.write_report(odd, target)
    assert [path.name for path in tmp_path.iterdir()] == [target.name]
    assert target.read_text(encoding="utf-8") == shown(odd_gallery, ".md")


def test_another_suffix_is_bad_input(odd, tmp_path):
    with pytest.raises(rb.InputError, match=r"ends in \.html or \.md"):
        rb.write_report(odd, tmp_path / "report.pdf")
    assert not list(tmp_path.iterdir())


def test_a_missing_folder_is_bad_input(odd, tmp_path):
    with pytest.raises(rb.InputError, match="cannot be written"):
        rb.write_report(odd, tmp_path / "nowhere" / "report.md")


@pytest.mark.long
def test_prior_section__names_priors_that_are_not_varied(paper):
    priors = {"modified": {"c": "uniform(1.2, 1.6)"}}
    settings = rb.SampleSettings(n_walker=16, n_step_max=100)
    found = rb.compare(
        paper, ["modified", "classic"], noise="iid", priors=priors, settings=settings
    )
    text = render_report(found, ".md")
    assert "the priors of c (Modified). The range of the verdict does not include them." in text
    assert re.search(r"c \(Modified\) *\| uniform, low 1\.2, high 1\.6", text)
    assert re.search(r"c \(Classic\) *\| log-normal, median 1\.382, log-sd 0\.1", text)
