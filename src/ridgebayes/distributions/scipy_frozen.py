"""Conversion of SciPy's frozen distributions to distributions of this package."""

from collections.abc import Callable

import numpy as np

from ridgebayes.distributions.bounded import Truncated, Uniform
from ridgebayes.distributions.distribution import (
    Distribution,
    Gamma,
    HalfNormal,
    LogNormal,
    Normal,
)
from ridgebayes.errors import InputError

# Conversions of `loc`, `scale` and shapes by SciPy's name; None means that `loc` has to be 0.
_KINDS: dict[str, Callable[..., Distribution | None]] = {
    "norm": Normal,
    "uniform": lambda loc, scale: Uniform(loc, loc + scale),
    "truncnorm": lambda loc, scale, a, b: Truncated(
        Normal(loc, scale), loc + a * scale, loc + b * scale
    ),
    "lognorm": lambda loc, scale, s: None if loc else LogNormal(scale, s),
    "halfnorm": lambda loc, scale: None if loc else HalfNormal(scale),
    "gamma": lambda loc, scale, a: None if loc else Gamma(a, 1 / scale),
}


def from_scipy(value: object, where: str) -> object:
    """Return a frozen distribution of SciPy as a `Distribution`; other values are unchanged.

    Raises
    ------
    InputError
        If this package has no equivalent of the distribution.

    Examples
    --------
    >>> from scipy import stats
    >>> from_scipy(stats.lognorm(0.1, scale=1.382), "c")
    LogNormal(median=1.382, log_sd=0.1)
    >>> from_scipy("normal(0, 1)", "c")
    'normal(0, 1)'
    """
    frozen = getattr(value, "dist", None)
    if frozen is None:
        return value
    shapes, loc, scale = frozen._parse_args(*value.args, **value.kwds)  # type: ignore[attr-defined]
    kind = _KINDS.get(frozen.name)
    parameters = (loc, scale, *shapes)
    if any(map(np.ndim, parameters)):
        raise InputError(
            f"{where}: expected one number for each parameter of scipy.stats' {frozen.name}, got "
            f"arrays of shapes {', '.join(str(np.shape(x)) for x in parameters)}"
        )
    try:
        same = None if kind is None else kind(*map(float, parameters))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if same is None:
        names = ", ".join(_KINDS)
        raise InputError(
            f"{where}: expected one of scipy.stats' {names} (lognorm, halfnorm and gamma with "
            f"loc = 0), got {frozen.name} with loc = {loc:g}"
        )
    return same
