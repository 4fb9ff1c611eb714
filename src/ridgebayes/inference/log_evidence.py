"""A log evidence with its error, as every method returns it."""

from dataclasses import dataclass, replace

KEPT = "first pass: "  # begins the status of an evidence that decides nothing, and is not refined


@dataclass(frozen=True)
class LogEvidence:
    """A natural log evidence with its standard error.

    Parameters
    ----------
    method : str
        ``importance`` or ``bridge``.
    value : float
        Natural log; NaN where the method failed.
    se : float
        Standard error; NaN where the method failed.
    status : str
        ``ok``; ``first pass: ...`` where the error is larger than asked for and decides nothing,
        since the evidence is far below the best; else what failed.
    """

    method: str
    value: float
    se: float
    status: str = "ok"

    @property
    def ok(self) -> bool:
        """Whether the value can be used."""
        return self.status == "ok" or self.status.startswith(KEPT)

    def kept(self) -> "LogEvidence":
        """Return the same as one that decides nothing."""
        return replace(self, status=KEPT + self.status)
