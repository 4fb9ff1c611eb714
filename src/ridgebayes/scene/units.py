"""Convert quantities with units to exact numbers, in SI units or relative to a body."""

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal, TypeAlias

from ridgebayes.errors import InputError
from ridgebayes.runtime.text import LONGEST_VALUE

Dimension: TypeAlias = Literal["length", "pressure", "line load", "force"]

_SI: dict[Dimension, str] = {"length": "m", "pressure": "Pa", "line load": "N/m", "force": "N"}
EXAMPLES: dict[Dimension, str] = {
    "length": "0.25 mm",
    "pressure": "60 kPa",
    "line load": "20 N/m",
    "force": "5 N",
}
_LOADS: tuple[Dimension, ...] = ("pressure", "line load", "force")
_SIZES = (  # that these loads need: the first, two or all three
    "Young's modulus (--E, or body.youngs_modulus of a scene)",
    "the radius (--R, or body.radius of a scene)",
    "the body's length (--thickness, or load.length of a scene)",
)
_DECIMAL_COMMA = re.compile(r"(?<=[0-9]),(?=[0-9])")
# A number, then unit names with one-digit powers. pint's parser would also accept "2 * 3 mm" and
# would compute "mm ** 999999".
_NUMBER = r"([+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)"
_POWER = r"[^\W\d]+(?:(?:\*\*|\^)-?[0-9])?"
_QUANTITY = re.compile(rf"\s*{_NUMBER}\s*({_POWER}(?:\s*[*/\s]\s*{_POWER})*)\s*")

_PLUS_MINUS = re.compile(r"±|\+/?-(?=\s*[\d.])")


def to_si(text: str, dimension: Dimension) -> Fraction:
    """Convert a quantity such as ``"0.25 mm"`` to its SI unit, exactly.

    Parameters
    ----------
    text : str
        A decimal number and a unit.
    dimension : {"length", "pressure", "line load", "force"}
        Required dimension of the unit; results are in m, Pa, N/m or N.

    Returns
    -------
    fractions.Fraction, scalar, SI unit of the dimension
        Exact, so that ratios of round numbers are round.

    Raises
    ------
    InputError
        If the text is not a number with a unit, or the unit is unknown or measures something
        else.

    Examples
    --------
    >>> float(to_si("0.25 mm", "length") / to_si("8 mm", "length"))
    0.03125
    >>> to_si("1.2 kPa", "pressure")
    Fraction(1200, 1)
    """
    shown = text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."
    rule = f"must be a number and a unit of {dimension}, such as {EXAMPLES[dimension]!r}"
    if _DECIMAL_COMMA.search(text):
        rule = f"has a decimal comma; expected a point, such as {with_point(shown)!r}"
    try:
        number, unit = _QUANTITY.fullmatch(text).groups()  # type: ignore[union-attr]
        factor = _registry().Quantity(1, unit).to(_SI[dimension]).magnitude
        return Fraction(number) * Fraction(factor)
    # pint raises exceptions of many types for an invalid unit (its own, tokenize's, AttributeError,
    # TypeError); some cannot be formatted with fractions, so the message omits them.
    except Exception:
        raise InputError(f"{shown!r}: {rule}") from None


def load_to_si(text: str) -> tuple[Fraction, Dimension]:
    """Return a pressure, line load or force in its SI unit, and its dimension.

    Examples
    --------
    >>> load_to_si("20 N/m")
    (Fraction(20, 1), 'line load')
    """
    for dimension in _LOADS:
        try:
            return to_si(text, dimension), dimension
        except InputError as error:
            if "decimal comma" in str(error):
                raise
    examples = ", ".join(repr(EXAMPLES[name]) for name in _LOADS)
    raise InputError(f"{text!r}: expected a number and a unit of a load, such as {examples}")


def number_and_unit(text: str) -> tuple[float, str]:
    """Return the number and the unit of a quantity; raise InputError for other text.

    Examples
    --------
    >>> number_and_unit("1.2kPa")
    (1.2, 'kPa')
    """
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise InputError(f"{text!r}: expected a number and a unit")
    return float(match[1]), match[2]


def first_quantity(text: str) -> str | None:
    """Return the first number with a unit in the text of a load; None without a unit.

    Examples
    --------
    >>> first_quantity("lognormal(5 N, 10 %)"), first_quantity("5 N ± 0.5 N"), first_quantity("5")
    ('5 N', '5 N ', None)
    """
    parts = re.split(rf"[(),]|{_PLUS_MINUS.pattern}| on ", text)
    return next((part for part in parts if _QUANTITY.fullmatch(part)), None)


def with_error(text: str) -> str:
    """Return the distribution of a value with an error; other text unchanged.

    The error is one standard deviation of the value's logarithm, which keeps the value above 0.

    Raises
    ------
    InputError
        If the value or its error is not a number with a unit, or is not above 0.

    Examples
    --------
    >>> with_error("60 kPa ± 20 %"), with_error("8 mm +- 0.4 mm"), with_error("60 kPa")
    ('lognormal(60 kPa, 20 %)', 'lognormal(8 mm, 5 %)', '60 kPa')
    """
    parts = _PLUS_MINUS.split(text)
    if len(parts) == 1:
        return text
    value, error = (parts[0].strip(), parts[1].strip()) if len(parts) == 2 else ("", "")
    if re.fullmatch(rf"\s*{_NUMBER}\s*%\s*", error):
        return f"lognormal({value}, {error})"
    try:
        (size, kind), (centre, centre_kind) = _size(error), _size(value)
        ratio = float(size / centre) if kind == centre_kind else 0.0
    except (InputError, ValueError, ZeroDivisionError):
        ratio = 0.0
    if not ratio > 0:
        raise InputError(
            f"{text!r}: expected a value and its error, both > 0, in per cent or in a unit of the "
            "same kind, such as '60 kPa ± 20 %'"
        )
    return f"lognormal({value}, {100 * ratio:.12g} %)"


def is_uncertain(text: str) -> bool:
    """Return whether a text is a distribution, or a value with an error."""
    return "(" in text or _PLUS_MINUS.search(text) is not None


def _size(text: str) -> tuple[Fraction, str]:
    """Return a quantity in its SI unit, and its dimension: empty for a plain number."""
    if re.fullmatch(rf"\s*{_NUMBER}\s*", text):
        return Fraction(text), ""
    try:
        return to_si(text, "length"), "length"
    except InputError:
        return load_to_si(text)


def with_point(text: str) -> str:
    """Replace decimal commas by decimal points.

    Examples
    --------
    >>> with_point("0,25 mm")
    '0.25 mm'
    """
    return _DECIMAL_COMMA.sub(".", text)


@functools.cache
def _registry() -> Any:
    """Load pint's unit definitions on first use, because loading takes 0.1 s or more."""
    import pint

    return pint.UnitRegistry(non_int_type=Fraction)


@dataclass(frozen=True)
class Body:
    """A cylinder in SI units.

    Parameters
    ----------
    radius : Fraction or None
        Radius in m.
    modulus : Fraction or None
        Young's modulus in Pa.
    length : Fraction or None
        Length in m, over which a force is spread.
    load : str
        Highest load of a scene as written, such as ``5 N on 12 mm``; empty without a unit.

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
    def of(cls, radius: str | None, modulus: str | None, length: str | None = None) -> "Body":
        """Return a body from values with units; raise InputError for an invalid value."""
        sizes = _positive("--R", radius, "length"), _positive("--E", modulus, "pressure")
        return cls(*sizes, _positive("--thickness", length, "length"))

    @property
    def sizes(self) -> dict[str, Fraction | None]:
        """Values by their places in a scene file."""
        places = ("body.youngs_modulus", "body.radius", "load.length")
        return dict(zip(places, (self.modulus, self.radius, self.length), strict=True))

    def over_radius(self, text: str) -> float:
        """Return a length with a unit over the radius; raise InputError without a radius."""
        value = to_si(text, "length")
        if self.radius is None:
            raise InputError(f"{text!r}: needs the radius; expected --R, or a scene that has it")
        return float(value / self.radius)

    def p_over_E(self, text: str) -> float:
        """Return p/E of a load; raise InputError if a required value of the body is missing."""
        value, dimension = load_to_si(text)
        needed = zip(_SIZES[: 1 + _LOADS.index(dimension)], self.sizes.values(), strict=False)
        lacking = [name for name, size in needed if size is None]
        if lacking:
            raise InputError(f"{text!r}: needs {' and '.join(lacking)}")
        return float(value / loads_at_modulus(*self.sizes.values())[dimension])

    @property
    def load_unit(self) -> tuple[str, Dimension] | None:
        """Unit and dimension of `load`; None without a unit."""
        quantity = first_quantity(self.load)
        if quantity is None:
            return None
        return number_and_unit(quantity)[1], load_to_si(quantity)[1]


NO_UNITS = Body()
LENGTHS = {
    "a": "ridge_width",
    "b": "groove_width",
    "depth": "groove_depth",
    "corner": "corner_radius",
}


def over_body(at: Mapping[str, Any], texture: str = "texture[1]") -> dict[str, Any]:
    """Return values of a scene over R and E from the values of its file.

    Parameters
    ----------
    at : mapping of str to number or ndarray of float
        Values by place in the file, such as ``body.radius``. Exact numbers give exact results,
        and draws give draws.
    texture : str, optional
        Place of the texture, if the file has several.

    Returns
    -------
    dict
        nu and offset, and those of a, b, depth, corner and p_over_E that the file gives.

    Examples
    --------
    >>> at = {"body.radius": Fraction(2), "body.poissons_ratio": 0.5, "texture.offset": 0.0}
    >>> over_body(at | {"texture.ridge_width": Fraction(1, 10)})["a"]
    Fraction(1, 20)
    """
    texture = "texture" if "texture.ridge_width" in at else texture
    radius, modulus = at.get("body.radius", 1), at.get("body.youngs_modulus")
    lengths = {name: at.get(f"{texture}.{key}") for name, key in LENGTHS.items()}
    values = {name: length / radius for name, length in lengths.items() if length is not None}
    values |= {"nu": at["body.poissons_ratio"], "offset": at[f"{texture}.offset"]}
    units = loads_at_modulus(modulus, radius, at.get("load.length", 1)).values()
    # A scene without units may have a load p/E only.
    for key, unit in [("p_over_E", 1), *zip(("max", "line", "force"), units, strict=False)]:
        if f"load.{key}" in at:
            values["p_over_E"] = at[f"load.{key}"] / unit
    return values


def loads_at_modulus(modulus: Any, radius: Any, length: Any) -> dict[Dimension, Any]:
    """Return the load of each kind at which p = E, of a body whose sizes are numbers or draws.

    The line load is P' = 2 R p. Loads that need a size which is None are left out.

    Examples
    --------
    >>> loads_at_modulus(60_000, 0.5, None)
    {'pressure': 60000, 'line load': 60000.0}
    """
    loads: dict[Dimension, Any] = {}
    load = 1
    for dimension, factor, size in zip(_LOADS, (1, 2, 1), (modulus, radius, length), strict=True):
        if size is None:
            break
        loads[dimension] = load = load * (factor * size)
    return loads


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
