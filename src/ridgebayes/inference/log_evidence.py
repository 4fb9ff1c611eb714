"""The record of a log evidence, common to all methods."""

from dataclasses import dataclass, replace

# Prefix of the status of an evidence that is too imprecise but far below the best, so that it is
# used without refinement.
FIRST_PASS_PREFIX = "first pass: "


@dataclass(frozen=True)
class LogEvidence:
    """A natural log evidence with its standard error.

    Parameters
    ----------
    method : str
        ``importance`` or ``bridge``.
    value : float
        Natural log; NaN if the method failed.
    se : float
        Standard error; NaN if the method failed.
    status : str
        ``ok``; ``first pass: ...`` if a check failed but the evidence is so far below the best that
        this does not matter; else the reason of the failure.
    """

    method: str
    value: float
    se: float
    status: str = "ok"

    @property
    def ok(self) -> bool:
        """Whether the value can be used."""
        return self.status == "ok" or self.status.startswith(FIRST_PASS_PREFIX)

    def kept(self) -> "LogEvidence":
        """Return the evidence with a status that accepts it without refinement."""
        return replace(self, status=FIRST_PASS_PREFIX + self.status)
