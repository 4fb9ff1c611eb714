"""The recipe of mutation testing names things that exist; its page is that of its results."""

from collections import Counter

import pytest

from studies.mutation import page
from studies.mutation.results import CONFIGURATION, ROOT, path_of, read, totals


@pytest.mark.parametrize("module", CONFIGURATION["modules"])
def test_modules__and_their_tests_exist(module):
    assert path_of(module).is_file()
    tests = CONFIGURATION["modules"][module]
    assert tests
    assert all((ROOT / test).exists() for test in tests)


def test_results__are_of_every_module_and_of_no_more_mutants_than_it_has():
    tried = Counter(result.module for result in read())
    assert set(tried) == set(CONFIGURATION["modules"]) == set(totals())
    assert all(0 < tried[module] <= n for module, n in totals().items())


def test_page__is_that_of_the_results_and_gives_a_reason_for_every_survivor():
    assert page.PAGE.read_text(encoding="utf-8") == page.text()
