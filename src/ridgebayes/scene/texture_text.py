"""Textures as they are typed: two widths with a comma between them."""

import re

from ridgebayes.errors import InputError
from ridgebayes.scene.units import Body


def parse_texture(
    text: str, body: Body | str | None = None, where: str = "--texture"
) -> tuple[float, float]:
    """Return the ridge and groove width of A,B over the radius.

    Parameters
    ----------
    text : str
        Two shares of the radius, or two lengths with units.
    body : Body or str, optional
        Body, or its radius as typed, that lengths are divided by.
    where : str, optional
        Place that errors name.

    Raises
    ------
    InputError
        If it is neither, a width is not finite and above 0, or lengths have no radius.

    Examples
    --------
    >>> parse_texture("0.2 mm, 160 um", "8 mm"), parse_texture("0.025,0.02")
    ((0.025, 0.02), (0.025, 0.02))
    """
    parts = text.split(",")
    with_unit = [has_unit(part) for part in parts]
    if any(with_unit) and not all(with_unit):
        raise InputError(
            f"{where} {text!r}: expected both widths with a unit, or both without (shares of the "
            "radius)"
        )
    try:
        if any(with_unit) and not isinstance(body, Body):
            body = Body.of(body, None)
        a, b = (
            body.over_radius(part) if isinstance(body, Body) and unit else float(part)
            for part, unit in zip(parts, with_unit, strict=True)
        )
    except InputError as error:
        raise InputError(f"{where} {text!r}: {error}") from None
    except ValueError:
        raise InputError(
            f"{where} {text!r}: expected A,B, two numbers with one comma, such as 0.022,0.02"
        ) from None
    if not (0 < a < float("inf") and 0 < b < float("inf")):
        raise InputError(f"{where} {text!r}: expected both widths finite and > 0")
    return a, b


def has_unit(text: str) -> bool:
    """Return whether a unit stands behind a number."""
    return re.search(r"\d.*[^\W\d_eE]", text) is not None
