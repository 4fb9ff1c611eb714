"""The study behind the package, checked on its own sweep: its claims, and the smooth cylinder.

`study_of` computes both for the embedded sweep. Other tables have none of it: the claims are about
the study's textures and loads. It reads a `Comparison` and solves the half-plane equation.
"""

from dataclasses import dataclass

from ridgebayes.checks.study.claims import Claim, paper_claims
from ridgebayes.checks.study.smooth import SmoothCurve, smooth_cylinder
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.table.datafiles import paper_sweep


@dataclass(frozen=True, eq=False)
class Study:
    """What became of the study.

    Parameters
    ----------
    claims : tuple of Claim
        Its claims, each beside our own numbers.
    curves : tuple of SmoothCurve
        The smooth cylinder against Hertz (Fig. 3).
    """

    claims: tuple[Claim, ...]
    curves: tuple[SmoothCurve, ...]


def study_of(comparison: Comparison) -> Study | None:
    """Return the study's claims for a comparison on its own sweep, and None for any other table.

    Parameters
    ----------
    comparison : Comparison
        With its table; equal rows count as the sweep, wherever they were read.

    Returns
    -------
    Study or None

    Examples
    --------
    >>> import ridgebayes as rb
    >>> study = study_of(rb.compare(rb.paper_sweep(), [rb.Modified()], noise="iid", rng=1))
    >>> [claim.verdict for claim in study.claims if "Classic" in claim.text]
    ['confirmed']
    """
    if comparison.table.digest() != paper_sweep().digest():
        return None
    curves = smooth_cylinder()
    return Study(paper_claims(comparison, curves), curves)
