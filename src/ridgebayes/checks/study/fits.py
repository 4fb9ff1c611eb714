# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Claims about fits: R^2, printed coefficients, the smooth cylinder."""

import math

import numpy as np

from ridgebayes.checks.least_squares import fit_by_least_squares, power_law_r_squared
from ridgebayes.checks.smooth import smooth_cylinder
from ridgebayes.checks.study.record import CONFIRMED, NOT_CONFIRMED, NOT_TESTED, Claim, pair
from ridgebayes.errors import InputError
from ridgebayes.model.forms import Form, Modified
from ridgebayes.table.table import ContactTable


def smooth_claim() -> Claim:
    """Check the smooth cylinder against Hertz."""
    half_plane, *elements = smooth_cylinder()
    r2 = min(curve.r_squared for curve in elements)
    worst = max(curve.worst_count_error for curve in elements)
    loads = "; ".join(f"{c.name} {100 * c.worst_load_error:.1f} %" for c in elements)
    return Claim(
        "Smooth cylinder: finite elements agree with Hertz, R² about 1, at most 2 % error.",
        "Fig. 3",
        f"Finite-element rows against eq. (1) up to a half-width of 0.2 R: R² at least {r2:.4f}, "
        f"at most {100 * worst:.1f} % in Q′. In load: {loads}. The half-plane equation without "
        f"grooves is Hertz to {_digits(half_plane.worst_load_error)} digits.",
        CONFIRMED if r2 > 0.995 and worst <= 0.02 else NOT_CONFIRMED,
    )


def power_law_claim(table: ContactTable) -> Claim:
    """Check R^2 of the power law, texture by texture."""
    found = power_law_r_squared(table)
    text, where = "The power law fits each texture with R² > 0.999.", "section 3.1, Fig. 4"
    if not found:
        return Claim(text, where, "No texture of this table has two counts.", NOT_TESTED)
    worst = min(found, key=lambda texture: found[texture])
    return Claim(
        text,
        where,
        f"Least squares on Q, {len(found)} textures of this table: R² between "
        f"{found[worst]:.5f} at (A, B) = {pair(worst)} and {max(found.values()):.5f}.",
        CONFIRMED if found[worst] > 0.999 else NOT_CONFIRMED,
    )


def modified_claim(table: ContactTable) -> Claim:
    """Check R^2 of Modified, all textures together."""
    text, where = "The Modified form fits all textures with R² = 0.999.", "section 3.1"
    try:
        found = fit_by_least_squares(Modified(), table)
    except InputError as error:
        return Claim(text, where, str(error), NOT_TESTED)
    if math.isnan(found.r_squared):
        return Claim(text, where, "All rows of this table have one count.", NOT_TESTED)
    return Claim(
        text,
        where,
        f"Least squares on Q, {found.n_row} rows of this table: R² = {found.r_squared:.4f}.",
        CONFIRMED if found.r_squared >= 0.9985 else NOT_CONFIRMED,
    )


def coefficients_claim(form: Form, table: ContactTable, where: str) -> Claim:
    """Check whether least squares finds a form's printed coefficients again."""
    printed = dict(zip(form.parameter_names, form.printed or (), strict=True))
    values = ", ".join(f"{_subscript(name)} = {value}" for name, value in printed.items())
    text = f"{form.name.capitalize()}: least squares gives {values}."
    try:
        found = fit_by_least_squares(form, table)
    except InputError as error:
        return Claim(text, where, str(error), NOT_TESTED)
    ours, near = [], []
    for name, value in printed.items():
        own, spread = found.coefficients[name], found.standard_errors[name]
        half_digit = 0.5 * 10.0 ** -len(str(value).partition(".")[2])
        # As near as the printed digits and the scatter of the fit can tell.
        near.append(abs(own - value) <= half_digit + 2 * np.nan_to_num(spread))
        ours.append(f"{_subscript(name)} = {_to_two_digits(own, spread)}")
    return Claim(
        text,
        where,
        f"Least squares on Q, {found.n_row} rows of this table: {', '.join(ours)}.",
        CONFIRMED if all(near) else NOT_CONFIRMED,
    )


def _subscript(name: str) -> str:
    return name.translate(str.maketrans("12", "₁₂"))


def _to_two_digits(value: float, spread: float) -> str:
    if not (math.isfinite(spread) and spread > 0):
        return f"{value:.5g}"
    places = max(1 - math.floor(math.log10(spread)), 0)
    return f"{value:.{places}f} ± {spread:.{places}f}"


def _digits(error: float) -> int:
    return 15 if error < 1e-15 else int(-math.log10(error))
