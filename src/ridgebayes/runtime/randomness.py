"""Seeds and random streams: each random number comes from a named stream of one seed.

A stream is named by labels such as ("hybrid", "ensemble 2"). Adding a form or an ensemble to a run
therefore leaves all other numbers unchanged. There is no global random state.
"""

import functools
import zlib
from collections.abc import Callable

import numpy as np

from ridgebayes._types import Rng
from ridgebayes.errors import InputError

Streams = Callable[..., np.random.Generator]  # arguments are the labels


def seed_of(rng: Rng) -> int:
    """Return the integer seed of an `rng` argument.

    Parameters
    ----------
    rng : int or numpy.random.Generator
        Seed, returned unchanged, or a generator, from which one seed is drawn.

    Returns
    -------
    int
        Non-negative seed.

    Raises
    ------
    InputError
        If the seed is negative, or neither an integer nor a generator.

    Examples
    --------
    >>> seed_of(7)
    7
    """
    if isinstance(rng, np.random.Generator):
        return int(rng.integers(2**63))
    if isinstance(rng, bool) or not isinstance(rng, (int, np.integer)) or rng < 0:
        raise InputError(f"rng: expected a non-negative integer or a numpy Generator, got {rng!r}")
    return int(rng)


def seeded(rng: Rng | None) -> np.random.Generator:
    """Return a given generator, a generator seeded by an integer, or one with a random seed."""
    if rng is None or isinstance(rng, np.random.Generator):
        return np.random.default_rng(rng)
    return np.random.default_rng(seed_of(rng))


def stream(seed: int, *labels: str) -> np.random.Generator:
    """Return the random stream of a seed with the given labels.

    Parameters
    ----------
    seed : int
        Non-negative seed of the run.
    *labels : str
        Purpose of the random numbers.

    Returns
    -------
    numpy.random.Generator
        Generator independent of the streams with other labels.

    Examples
    --------
    >>> a, b = stream(1, "hybrid"), stream(1, "hybrid")
    >>> bool(a.random() == b.random())
    True
    """
    # crc32, unlike hash(), is the same in every process and Python version.
    return np.random.default_rng([seed, *(zlib.crc32(label.encode()) for label in labels)])


def streams(seed: int) -> Streams:
    """Return a cached `stream` of one seed: a repeated label continues its stream.

    Examples
    --------
    >>> parts, whole = streams(1), stream(1, "hybrid").random(3)
    >>> bool(parts("hybrid").random() == whole[0] and parts("hybrid").random() == whole[1])
    True
    """
    return functools.cache(functools.partial(stream, seed))
