"""Exceptions of the package, which separate invalid input from failed computations."""

import warnings
from collections.abc import Iterable
from typing import Any


class RidgebayesError(Exception):
    """Base class of the package's exceptions.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> try:
    ...     rb.read_table("absent.csv")
    ... except rb.RidgebayesError as error:
    ...     print(type(error).__name__, error)
    InputError absent.csv: no such file
    """


class InputError(RidgebayesError, ValueError):
    """Invalid input; the message names the place, the value and the rule. Exit code 2.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> rb.Scene.of([(0.022, -0.02)])
    Traceback (most recent call last):
    ridgebayes.errors.InputError: Texture: b_over_R = -0.02: input should be greater than 0
    """


class ComputationError(RidgebayesError, RuntimeError):
    """Computation that failed or did not converge for valid input. Exit code 1.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> issubclass(rb.ComputationError, RuntimeError), issubclass(rb.ComputationError, ValueError)
    (True, False)
    """


class OutputError(RidgebayesError, OSError):
    """Results cannot be written, for instance on a full disk. Exit code 1.

    This is not a `ComputationError`: a failed form leaves the others, a full disk ends the run.
    """


class WorkerLostError(ComputationError):
    """A task cannot be sent to a worker process, or all that got it died; the message names it."""


class CautionWarning(UserWarning):
    """A doubtful result because of a table, scene, error model or prior; the message says why.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> issubclass(rb.CautionWarning, UserWarning)
    True
    """


def warn_of(sentences: Iterable[str]) -> None:
    """Warn of each caution at the line that called a public function."""
    for sentence in sentences:
        warnings.warn(sentence, CautionWarning, stacklevel=3)


def expect(*kinds: Any, **arguments: object) -> None:
    """Raise InputError for an argument of another type.

    Examples
    --------
    >>> expect(str, None, goal=5)
    Traceback (most recent call last):
    ridgebayes.errors.InputError: goal: expected str or None, got 5
    """
    types = tuple(type(None) if kind is None else kind for kind in kinds)
    for name, value in arguments.items():
        if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
            shown = " or ".join("None" if kind is None else kind.__name__ for kind in kinds)
            raise InputError(f"{name}: expected {shown}, got {value!r:.200}")
