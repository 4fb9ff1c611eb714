"""What the examples of docstrings have in common: equal comparisons and fits, computed once."""

import functools

import pytest

import ridgebayes as rb

_KNOWN = {}


def _once(function):
    """Return a function that looks up what it was asked before, by other examples too."""

    @functools.wraps(function)
    def found(table, *given, **options):
        key = (function.__name__, table.digest(), repr(given), repr(options))
        if key not in _KNOWN:
            _KNOWN[key] = function(table, *given, **options)
        return _KNOWN[key]

    return found


@pytest.fixture(autouse=True)
def _computed_once(monkeypatch):
    for name in ("compare", "calibrate"):
        monkeypatch.setattr(rb, name, _once(getattr(rb, name)))
