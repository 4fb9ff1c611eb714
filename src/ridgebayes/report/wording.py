# ruff: noqa: RUF001  (typographic minus, times and Greek are intended)
"""Names and numbers as text: errors with two digits, values rounded to match, a dash for NaN."""

import math
import re
from collections.abc import Sequence
from functools import cache
from typing import Any

from ridgebayes import drawing
from ridgebayes.runtime.templates import environment_of
from ridgebayes.runtime.text import count, short_label

ABSENT = "–"
_STRUCTURES = {
    "iid": "independent rows",
    "texture": "texture offsets",
    "step": "step offsets",
    "texture+step": "texture and step offsets",
    "step-smooth": "an offset smooth in log h and a/pitch",
}
COMPONENTS = {
    "texture": "Texture offsets",
    "step": "Step offsets",
    "smooth": "Smooth offset in log h and a/pitch",
    "series": "Series offsets",
    "student": "Student errors (outliers)",
}


def say(sentence: str, **values: object) -> str:
    """Return a text of ``templates/sentences.jinja`` with values filled in.

    Examples
    --------
    >>> say("pairs_caption", noise="iid").partition(". ")[0]
    'Bayes factors under one error model, iid'
    """
    return re.sub(r"[ \n]+", " ", str(getattr(_sentences(), sentence)(**values))).strip()


@cache
def _sentences() -> Any:
    name = "sentences.jinja"
    environment = environment_of("ridgebayes.report", name)
    filters = (listed, number, decimals, probability, percent, count)
    environment.filters |= {"form": form_name} | {x.__name__: x for x in filters}
    return environment.get_template(name).module


def form_name(name: str) -> str:
    """Return the displayed name of a form.

    Examples
    --------
    >>> form_name("power-law")
    'Power law'
    """
    return drawing.style.TITLES.get(name, name)


def parameter_name(name: str) -> str:
    """Return the displayed symbol of a parameter.

    Examples
    --------
    >>> parameter_name("c2"), parameter_name("K[a0.027777777777777776_b0.02]")
    ('c₂', 'K of a0.027778_b0.02')
    """
    if name.startswith("K["):
        return f"K of {short_label(name[2:-1])}"
    return drawing.style.SYMBOLS.get(name, (name,))[0]


def noise_name(name: str) -> str:
    """Return a description of an error model.

    Examples
    --------
    >>> noise_name("texture+step:student")
    'texture and step offsets, Student errors'
    >>> noise_name("step+series")
    'step offsets, series offsets, normal errors'
    """
    structure, _, tail = name.partition(":")
    base = "iid" if structure == "series" else structure.removesuffix("+series")
    words = [_STRUCTURES.get(base, base), f"{tail.capitalize() or 'normal'} errors"]
    if base != structure:
        words.insert(1, "series offsets")
    return ", ".join(words)


def change_text(change: str) -> str:
    """Return a description of a change of a prior or error model named by a verdict.

    Examples
    --------
    >>> change_text("hybrid's c prior's scale times 10"), change_text("error model iid alone")
    ("Hybrid's prior of c₁ 10 times as wide", 'the error model "independent rows, normal errors"')
    """
    if match := re.fullmatch(r"(?:(\S+)'s )?(\S+) prior's scale times (\S+)", change):
        form, parameter, factor = match.groups()
        owner = f"{form_name(form)}'s" if form else "the"
        parameter = "c1" if (form, parameter) == ("hybrid", "c") else parameter
        return f"{owner} prior of {parameter_name(parameter)} {factor} times as wide"
    if match := re.fullmatch(r"error model (\S+) alone", change):
        return f'the error model "{noise_name(match[1])}"'
    return change


def listed(words: Sequence[str]) -> str:
    """Return words as an enumeration in a sentence.

    Examples
    --------
    >>> listed(["Hybrid"]), listed(["Hybrid", "Modified", "Classic"])
    ('Hybrid', 'Hybrid, Modified and Classic')
    """
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def number(x: float, digits: int = 4) -> str:
    """Return a number with some significant digits.

    Examples
    --------
    >>> number(0.018009), number(1.3e-28, 2), number(float("nan")), number(-64.188, 4)
    ('0.01801', '1.3 × 10⁻²⁸', '–', '−64.19')
    """
    if x is None or math.isnan(x):
        return ABSENT
    if math.isinf(x):
        return "∞" if x > 0 else "−∞"
    if x == 0:
        return "0"
    exponent = math.floor(math.log10(abs(x)))
    if -5 <= exponent < 7:
        decimals = max(digits - 1 - exponent, 0)
        return _minus(f"{x:,.{decimals}f}" if exponent >= 4 else f"{x:.{decimals}f}")
    mantissa, _, power = f"{x:.{max(digits - 1, 0)}e}".partition("e")
    return _minus(f"{mantissa} × 10") + _superscript(int(power))


def decimals(x: float, places: int) -> str:
    """Return a number with a fixed number of decimals.

    Examples
    --------
    >>> decimals(-0.0004, 2), decimals(float("nan"), 2)
    ('0.00', '–')
    """
    if x is None or math.isnan(x):
        return ABSENT
    return _minus(f"{x:z.{places}f}")


def with_error(value: float, error: float, most: int = 4) -> str:
    """Return value ± error, the error with two significant digits and at most `most` decimals.

    Examples
    --------
    >>> with_error(1.33707, 0.0099), with_error(83.386907, 1.9e-7), with_error(2.0, float("nan"))
    ('1.3371 ± 0.0099', '83.3869', '2.0000')
    >>> with_error(-20.3084, 0.0027, 1)
    '−20.3'
    """
    if value is None or math.isnan(value):
        return ABSENT
    if error is None or not math.isfinite(error) or error <= 0:
        return decimals(value, most)
    places = min(max(1 - math.floor(math.log10(error)), 0), most)
    if error < 0.5 * 10.0**-most:
        return decimals(value, places)
    return f"{decimals(value, places)} ± {error:.{places}f}"


def probability(p: float | None) -> str:
    """Return a probability; rounding never gives 1 or 0.

    Examples
    --------
    >>> probability(0.98927), probability(1.3e-28), probability(0.9999999)
    ('0.989', '1.3 × 10⁻²⁸', '> 0.9999')
    """
    if p is None or math.isnan(p):
        return ABSENT
    if p == 1:
        return "1"
    if p > 0.9999:
        return "> 0.9999"
    if p > 0.999:
        return decimals(p, 5)
    return decimals(p, 3) if p >= 0.01 else number(p, 2)


def percent(share: float) -> str:
    """Return a share in per cent.

    Examples
    --------
    >>> percent(0.9), percent(0.955)
    ('90 %', '95.5 %')
    """
    return f"{100 * share:g} %"


def interval(low: float, high: float, spread: float) -> str:
    """Return an interval rounded to the second significant digit of the spread.

    Examples
    --------
    >>> interval(0.010495, 0.025729, 0.0046), interval(1.0, 2.0, 0.0)
    ('0.0105 to 0.0257', '1.000 to 2.000')
    """
    if not (math.isfinite(spread) and spread > 0):
        return f"{number(low)} to {number(high)}"
    places = max(1 - math.floor(math.log10(spread)), 0)
    return f"{decimals(low, places)} to {decimals(high, places)}"


def _minus(text: str) -> str:
    return text.replace("-", "−")


def _superscript(n: int) -> str:
    return str(n).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
