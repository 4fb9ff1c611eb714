"""Examples of docstrings."""

import pytest

from tests.once import made_once as made_once


@pytest.fixture(autouse=True)
def _made_once(made_once):
    """Many examples begin with the same fit."""
