"""The checklist holds the page to what it says."""

import re

import pytest

from ridgebayes.checks.report_data import report_data
from ridgebayes.report.checklist import ITEMS, held_against
from ridgebayes.report.figures.gallery import Gallery
from ridgebayes.report.first_screen import first_screen
from ridgebayes.report.sections import contents


def rows_of(comparison):
    data = report_data(comparison)
    return held_against(first_screen(data), contents(Gallery(data), None))


def test_items__are_those_of_the_guidelines():
    numbers = " ".join(re.sub(r",.*", "", item.name) for item in ITEMS)
    steps = ["0A", "1E", "2D", "3C", "4E", "5E", "6F"]
    assert all(f"BARG {step}" in numbers for step in steps)
    assert [n for n in range(1, 11) if f"WAMBS {n}" not in numbers] == []
    assert len({item.name for item in ITEMS}) == len(ITEMS)


def test_held_against__a_full_report_meets_all_but_what_does_not_apply(comparison):
    rows = rows_of(comparison)
    unmet = ["BARG 4B", "BARG 4C", "WAMBS 2"]
    assert [name[:7] for name, is_met, _ in rows if not is_met] == unmet
    assert {where for _, is_met, where in rows if is_met} >= {"First screen", "Data and priors"}


def test_held_against__says_why_an_item_is_not_met(single):
    missing = {name: why for name, is_met, why in rows_of(single) if not is_met}
    assert missing["BARG 5E, sensitivity of the decision"] == "only one form was compared"


@pytest.mark.parametrize("item", [item for item in ITEMS if item.anchor], ids=lambda x: x.name)
def test_items__are_missed_where_the_words_are_gone(item):
    class Empty:
        question = headline = made_by = ""
        sentences = ()

    met = {name: is_met for name, is_met, _ in held_against(Empty(), [])}
    assert not met[item.name]
