"""Log-normal distributions without a fixed median: ``lognormal(auto, 5 %)``."""

from dataclasses import dataclass, replace
from typing import ClassVar

from ridgebayes.distributions.bounded import Truncated
from ridgebayes.distributions.distribution import Distribution, LogNormal


@dataclass(frozen=True)
class AutoLogNormal(LogNormal):
    """Log-normal of known width whose median is set later by `at_place`.

    Parameters
    ----------
    median : float, unit of the parameter
        Placeholder, above 0.
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
        Any distribution; it is returned unchanged if it contains no `AutoLogNormal`.
    median : float, unit of the parameter
        Median, above 0.
    """
    if isinstance(prior, Truncated):
        return replace(prior, base=at_place(prior.base, median))
    return LogNormal(median, prior.log_sd) if isinstance(prior, AutoLogNormal) else prior
