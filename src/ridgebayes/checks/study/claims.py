"""The study's claims one by one, each beside our own numbers; their words are in `claims.toml`.

Loads are those of the half-plane equation (`contact.halfplane`), which has no fitted coefficient
and no load increment; coefficients are the printed ones and, where it makes sense, those of a
comparison. Nothing is typed in but the claims themselves.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray, IntArray, Json
from ridgebayes.checks.least_squares import fit_by_least_squares, power_law_r_squared
from ridgebayes.checks.load_errors import PAPER_TEXTURES
from ridgebayes.checks.study.smooth import SmoothCurve
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.contact.halfplane import transition_loads
from ridgebayes.contact.hertz import half_width
from ridgebayes.contact.scaling import Texture
from ridgebayes.model.forms import Classic, Form, Hybrid, Modified
from ridgebayes.runtime.reading import read_toml
from ridgebayes.runtime.text import MINUS
from ridgebayes.table.table import ContactTable

FORMS = (Classic(), Modified(), Hybrid())  # that have printed coefficients
CONFIRMED = "confirmed"
NOT_CONFIRMED = "not confirmed"
DEPENDS = "depends on the definition"
NOT_TESTED = "not tested here"
STEPS = 4 + 2 * np.arange(6)  # Q = 4 to 14: as far as the study's figures go
VERDICTS = (CONFIRMED, NOT_CONFIRMED, DEPENDS, NOT_TESTED)

NARROW, WIDE, EXTREME = PAPER_TEXTURES
NINE: tuple[Texture, ...] = tuple((a, b) for a in (0.012, 0.022, 0.032) for b in (0.01, 0.02, 0.03))


@dataclass(frozen=True)
class Claim:
    """One claim of the study and what became of it.

    Parameters
    ----------
    text : str
        The claim.
    where : str
        Where the study makes it.
    ours : str
        Our numbers.
    verdict : str
        One of `VERDICTS`.
    """

    text: str
    where: str
    ours: str
    verdict: str


def pair(texture: Texture) -> str:
    """Return (A, B) as the study writes textures.

    Examples
    --------
    >>> pair((0.012, 0.09))
    '(0.012, 0.09)'
    """
    return f"({texture[0]:g}, {texture[1]:g})"


def paper_claims(comparison: Comparison, curves: Sequence[SmoothCurve]) -> tuple[Claim, ...]:
    """Check every claim of the study.

    Parameters
    ----------
    comparison : Comparison
        Of the embedded sweep: supplies calibrated coefficients (posterior means) and the rows for
        least squares.
    curves : sequence of SmoothCurve
        The smooth cylinder.

    Returns
    -------
    tuple of Claim
        In the order of the study.

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026.
    """
    return (
        smooth_claim(curves),
        power_law_claim(comparison.table),
        modified_claim(comparison.table),
        coefficients_claim(Modified(), comparison.table, "eq. (6)"),
        coefficients_claim(Hybrid(), comparison.table, "eq. (7)"),
        classic_claim(),
        *modified_error_claims(comparison),
        hybrid_error_claim(comparison),
        errors_fall_claim(),
        worst_step_claim(),
        *first_step_claims(),
        longer_claim(),
        threshold_claim(),
        convergence_claim(),
    )


@cache
def _words() -> Json:
    return read_toml(Path(__file__).with_suffix(".toml"))


def _claim(name: str, verdict: str | bool, **numbers: object) -> Claim:
    """Return one of `claims.toml` with our numbers, and a verdict or whether it is confirmed."""
    told = {key: words.format(**numbers) for key, words in _words()[name].items()}
    if isinstance(verdict, bool):
        verdict = CONFIRMED if verdict else NOT_CONFIRMED
    return Claim(**told, verdict=verdict)


def smooth_claim(curves: Sequence[SmoothCurve]) -> Claim:
    """Check the smooth cylinder against Hertz."""
    half_plane, *elements = curves
    r2 = min(curve.r_squared for curve in elements)
    worst = max(curve.worst_count_error for curve in elements)
    loads = "; ".join(f"{c.name} {100 * c.worst_load_error:.1f} %" for c in elements)
    digits = _digits(half_plane.worst_load_error)
    fine = r2 > 0.995 and worst <= 0.02
    return _claim("smooth", fine, r2=r2, worst=100 * worst, loads=loads, digits=digits)


def power_law_claim(table: ContactTable) -> Claim:
    """Check R^2 of the power law, texture by texture."""
    found = power_law_r_squared(table)
    worst = min(found, key=lambda texture: found[texture])
    least, most = found[worst], max(found.values())
    n, where = len(found), pair(worst)
    return _claim("power_law", least > 0.999, n=n, least=least, worst=where, most=most)


def modified_claim(table: ContactTable) -> Claim:
    """Check R^2 of Modified, all textures together."""
    found = fit_by_least_squares(Modified(), table)
    return _claim("modified", found.r_squared >= 0.9985, n=found.n_row, r2=found.r_squared)


def coefficients_claim(form: Form, table: ContactTable, where: str) -> Claim:
    """Check whether least squares finds a form's printed coefficients again."""
    printed = dict(zip(form.parameter_names, form.printed or (), strict=True))
    values = ", ".join(f"{_subscript(name)} = {value}" for name, value in printed.items())
    found = fit_by_least_squares(form, table)
    ours, near = [], []
    for name, value in printed.items():
        own, spread = found.coefficients[name], found.standard_errors[name]
        half_digit = 0.5 * 10.0 ** -len(str(value).partition(".")[2])
        # As near as the printed digits and the scatter of the fit can tell.
        near.append(abs(own - value) <= half_digit + 2 * spread)
        places = max(1 - math.floor(math.log10(spread)), 0)
        ours.append(f"{_subscript(name)} = {own:.{places}f} ± {spread:.{places}f}")
    told = {"form": form.name.capitalize(), "printed": values, "found": ", ".join(ours)}
    return _claim("coefficients", all(near), where=where, n=found.n_row, **told)


def _subscript(name: str) -> str:
    return name.translate(str.maketrans("12", "₁₂"))


def _digits(error: float) -> int:
    return 15 if error < 1e-15 else int(-math.log10(error))


def classic_claim() -> Claim:
    """Check that Classic asks for too much load."""
    errors = np.concatenate([load_error(Classic(), t, STEPS) for t in (*NINE, EXTREME)])
    n_high, last = int(np.sum(errors > 0)), STEPS[-1]
    sizes = {"low": errors.min(), "high": errors.max(), "last": last}
    return _claim("classic", n_high == errors.size, n_high=n_high, n=errors.size, **sizes)


def modified_error_claims(comparison: Comparison) -> Iterator[Claim]:
    """Check how far Modified is off at the three textures of the figures."""
    cases = (
        (NARROW, "1-2 %", 0.5, 2.5, STEPS[:4]),
        (WIDE, "3-5 %", 2.5, 5.5, STEPS[:4]),
        (EXTREME, "up to 15 %", 0.0, 15.5, STEPS[:3]),
    )
    for texture, words, low, high, counts in cases:
        size = np.abs(load_error(Modified(), texture, counts))
        yield _claim(
            "modified_errors",
            bool(np.all((size >= low) & (size <= high))),
            words=words,
            texture=pair(texture),
            both=_ranges(Modified(), comparison, texture, counts),
            first=counts[0],
            last=counts[-1],
            low=size[1:].min(),
            high=size[1:].max(),
        )


def hybrid_error_claim(comparison: Comparison) -> Claim:
    """Check whether Hybrid stays within 2 %."""
    parts, fine = [], []
    for texture in PAPER_TEXTURES:
        counts = STEPS[:3] if texture == EXTREME else STEPS[:4]
        parts.append(f"at {pair(texture)} {_ranges(Hybrid(), comparison, texture, counts)}")
        fine.append(np.abs(load_error(Hybrid(), texture, counts)).max() <= 2.5)
    return _claim("hybrid_errors", all(fine), found="; ".join(parts))


def errors_fall_claim() -> Claim:
    """Check whether errors fall with Q at narrow grooves."""
    sizes = {form.name: np.abs(load_error(form, NARROW, STEPS)) for form in FORMS}
    ends = ", ".join(f"{name} {e[0]:.1f} % to {e[-1]:.1f} %" for name, e in sizes.items())
    not_so = [name for name, e in sizes.items() if not np.all(np.diff(e) < 0)]
    rest = f" Not at every step: {', '.join(not_so)}." if not_so else ""
    told = {"texture": pair(NARROW), "last": STEPS[-1], "ends": ends, "rest": rest}
    return _claim("errors_fall", not not_so, **told)


def worst_step_claim() -> Claim:
    """Check where errors are largest at wide grooves."""
    parts, at_8 = [], []
    for texture in (WIDE, EXTREME):
        for form in (Modified(), Hybrid()):
            sizes = np.abs(load_error(form, texture, STEPS))
            worst = int(STEPS[np.argmax(sizes)])
            parts.append(f"{form.name} at {pair(texture)}: Q = {worst} ({sizes.max():.1f} %)")
            at_8.append(worst == 8)
    return _claim("worst_step", all(at_8), last=STEPS[-1], found="; ".join(parts))


def first_step_claims() -> Iterator[Claim]:
    """Check the shortfall at the first step, and what the study blames it on."""
    low = {t: float(load_error(Modified(), t, STEPS[:1])[0]) for t in NINE if t[1] == 0.01}
    shortfalls = "; ".join(f"{-error:.1f} % at {pair(t)}" for t, error in low.items())
    all_low = all(error < 0 for error in low.values())
    yield _claim("first_step", all_low, shortfalls=shortfalls)
    # Without an increment.
    yield _claim("increment", NOT_CONFIRMED if all_low else NOT_TESTED, shortfalls=shortfalls)


def _ranges(form: Form, comparison: Comparison, texture: Texture, counts: IntArray) -> str:
    """Return percent errors in words: with printed and, if there are, calibrated coefficients."""
    sets: list[tuple[str, FloatArray | None]] = [("printed", None)]
    if form.name in comparison.fits:
        fit = comparison.fits[form.name]
        sets.append(("calibrated", fit.summary["mean"].to_numpy()[: fit.model.n_coefficient]))
    words = []
    for name, theta in sets:
        errors = load_error(form, texture, counts, theta)
        words.append(f"{_signed(errors.min())} to {_signed(errors.max())} % {name}")
    return ", ".join(words)


def _signed(x: float) -> str:
    return f"{x:+.1f}".replace("-", MINUS)


def load_error(
    form: Form, texture: Texture, counts: IntArray, theta: FloatArray | None = None
) -> FloatArray:
    """Return 100 (p_form/p_half-plane - 1)."""
    exact = exact_loads(texture, int(counts[-1]) // 2 - 1)[counts // 2 - 2]
    return 100 * (form.load(counts, *texture, theta) / exact - 1)


def exact_loads(texture: Texture, n: int) -> FloatArray:
    """Return the half-plane equation's p/E of the first n transitions at nu = 0.5."""
    return transition_loads(*texture, n).p_over_E(texture[0] + texture[1])


def longer_claim() -> Claim:
    """Check whether grooves make contact longer."""
    a, b = NARROW
    hertz = float(half_width(exact_loads(NARROW, 1)[0]))
    distal, proximal = (b / 2 + a) / hertz, (b / 2 + a + b) / hertz
    verdict = DEPENDS if distal < 1 < proximal else distal > 1
    return _claim("longer", verdict, texture=pair(NARROW), distal=distal, proximal=proximal)


def threshold_claim() -> Claim:
    """Check whether the groove effect has a threshold in b/R."""
    a = WIDE[0]
    widths = (0.01, 0.02, 0.03, EXTREME[1])
    excess = [float(load_error(Classic(), (a, b), STEPS[1:2])[0]) for b in widths]
    listed = ", ".join(f"{e:.0f} % at {b:g}" for e, b in zip(excess, widths, strict=True))
    large = (10 * a, 10 * WIDE[1])
    again = float(load_error(Classic(), large, STEPS[1:2])[0])
    # The same error at a tenth of b/R: b/R is not what decides.
    is_so = not abs(again - excess[2]) < 0.01 * excess[2]
    return _claim("threshold", is_so, a=a, excess=listed, scaled=pair(large), again=again)


def convergence_claim() -> Claim:
    """Check what is known of the runs that did not converge."""
    a, _ = EXTREME
    loads = exact_loads(EXTREME, 3)
    # 2 R p is carried by 2k ridges of width a when ridge k is reached.
    pressure = loads / (a * np.arange(1, len(loads) + 1))
    listed = ", ".join(f"{p:.2f} E at Q = {q}" for p, q in zip(pressure, STEPS, strict=False))
    return _claim("convergence", NOT_TESTED, texture=pair(EXTREME), pressures=listed)
