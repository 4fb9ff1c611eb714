"""One hard case: why it is hard, what must come out, and the check that says what did.

A check is a function decorated by `hard_case`. It asserts what must hold, and returns in a few
words what was seen; `python -m tests.hard_cases.page` writes all of them to docs/hard-cases.md.
"""

from collections.abc import Callable
from dataclasses import dataclass
from inspect import signature
from pathlib import Path

import pytest


@dataclass(frozen=True)
class HardCase:
    """A case of the table.

    Attributes
    ----------
    name : str
        What is put in, in a few words.
    area : str
        Module the case stands in.
    why : str
        Why it is hard: what goes wrong in a package that does not take care.
    expected : str
        True answer with its tolerance and the kind of it, or the refusal.
    long : bool
        Whether `make test` leaves it to `make test-long`.
    check : callable
        Takes a folder of its own if it has a parameter ``folder``; returns what was seen.
    """

    name: str
    area: str
    why: str
    expected: str
    long: bool
    check: Callable[..., str]

    @property
    def test_id(self) -> str:
        """Name of the function, for ``pytest -k``."""
        return self.check.__name__

    def run(self, folder: Path) -> str:
        """Return what was seen; AssertionError if it is wrong."""
        return self.check(folder) if "folder" in signature(self.check).parameters else self.check()


CASES: list[HardCase] = []


def hard_case(
    name: str, *, why: str, expected: str, long: bool = False
) -> Callable[[Callable], Callable]:
    """Add the decorated function to the table of cases, in the area of its module's name."""

    def add(check: Callable) -> Callable:
        area = check.__module__.rpartition(".")[2]
        CASES.append(HardCase(name, area, why, expected, long, check))
        return check

    return add


def refused(call: Callable[[], object], kind: type[Exception], *words: str) -> str:
    """Return the one-line message with which a call is refused; it must contain all words."""
    with pytest.raises(kind) as refusal:
        call()
    message = str(refusal.value)
    missing = [word for word in words if word not in message]
    assert not missing, f"the refusal does not name {missing}: {message}"
    assert "\n" not in message, f"the refusal has more than one line: {message}"
    return f"refused: {message}"
