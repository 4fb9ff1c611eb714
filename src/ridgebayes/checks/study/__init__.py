"""The study's claims one by one, each beside our own numbers.

Loads are those of the half-plane equation (`contact.halfplane`), which has no fitted coefficient
and no load increment; coefficients are the printed ones and, where it makes sense, those of a
comparison. Nothing here is typed in but the claims themselves.
"""

from collections.abc import Iterator

from ridgebayes.checks.study.errors import (
    classic_claim,
    errors_fall_claim,
    first_step_claims,
    hybrid_error_claim,
    modified_error_claims,
    worst_step_claim,
)
from ridgebayes.checks.study.fits import (
    coefficients_claim,
    modified_claim,
    power_law_claim,
    smooth_claim,
)
from ridgebayes.checks.study.mechanics import convergence_claim, longer_claim, threshold_claim
from ridgebayes.checks.study.record import VERDICTS, Claim
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.model.forms import Hybrid, Modified

__all__ = ["VERDICTS", "Claim", "paper_claims"]


def paper_claims(comparison: Comparison) -> tuple[Claim, ...]:
    """Check every claim of the study.

    Parameters
    ----------
    comparison : Comparison
        Supplies calibrated coefficients (posterior means) and the rows for least squares.

    Returns
    -------
    tuple of Claim
        In the order of the study.

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> claims = paper_claims(rb.compare(rb.paper_sweep(), [rb.Modified()], rng=1))
    >>> [claim.verdict for claim in claims if "Classic" in claim.text]
    ['confirmed']
    """
    return tuple(_claims(comparison))


def _claims(comparison: Comparison) -> Iterator[Claim]:
    yield smooth_claim()
    yield power_law_claim(comparison.table)
    yield modified_claim(comparison.table)
    yield coefficients_claim(Modified(), comparison.table, "eq. (6)")
    yield coefficients_claim(Hybrid(), comparison.table, "eq. (7)")
    yield classic_claim()
    yield from modified_error_claims(comparison)
    yield hybrid_error_claim(comparison)
    yield errors_fall_claim()
    yield worst_step_claim()
    yield from first_step_claims()
    yield longer_claim()
    yield threshold_claim()
    yield convergence_claim()
