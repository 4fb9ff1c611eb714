"""Error models: what stands between a form's load and the load in the table.

An error model is a structure and a tail. What is left of finite-element loads after a form is
fitted is not noise that differs from row to row: it repeats within a texture and from texture to
texture at the same step. A structure says what is shared, a tail how far single rows may stray.
"""

from dataclasses import dataclass
from typing import ClassVar

from ridgebayes.errors import InputError
from ridgebayes.model.tails import TAILS, Tail


@dataclass(frozen=True)
class Noise:
    """Error model of the log loads: ``log load = form + shared offsets + error of the row``.

    Parameters
    ----------
    structure : str
        Which offsets rows share. ``"iid"``: none; ``"texture"``: one offset per texture;
        ``"step"``: one per count Q; ``"texture+step"``: both; ``"step-smooth"``: a smooth function
        of log h (h = Q/2 - 1) and a/pitch, the two things that the half-plane's loads depend on.
    tail : str
        Distribution of a row's own error: ``"normal"`` or ``"student"``.

    Examples
    --------
    >>> Noise.named("texture+step:student").parameter_names
    ('sigma', 'tau_texture', 'tau_step', 'df')
    """

    structure: str = "iid"
    tail: str = "normal"
    structures: ClassVar[tuple[str, ...]] = (
        "iid",
        "texture",
        "step",
        "texture+step",
        "step-smooth",
    )
    tails: ClassVar[tuple[str, ...]] = tuple(TAILS)

    def __post_init__(self) -> None:
        for kind, value, known in (
            ("structure", self.structure, self.structures),
            ("tail", self.tail, self.tails),
        ):
            if value not in known:
                raise InputError(f"noise: expected one of {', '.join(known)}, got {kind} {value!r}")

    @classmethod
    def named(cls, name: str) -> "Noise":
        """Return the error model that commands and files call STRUCTURE or STRUCTURE:student."""
        structure, colon, tail = name.partition(":")
        if structure not in cls.structures or (colon and tail not in cls.tails):
            raise InputError(
                f"noise {name!r}: not an error model; expected STRUCTURE or STRUCTURE:student, "
                f"STRUCTURE one of {', '.join(cls.structures)}"
            )
        return cls(structure, tail or "normal")

    @classmethod
    def every(cls) -> tuple["Noise", ...]:
        """Return every structure with every tail."""
        return tuple(cls(structure, tail) for tail in cls.tails for structure in cls.structures)

    @property
    def name(self) -> str:
        """The name that commands and files use."""
        return self.structure if self.tail == "normal" else f"{self.structure}:{self.tail}"

    @property
    def distribution(self) -> Tail:
        """The distribution of a row's own error, standardised."""
        return TAILS[self.tail]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the error model's own parameters, after the form's coefficients."""
        offsets = {
            "iid": (),
            "texture": ("tau_texture",),
            "step": ("tau_step",),
            "texture+step": ("tau_texture", "tau_step"),
            "step-smooth": ("tau_step", "length_h", "length_ratio"),
        }[self.structure]
        return ("sigma", *offsets, *self.distribution.parameter_names)

    @property
    def caution(self) -> str | None:
        """What a reader of Bayes factors under this error model has to be told."""
        return "rows are not independent" if self.structure == "iid" else None


def as_noise(noise: str | Noise) -> Noise:
    """Return an error model from its name, or the model itself."""
    return Noise.named(noise) if isinstance(noise, str) else noise
