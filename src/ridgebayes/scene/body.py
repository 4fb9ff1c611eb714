"""`Body`: what loads and lengths with units are divided by. Scenes themselves are free of units."""

from dataclasses import dataclass
from fractions import Fraction

from ridgebayes.errors import InputError
from ridgebayes.scene.units import EXAMPLES, Dimension, to_si

_LOADS: tuple[Dimension, ...] = ("pressure", "line load", "force")


@dataclass(frozen=True)
class Body:
    """A cylinder in SI units.

    Parameters
    ----------
    radius : Fraction or None
        In m.
    modulus : Fraction or None
        Young's modulus in Pa.
    length : Fraction or None
        In m; a force is spread over it.
    load : str
        A scene's highest load as it was written, such as ``5 N on 12 mm``; empty where it has no
        unit.

    Examples
    --------
    >>> Body.of("8 mm", "60 kPa").p_over_E("1.2 kPa")
    0.02
    """

    radius: Fraction | None = None
    modulus: Fraction | None = None
    length: Fraction | None = None
    load: str = ""

    @classmethod
    def of(cls, radius: str | None, modulus: str | None) -> "Body":
        """Return a body of values with units; InputError if one is none, or not above 0."""
        return cls(_positive("--R", radius, "length"), _positive("--E", modulus, "pressure"))

    def over_radius(self, text: str) -> float:
        """Return a length with a unit over the radius; InputError if that cannot be."""
        value = to_si(text, "length")
        if self.radius is None:
            raise InputError(f"{text!r}: needs the radius; expected --R or --scene with units")
        return float(value / self.radius)

    def p_over_E(self, text: str) -> float:
        """Return p/E of a pressure, line load or force; InputError if that cannot be."""
        for dimension in _LOADS:
            try:
                value = to_si(text, dimension)
            except InputError as error:
                if "decimal comma" in str(error):
                    raise
                continue
            return float(value / self._unit(text, dimension))
        examples = ", ".join(repr(EXAMPLES[one]) for one in _LOADS)
        raise InputError(f"{text!r}: expected a number and a unit of a load, such as {examples}")

    def _unit(self, text: str, dimension: Dimension) -> Fraction:
        """Return the load of a kind at which p = E: 2 R E for a line load, for p is over 2 R."""
        parts = {"Young's modulus (--E)": self.modulus}
        if dimension != "pressure":
            parts["the radius (--R)"] = self.radius
        if dimension == "force":
            parts["the body's length (load.length of --scene)"] = self.length
        lacking = [name for name, value in parts.items() if value is None]
        if lacking:
            raise InputError(f"{text!r}: needs {' and '.join(lacking)}, or a --scene with units")
        unit = Fraction(1 if dimension == "pressure" else 2)
        for value in parts.values():
            unit *= value or 1
        return unit


def _positive(option: str, text: str | None, dimension: Dimension) -> Fraction | None:
    if text is None:
        return None
    try:
        value = to_si(text, dimension)
    except InputError as error:
        raise InputError(f"{option} {error}") from None
    if value <= 0:
        raise InputError(f"{option} {text!r}: must be > 0")
    return value
