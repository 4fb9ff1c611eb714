"""Log-normal distributions whose median is another one at each place: ``lognormal(auto, 5 %)``."""

from dataclasses import dataclass, replace
from typing import ClassVar

from ridgebayes.distributions.bounded import Truncated
from ridgebayes.distributions.distribution import Distribution, LogNormal


@dataclass(frozen=True)
class AutoLogNormal(LogNormal):
    """Log-normal of known width whose median is not settled yet; `at_place` settles it.

    Parameters
    ----------
    median : float, unit of the parameter
        One of its medians, above 0.
    log_sd : float, dimensionless
        Standard deviation of log x, above 0.

    Examples
    --------
    >>> at_place(AutoLogNormal(1.0, 0.05), 66.0)
    LogNormal(median=66.0, log_sd=0.05)
    """

    kind: ClassVar[str] = "log-normal of any median"


def at_place(prior: Distribution, median: float) -> Distribution:
    """Return a distribution with ``auto`` replaced by a median.

    Parameters
    ----------
    prior : Distribution
        Any; one without `AutoLogNormal` in it is returned as it is.
    median : float, unit of the parameter
        Above 0.
    """
    if isinstance(prior, Truncated):
        return replace(prior, base=at_place(prior.base, median))
    return LogNormal(median, prior.log_sd) if isinstance(prior, AutoLogNormal) else prior


def of_any_place(one: Distribution, other: Distribution) -> Distribution:
    """Return what two readings of a text, of two medians for ``auto``, have in common.

    Parameters
    ----------
    one, other : Distribution
        Alike but for that median.

    Examples
    --------
    >>> of_any_place(LogNormal(1.0, 0.05), LogNormal(2.0, 0.05))
    AutoLogNormal(median=1.0, log_sd=0.05)
    """
    if isinstance(one, Truncated) and isinstance(other, Truncated):
        return replace(one, base=of_any_place(one.base, other.base))
    if isinstance(one, LogNormal) and isinstance(other, LogNormal) and one.median != other.median:
        return AutoLogNormal(one.median, one.log_sd)
    return one
