"""Error models: what stands between a form's load and the load in the table.

An error model is a structure and a tail. The residual of finite-element loads after a form is
fitted is not noise that differs from row to row: it repeats within a texture and from texture to
texture at the same step. A structure says what is shared, a tail how far single rows may stray.
Definitions and reasons: docs/derivations/error-models.md.
"""

from dataclasses import dataclass, field
from typing import ClassVar

from ridgebayes.errors import InputError
from ridgebayes.model.tails import TAILS, Tail

# Variance of a smooth offset that is its place's own, over tau_step^2. It is part of the model: how
# far residuals of one place are taken to be a smooth function of it. A function as smooth as the
# half-plane's residual is known by its neighbours to about this; a smaller nugget asks for more
# digits than double precision has to factorise the covariance, a larger one for less smoothness.
NUGGET = 1e-8
MAX_NUGGET = 1e-4  # a hundredth of the offset's sd: no longer smooth
AUTO = "auto"  # all error models are weighed
SERIES = "series"
SMOOTH = "step-smooth"


@dataclass(frozen=True)
class Noise:
    """Error model of the log loads: ``log load = form + shared offsets + error of the row``.

    Parameters
    ----------
    structure : str
        Which offsets rows share. ``"iid"``: none; ``"texture"``: one offset per texture;
        ``"step"``: one per count Q; ``"texture+step"``: both; ``"step-smooth"``: a smooth function
        of log h (h = Q/2 - 1) and a/pitch, the two things that the half-plane's loads depend on.
        Each also with ``"+series"``, one offset per series over all textures; ``"iid+series"`` is
        called ``"series"``.
    tail : str
        Distribution of a row's own error: ``"normal"`` or ``"student"``.
    nugget : float, optional, dimensionless
        Variance of a smooth offset that is its place's own, over tau_step^2; for sensitivity. Other
        structures do not use it.

    Raises
    ------
    InputError
        If structure or tail is unknown, or `nugget` is not in (0, 1e-4].

    Examples
    --------
    >>> import ridgebayes as rb
    >>> rb.Noise.named("texture+step:student").parameter_names
    ('sigma', 'tau_texture', 'tau_step', 'df')
    >>> series = rb.Noise("iid+series")
    >>> series.name, series.parameter_names, series.factors, series.distribution.name
    ('series', ('sigma', 'tau_series'), ('series',), 'normal')
    >>> series.caution
    'rows are not independent'
    >>> len(rb.Noise.every())
    10
    """

    structure: str = "iid"
    tail: str = "normal"
    nugget: float = field(default=NUGGET, kw_only=True)
    structures: ClassVar[tuple[str, ...]] = (
        "iid",
        "texture",
        "step",
        "texture+step",
        SMOOTH,
    )
    tails: ClassVar[tuple[str, ...]] = tuple(TAILS)

    def __post_init__(self) -> None:
        if self.structure not in _CANONICAL:
            raise InputError(f"noise: expected {_STRUCTURE}, got structure {self.structure!r}")
        if self.tail not in self.tails:
            expected = ", ".join(self.tails)
            raise InputError(f"noise: expected one of {expected}, got tail {self.tail!r}")
        if not 0 < self.nugget <= MAX_NUGGET:
            raise InputError(
                f"nugget: expected a number > 0 and <= {MAX_NUGGET:g}, got {self.nugget!r}"
            )
        object.__setattr__(self, "structure", _CANONICAL[self.structure])

    @classmethod
    def named(cls, name: str) -> "Noise":
        """Return the error model that commands and files call STRUCTURE or STRUCTURE:student.

        Parameters
        ----------
        name : str
            Such as ``texture+step:student``.

        Raises
        ------
        InputError
            If there is no error model of this name.
        """
        structure, colon, tail = name.partition(":")
        if structure not in _CANONICAL or (colon and tail not in cls.tails):
            raise InputError(
                f"noise {name!r}: not an error model; expected STRUCTURE or STRUCTURE:student, "
                f"STRUCTURE {_STRUCTURE}"
            )
        return cls(structure, tail or "normal")

    @classmethod
    def every(cls) -> tuple["Noise", ...]:
        """Return every structure with every tail, without series."""
        return tuple(cls(structure, tail) for tail in cls.tails for structure in cls.structures)

    @classmethod
    def candidates(cls, n_series: int) -> tuple["Noise", ...]:
        """Return the error models to weigh for a table.

        Parameters
        ----------
        n_series : int
            Series, or sources, of the rows that are fitted: `Observations.n_series`.

        Returns
        -------
        tuple of Noise
            `every`; of two or more series also each with ``+series``.

        Examples
        --------
        >>> len(Noise.candidates(1)), len(Noise.candidates(2))
        (10, 20)
        """
        plain = cls.every()
        if n_series < 2:
            return plain
        return plain + tuple(cls(f"{noise.structure}+{SERIES}", noise.tail) for noise in plain)

    @property
    def name(self) -> str:
        """The name that commands and files use."""
        return self.structure if self.tail == "normal" else f"{self.structure}:{self.tail}"

    @property
    def factors(self) -> tuple[str, ...]:
        """Groups that share offsets, of texture, step, step-smooth and series, in this order."""
        return () if self.structure == "iid" else tuple(self.structure.split("+"))

    @property
    def distribution(self) -> Tail:
        """The distribution of a row's own error, standardised."""
        return TAILS[self.tail]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the error model's own parameters, after the form's coefficients."""
        names = [name for factor in self.factors for name in _PARAMETERS[factor]]
        # Lengths after every tau, whatever they belong to.
        names.sort(key=lambda name: not name.startswith("tau_"))
        return ("sigma", *names, *self.distribution.parameter_names)

    @property
    def caution(self) -> str | None:
        """Caution for readers of Bayes factors under this error model."""
        return "rows are not independent" if self.structure in ("iid", SERIES) else None


_PARAMETERS = {
    "texture": ("tau_texture",),
    "step": ("tau_step",),
    SMOOTH: ("tau_step", "length_h", "length_ratio"),
    SERIES: ("tau_series",),
}
_WITH_SERIES = {f"{name}+{SERIES}": f"{name}+{SERIES}" for name in Noise.structures}
_CANONICAL = {name: name for name in (*Noise.structures, SERIES)} | _WITH_SERIES
_CANONICAL[f"iid+{SERIES}"] = SERIES
_STRUCTURE = f"one of {', '.join(Noise.structures)}, each also with +{SERIES}"


def error_models_for(noise: str | Noise, n_series: int) -> list[Noise]:
    """Return the error models to weigh: all that suit the rows for ``auto``, else the named."""
    if noise != AUTO:
        return [as_noise(noise)]
    return list(Noise.candidates(n_series))


def as_noise(noise: str | Noise) -> Noise:
    """Return an error model from its name, or the model itself."""
    return Noise.named(noise) if isinstance(noise, str) else noise
