"""Words for messages: one line, cut where it would swamp them, with nothing unseen in them."""

import unicodedata

_UNSEEN = ("Cc", "Cf", "Cs", "Zl", "Zp")  # controls, such as those of writing right to left


def clipped(text: str) -> str:
    """Return text in quotes, cut where it would swamp a message.

    Examples
    --------
    >>> print(clipped("0.01;0.02"), clipped(70 * "x"))
    '0.01;0.02' 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx...'
    """
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


def visible(text: str) -> str:
    r"""Return text with characters that do not show, or turn what follows, as their codes.

    Examples
    --------
    >>> print(visible("a\u202eb"), visible("naïve 字"))
    a\u202eb naïve 字
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(
        ascii(c)[1:-1] if unicodedata.category(c) in _UNSEEN and c != "\n" else c for c in text
    )


def one_line_message(error: Exception, most: int = 120) -> str:
    """Return what an error says as one line, cut off at a length, that ends in no blank."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return " ".join(text.split())[:most].strip()
