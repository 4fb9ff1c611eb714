"""What every method returns, and the quickest of them."""

from dataclasses import dataclass

import numpy as np

from ridgebayes.inference.laplace import Laplace


@dataclass(frozen=True)
class LogEvidence:
    """A natural log evidence with its standard error.

    Parameters
    ----------
    method : str
        ``bridge``, ``importance``, ``quadrature``, ``laplace``, ``dynesty``.
    value : float
        Natural log; NaN where the method failed.
    se : float
        Standard error; NaN where the method has none to give.
    status : str
        ``ok``, or what failed.
    """

    method: str
    value: float
    se: float
    status: str = "ok"

    @property
    def ok(self) -> bool:
        """Whether the value can be used."""
        return self.status == "ok"


def laplace_evidence(laplace: Laplace) -> LogEvidence:
    """Return Laplace's approximation: a first look, without an error.

    Parameters
    ----------
    laplace : Laplace
        Normal approximation of the posterior.

    Returns
    -------
    LogEvidence
        With standard error NaN. The status is not ok where no mode was found.
    """
    if not laplace.is_mode:
        return LogEvidence("laplace", laplace.log_evidence, np.nan, "several humps, no mode")
    return LogEvidence("laplace", laplace.log_evidence, np.nan)
