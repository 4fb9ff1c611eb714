"""Text of messages: quoted values, shortened labels, and numbers in words."""

import math
import platform
import re
import signal
import unicodedata
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version

MINUS = "\N{MINUS SIGN}"
# Packages that numbers depend on, and packages for files and figures.
_COMPUTING_PACKAGES = ("ridgebayes", "numpy", "scipy", "pandas", "emcee", "arviz")
_OUTPUT_PACKAGES = ("xarray", "corner", "matplotlib")
LONGEST_VALUE = 200  # characters shown of a value from a file
_INVISIBLE = ("Cc", "Cf", "Cs", "Zl", "Zp")  # Unicode categories, with marks that reverse text


def clipped(text: str) -> str:
    """Return text in quotes, shortened to fit into a message.

    Examples
    --------
    >>> print(clipped("0.01;0.02"), clipped(70 * "x"))
    '0.01;0.02' 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...'
    """
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


def shown_value(value: object) -> str:
    """Return the text of a value from a TOML file for a message.

    Examples
    --------
    >>> shown_value({"a": 1})
    "{'a': 1}"
    """
    try:
        text = re.sub(r"\n\s*", " ", repr(value))  # arrays have several lines
    # Nesting a thousand levels deep, or an integer of thousands of digits.
    except (RecursionError, ValueError):
        return "a value that is too deeply nested or too long"
    return text if len(text) <= LONGEST_VALUE else f"{text[:LONGEST_VALUE]}..."


def visible(text: str) -> str:
    r"""Return text with invisible and text-reversing characters replaced by their codes.

    Examples
    --------
    >>> print(visible("a\u202eb"), visible("naïve 字"))
    a\u202eb naïve 字
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        ascii(c)[1:-1] if unicodedata.category(c) in _INVISIBLE and c != "\n" else c for c in text
    )


def short_label(text: str, n_digit: int = 5, most: int = 40) -> str:
    """Return a label for tables and figures: long decimals rounded, and at most `most` characters.

    Examples
    --------
    >>> short_label("a0.027777777777777776_b0.02"), short_label("rig 3, 0.000012345")
    ('a0.027778_b0.02', 'rig 3, 0.000012345')
    >>> short_label("milled twice on Monday", most=12)
    'milled twic…'
    """

    def rounded(number: re.Match[str]) -> str:
        digits = number[0].replace(".", "").lstrip("0")
        return f"{float(number[0]):.{n_digit}g}" if len(digits) > n_digit + 1 else number[0]

    shown = re.sub(r"\d+\.\d+", rounded, text)
    return shown if len(shown) <= most else shown[: most - 1] + "…"


def one_line_message(error: Exception, most: int = 120) -> str:
    """Return the message of an exception as one line of at most `most` characters."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(text.split())[:most].strip()


def duration(seconds: float) -> str:
    """Return a duration in a suitable unit.

    Examples
    --------
    >>> [duration(seconds) for seconds in (0.004, 0.44, 40.2, 90, 5400, 2e5)]
    ['under 0.1 s', '0.4 s', '40 s', '1.5 min', '1.5 h', '2.3 days']
    """
    if math.isnan(seconds):
        return "not known"
    if seconds < 0.1:
        return "under 0.1 s"
    if seconds < 60:
        return f"{seconds:.1f} s" if seconds < 9.95 else f"{seconds:.0f} s"
    hour, day = 3600, 86_400
    size, unit = (60, "min") if seconds < hour else (hour, "h") if seconds < day else (day, "days")
    return f"{seconds / size:.1f}".removesuffix(".0") + f" {unit}"


def percent(share: float) -> str:
    """Return a share in per cent, with two digits below 100 %.

    Examples
    --------
    >>> [percent(share) for share in (0.00312, 0.017, 0.25, 2e-7, 0.0, 1.9, float("inf"))]
    ['0.31 %', '1.7 %', '25 %', 'under 0.01 %', '0', '190 %', 'over 1000 %']
    """
    if math.isnan(share):
        return "not known"
    if share == 0:
        return "0"
    if share < 1e-4:
        return "under 0.01 %"
    if not share <= 10:
        return "over 1000 %"
    size = 100 * share
    return f"{size:.2g} %" if size < 99.5 else f"{size:.0f} %"


def count(n: int, noun: str, plural: str | None = None) -> str:
    """Return a number with a noun in the matching singular or plural.

    Examples
    --------
    >>> count(1, "row"), count(1200, "row")
    ('1 row', '1,200 rows')
    """
    return f"{n:,} {noun if n == 1 else plural or noun + 's'}"


def some_of(words: Iterable[str], most: int, n: int | None = None) -> str:
    """Return the first words and the number of the others, out of n words in total.

    Examples
    --------
    >>> some_of("abc", 3), some_of("abc", 2), some_of("ab", 2, 9)
    ('a, b, c', 'a, b and 1 more', 'a, b and 7 more')
    """
    words = list(words)
    n = len(words) if n is None else n
    return ", ".join(words[:most]) + (f" and {n - most} more" if n > most else "")


def exit_text(code: int | None) -> str:
    """Return how a process ended: by a signal if its exit code is negative.

    Examples
    --------
    >>> exit_text(-9), exit_text(1)
    ('signal 9 (Killed)', 'exit code 1')
    """
    if code is not None and code < 0:
        return f"signal {-code} ({signal.strsignal(-code)})"
    return f"exit code {code}"


def versions(
    packages: Iterable[str] = _COMPUTING_PACKAGES + _OUTPUT_PACKAGES,
) -> dict[str, str]:
    """Return the versions of Python and of packages, by default of all that results depend on."""
    by_package = {"python": platform.python_version()}
    for name in packages:
        try:
            by_package[name] = version(name)
        except PackageNotFoundError:
            by_package[name] = "unknown"
    return by_package
