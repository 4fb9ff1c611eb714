"""Claims about what grooves do to the contact, whatever the form."""

import numpy as np

from ridgebayes.checks.study.errors import STEPS, exact_loads, load_error
from ridgebayes.checks.study.record import (
    CONFIRMED,
    DEPENDS,
    EXTREME,
    NARROW,
    NOT_CONFIRMED,
    NOT_TESTED,
    WIDE,
    Claim,
    pair,
)
from ridgebayes.contact.hertz import half_width
from ridgebayes.model.forms import Classic


def longer_claim() -> Claim:
    """Check whether grooves make contact longer."""
    a, b = NARROW
    hertz = float(half_width(exact_loads(NARROW, 1)[0]))
    distal, proximal = (b / 2 + a) / hertz, (b / 2 + a + b) / hertz
    return Claim(
        "Grooves make contact longer, not shorter, than on a smooth surface.",
        "section 3.2",
        f"At Q = 4 on {pair(NARROW)}, over the Hertz half-width of the same load: {distal:.2f} "
        "to the outer distal edge (what touches), "
        f"{proximal:.2f} to the next proximal corner (what counts).",
        DEPENDS if distal < 1 < proximal else CONFIRMED if distal > 1 else NOT_CONFIRMED,
    )


def threshold_claim() -> Claim:
    """Check whether the groove effect has a threshold in b/R."""
    a = WIDE[0]
    widths = (0.01, 0.02, 0.03, EXTREME[1])
    excess = [float(load_error(Classic(), (a, b), STEPS[1:2])[0]) for b in widths]
    listed = ", ".join(f"{e:.0f} % at {b:g}" for e, b in zip(excess, widths, strict=True))
    scaled = float(load_error(Classic(), (10 * a, 10 * WIDE[1]), STEPS[1:2])[0])
    return Claim(
        "The groove effect grows over b/R of 0.3 (perhaps 0.03 is meant).",
        "section 3.2",
        f"Hertz's excess load at Q = 6, A = {a:g}: {listed} (B): it grows steadily, without a "
        f"threshold. It depends on b/a alone: at (A, B) = {pair((10 * a, 10 * WIDE[1]))} it is "
        f"{scaled:.0f} % again.",
        # The same error at a tenth of b/R: b/R is not what decides.
        NOT_CONFIRMED if abs(scaled - excess[2]) < 0.01 * excess[2] else CONFIRMED,
    )


def convergence_claim() -> Claim:
    """Check what is known of the runs that did not converge."""
    a, _ = EXTREME
    loads = exact_loads(EXTREME, 3)
    # 2 R p is carried by 2k ridges of width a when ridge k is reached.
    pressure = loads / (a * np.arange(1, len(loads) + 1))
    listed = ", ".join(f"{p:.2f} E at Q = {q}" for p, q in zip(pressure, STEPS, strict=False))
    return Claim(
        "At wide grooves and high loads load-controlled runs did not converge; displacement "
        "control might.",
        "section 3.2",
        "No load-controlled finite-element run was made here. The half-plane equation at "
        f"{pair(EXTREME)} is solved without iteration; the mean ridge pressure is then {listed}, "
        "far beyond small strain.",
        NOT_TESTED,
    )
