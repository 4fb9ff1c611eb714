"""Error models: the distribution of a table's loads about the loads of a form.

An error model has a structure and a tail. The residuals of a form fitted to finite-element loads
are not independent: they are similar within a texture, and at the same step of different textures.
The structure defines which rows share offsets, the tail the distribution of each row's own error.
Definitions and reasons are in docs/derivations/error-models.md.
"""

from dataclasses import dataclass, field
from numbers import Real
from typing import ClassVar

from ridgebayes.errors import InputError, expect
from ridgebayes.model.tails import TAILS, Tail

# Independent variance of a smooth offset at each place, over tau_step^2. The nugget is part of the
# model and limits the smoothness of the offset. With a smaller nugget double precision cannot
# factorise the covariance; the half-plane's residual is smoother than a larger nugget assumes.
NUGGET = 1e-8
MAX_NUGGET = 1e-4  # independent part of 1 % of the offset's sd; a larger one is no longer smooth
AUTO = "auto"  # all error models are compared and averaged
SERIES = "series"
SMOOTH = "step-smooth"


@dataclass(frozen=True)
class Noise:
    """Error model of the log loads: ``log load = form + shared offsets + error of the row``.

    Parameters
    ----------
    structure : str
        Offsets that rows share. ``"iid"``: none; ``"texture"``: one offset per texture; ``"step"``:
        one per count Q; ``"texture+step"``: both; ``"step-smooth"``: a smooth function of log h (h
        = Q/2 - 1) and a/pitch, which determine the half-plane's load over pitch^2. Each structure
        can be followed by ``"+series"``, one offset per series over all textures; ``"iid+series"``
        is called ``"series"``.
    tail : str
        Distribution of a row's own error: ``"normal"`` or ``"student"``.
    nugget : float, optional, dimensionless
        Independent variance of a smooth offset at each place, over tau_step^2, for sensitivity
        studies. Other structures do not use it.

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
        expect(str, structure=self.structure, tail=self.tail)
        expect(Real, nugget=self.nugget)
        if self.structure not in _STRUCTURE_NAMES:
            raise InputError(f"noise: expected {_STRUCTURE_RULE}, got structure {self.structure!r}")
        if self.tail not in self.tails:
            expected = ", ".join(self.tails)
            raise InputError(f"noise: expected one of {expected}, got tail {self.tail!r}")
        if not 0 < self.nugget <= MAX_NUGGET:
            raise InputError(
                f"nugget: expected a number > 0 and <= {MAX_NUGGET:g}, got {self.nugget!r}"
            )
        object.__setattr__(self, "structure", _STRUCTURE_NAMES[self.structure])

    @classmethod
    def named(cls, name: str) -> "Noise":
        """Return an error model by the name that commands and files use.

        Parameters
        ----------
        name : str
            STRUCTURE or STRUCTURE:student, for example ``texture+step:student``.

        Raises
        ------
        InputError
            If there is no error model of this name.
        """
        structure, colon, tail = str(name).partition(":")  # None, too, is refused
        if structure not in _STRUCTURE_NAMES or (colon and tail not in cls.tails):
            raise InputError(
                f"noise {name!r}: not an error model; expected STRUCTURE or STRUCTURE:student, "
                f"STRUCTURE {_STRUCTURE_RULE}"
            )
        return cls(structure, tail or "normal")

    @classmethod
    def every(cls) -> tuple["Noise", ...]:
        """Return all combinations of structures and tails, without series."""
        return tuple(cls(structure, tail) for tail in cls.tails for structure in cls.structures)

    @classmethod
    def candidates(cls, n_series: int) -> tuple["Noise", ...]:
        """Return the error models to compare for a table.

        Parameters
        ----------
        n_series : int
            Number of series, or sources, of the fitted rows: `Observations.n_series`.

        Returns
        -------
        tuple of Noise
            All of `every`; for two or more series also each of them with ``+series``.

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
        """Name in commands and files."""
        return self.structure if self.tail == "normal" else f"{self.structure}:{self.tail}"

    @property
    def factors(self) -> tuple[str, ...]:
        """Factors whose levels have offsets: texture, step, step-smooth, series, in this order."""
        return () if self.structure == "iid" else tuple(self.structure.split("+"))

    @property
    def distribution(self) -> Tail:
        """Distribution of a row's own error in units of its scale."""
        return TAILS[self.tail]

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the error model's parameters, which follow the form's coefficients."""
        names = [name for factor in self.factors for name in _FACTOR_PARAMETERS[factor]]
        # Every tau comes before every length.
        names.sort(key=lambda name: not name.startswith("tau_"))
        return ("sigma", *names, *self.distribution.parameter_names)

    @property
    def caution(self) -> str | None:
        """Caution to print with Bayes factors under this error model, or None."""
        return "rows are not independent" if self.structure in ("iid", SERIES) else None


_FACTOR_PARAMETERS = {
    "texture": ("tau_texture",),
    "step": ("tau_step",),
    SMOOTH: ("tau_step", "length_h", "length_ratio"),
    SERIES: ("tau_series",),
}
_WITH_SERIES = {f"{name}+{SERIES}": f"{name}+{SERIES}" for name in Noise.structures}
_STRUCTURE_NAMES = {name: name for name in (*Noise.structures, SERIES)} | _WITH_SERIES
_STRUCTURE_NAMES[f"iid+{SERIES}"] = SERIES
_STRUCTURE_RULE = f"one of {', '.join(Noise.structures)}, each also with +{SERIES}"


def error_models_for(noise: str | Noise, n_series: int) -> list[Noise]:
    """Return the error models to compare: all candidates for ``auto``, else the given model."""
    if not isinstance(noise, str) or noise != AUTO:
        return [as_noise(noise)]
    return list(Noise.candidates(n_series))


def as_noise(noise: str | Noise) -> Noise:
    """Return the error model, or the error model of the given name."""
    return noise if isinstance(noise, Noise) else Noise.named(noise)
