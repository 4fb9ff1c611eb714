"""Error models: what stands between a form's load and the load in the table.

An error model is a structure and a tail. This version has one: ``iid``, independent normal errors
of the log load with standard deviation sigma.
"""

from dataclasses import dataclass
from typing import ClassVar

from ridgebayes.errors import InputError


@dataclass(frozen=True)
class Noise:
    """Error model of the log loads.

    Parameters
    ----------
    structure : str
        ``"iid"``: rows err independently.
    """

    structure: str = "iid"
    structures: ClassVar[tuple[str, ...]] = ("iid",)

    def __post_init__(self) -> None:
        if self.structure not in self.structures:
            raise InputError(
                f"noise {self.structure!r}: not an error model of this version; "
                f"rule: one of {', '.join(self.structures)}"
            )

    @property
    def name(self) -> str:
        """The name that commands and files use."""
        return self.structure

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the error model's own parameters, after the form's coefficients."""
        return ("sigma",)

    @property
    def caution(self) -> str | None:
        """What a reader of Bayes factors under this error model has to be told."""
        return "rows are not independent" if self.structure == "iid" else None
