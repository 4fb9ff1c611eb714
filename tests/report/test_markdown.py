"""report.md as a code host shows it: rendered as GitHub's Markdown, of which markdown-it knows all
that a report uses (CommonMark, tables, HTML blocks)."""

import re
from collections import Counter
from itertools import pairwise

import pytest
from markdown_it import MarkdownIt

from ridgebayes.report import _rendered
from ridgebayes.report.blocks import Folded, Table
from ridgebayes.report.sections import contents

PARSER = MarkdownIt("commonmark").enable(["table", "strikethrough"])


def rendered(*galleries):
    """Return the galleries of a comparison, and the tokens of its report in a run folder."""
    (text,) = _rendered(*galleries, [".md"], in_folder=True)
    return galleries, PARSER.parse(text)


@pytest.fixture(scope="module")
def reports(gallery, second_gallery, odd_gallery):
    return {
        "embedded": rendered(gallery, second_gallery),
        "user": rendered(odd_gallery, None),
    }


REPORTS = pytest.mark.parametrize("name", ["embedded", "user"])


def inner(tokens, kind):
    return [child for one in tokens for child in one.children or () if child.type == kind]


def n_tables(blocks):
    return sum(
        n_tables(one.blocks) if isinstance(one, Folded) else isinstance(one, Table)
        for one in blocks
    )


@REPORTS
def test_markdown__shows_every_table_as_one(reports, name):
    (gallery, second), tokens = reports[name]
    found = Counter(one.type for one in tokens)
    assert found["table_open"] == sum(n_tables(one.blocks) for one in contents(gallery, second))
    rows = [one for one in tokens if one.type == "inline" and one.content.lstrip().startswith("|")]
    assert [one.content[:60] for one in rows] == []


@REPORTS
def test_markdown__pictures_are_files_of_the_run_folder(reports, name):
    (gallery, second), tokens = reports[name]
    files = {f"figures/{one}.png" for one in gallery}
    if second is not None:
        files |= {f"reference-fe/figures/{one}.png" for one in second}
    pictures = inner(tokens, "image")
    assert len(pictures) > 3
    assert {one.attrs["src"] for one in pictures} <= files
    assert all(one.content for one in pictures)


@REPORTS
def test_markdown__has_no_mark_left_over(reports, name):
    _, tokens = reports[name]
    headings = [int(one.tag[1]) for one in tokens if one.type == "heading_open"]
    assert headings[0] == 1
    assert all(later <= before + 1 for before, later in pairwise(headings))
    words = [one.content for one in inner(tokens, "text")]
    assert [one for one in words if re.search(r"\*\*|^#+ |\]\(", one)] == []
