"""Conversion of arguments of forms and predictions to arrays, with checks of values and shapes."""

import operator

import numpy as np
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.contact.scaling import Texture
from ridgebayes.errors import InputError
from ridgebayes.table.columns import LARGEST_LOAD, LARGEST_WIDTH, LEAST_WIDTH

# Floats represent all smaller integers exactly.
MAX_COUNT = int(np.reciprocal(np.finfo(float).epsneg))


def even_counts(Q: ArrayLike, least: int = 2) -> FloatArray:
    """Return `Q` as floats, or raise InputError if a count is odd or out of range."""
    counts = numbers("Q", Q)
    if not (np.all((counts >= least) & (counts <= MAX_COUNT)) and np.all(counts % 2 == 0)):
        raise InputError(f"Q: expected even and at least {least}, at most 2^53, got {Q!r}")
    return counts


def widths(a_over_R: ArrayLike, b_over_R: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return both widths as floats, or raise InputError with the name of a width out of range."""
    a, b = numbers("a_over_R", a_over_R), numbers("b_over_R", b_over_R)
    common_shape(a_over_R=a, b_over_R=b)
    for name, width in (("a_over_R", a), ("b_over_R", b)):
        if not np.all((width >= LEAST_WIDTH) & (width <= LARGEST_WIDTH)):
            raise InputError(
                f"{name}: expected finite and > 0, {LEAST_WIDTH:g} to {LARGEST_WIDTH:g}, "
                f"got {width.tolist()!r}"
            )
    return a, b


def loads(p_over_E: ArrayLike) -> FloatArray:
    """Return loads as floats, or raise InputError if a load is negative or not finite."""
    p = numbers("p_over_E", p_over_E)
    if not np.all((p >= 0) & (p <= LARGEST_LOAD)):
        raise InputError(
            f"p_over_E: expected finite and >= 0, at most {LARGEST_LOAD:g}, got {p_over_E!r}"
        )
    return p


def numbers(name: str, values: ArrayLike) -> FloatArray:
    """Return an argument as floats, masked ones as NaN; InputError names one that is no number."""
    try:
        array = np.asarray(values.filled(np.nan) if np.ma.isMA(values) else values)
        if array.dtype.kind == "b":
            raise TypeError
        return array.astype(float, copy=False)
    except (OverflowError, TypeError, ValueError):
        raise InputError(f"{name}: expected numbers, got {values!r}") from None


def common_shape(**arrays: ArrayLike) -> tuple[int, ...]:
    """Return the shape to which arguments broadcast, or raise InputError with their shapes.

    Examples
    --------
    >>> common_shape(a_over_R=[0.01, 0.02], p_over_E=[[0.001], [0.002], [0.003]])
    (3, 2)
    """
    shapes = {name: np.shape(values) for name, values in arrays.items()}
    try:
        return np.broadcast_shapes(*shapes.values())
    except ValueError:
        shapes_text = ", ".join(f"{name} {shape}" for name, shape in shapes.items() if shape)
        raise InputError(f"expected arrays whose shapes broadcast, got {shapes_text}") from None


def aligned(a: FloatArray, b: FloatArray, **others: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the widths with as many axes as all arguments together, so that draws come first."""
    n_axis = len(common_shape(a_over_R=a, b_over_R=b, **others))
    return a[(None,) * (n_axis - a.ndim)], b[(None,) * (n_axis - b.ndim)]


def unique_textures(a: FloatArray, b: FloatArray) -> list[Texture]:
    """Return the distinct (a, b) pairs of two arrays of one shape, in order of appearance."""
    return list(dict.fromkeys(zip(a.ravel().tolist(), b.ravel().tolist(), strict=True)))


def draw_shape(size: int | tuple[int, ...] | None) -> tuple[int, ...]:
    """Return the leading shape of draws for a `size` argument.

    Examples
    --------
    >>> draw_shape(None), draw_shape(5), draw_shape((2, 3))
    ((), (5,), (2, 3))
    """
    try:
        shape = () if size is None else tuple(map(operator.index, np.atleast_1d(size)))
    except TypeError:
        shape = (-1,)
    if any(n < 0 for n in shape):
        raise InputError(f"size: expected whole numbers from 0, got {size!r}")
    return shape
