"""Every case of the table holds, and its page says so."""

import pytest

from tests.hard_cases.page import PAGE, statement
from tests.hard_cases.table import every_case

CASES = every_case()


@pytest.mark.usefixtures("made_once")
@pytest.mark.parametrize(
    "case",
    [
        pytest.param(
            case, id=f"{case.area}-{case.test_id}", marks=[pytest.mark.long] if case.long else []
        )
        for case in CASES
    ],
)
def test_hard_case(case, tmp_path):
    seen = case.run(tmp_path)

    assert seen
    assert "\n" not in seen


def test_table__names_each_case_once_and_has_eighty_or_more():
    assert len({case.name for case in CASES}) == len({case.test_id for case in CASES}) == len(CASES)
    assert len(CASES) >= 80


def test_page__states_todays_cases():
    text = PAGE.read_text(encoding="utf-8")

    assert all(statement(case) in text for case in CASES), (
        "docs/hard-cases.md shows other cases: make hard-cases writes it again"
    )
