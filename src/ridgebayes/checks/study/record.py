"""The record of one claim, and the words a verdict may use."""

from dataclasses import dataclass

from ridgebayes.checks.load_errors import PAPER_TEXTURES
from ridgebayes.contact.scaling import Texture

CONFIRMED = "confirmed"
NOT_CONFIRMED = "not confirmed"
DEPENDS = "depends on the definition"
NOT_TESTED = "not tested here"
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
