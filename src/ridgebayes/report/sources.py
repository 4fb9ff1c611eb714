# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on what went in and how to read it: data, claims of the study, units, versions."""

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ridgebayes.checks.study import VERDICTS, paper_claims
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.report.blocks import Section, Table, Text, table
from ridgebayes.report.numbers import count, number

MOST_TEXTURES = 40
_PACKAGES = ("ridgebayes", "numpy", "scipy", "pandas", "emcee", "arviz", "corner", "matplotlib")


def data_section(comparison: Comparison) -> Section:
    """Return what was fitted, held out and left out."""
    data = comparison.table
    blocks: list[Text | Table] = [Text(_counted(comparison))]
    statuses = data.left_out.column("status")
    if len(statuses):
        told: dict[str, int] = {}
        for status in statuses:
            told[str(status)] = told.get(str(status), 0) + 1
        listed = "; ".join(f"{count(n, 'row')}: {status}" for status, n in told.items())
        blocks.append(Text(f"Left out because their status is not ok: {listed}.", "warning"))
    frame = data.frame
    frame = frame[frame["status"] == "ok"]
    rows: list[list[str]] = []
    pairs = dict.fromkeys(zip(frame["a_over_R"], frame["b_over_R"], strict=True))
    for a, b in list(pairs)[:MOST_TEXTURES]:
        part = frame[(frame["a_over_R"] == a) & (frame["b_over_R"] == b)]
        loads = part["p_over_E"]
        rows.append(
            [
                str(part["texture"].iloc[0]),
                f"{a:g}",
                f"{b:g}",
                number(a / (a + b), 3),
                str(len(part)),
                f"{part['Q'].min()} to {part['Q'].max()}",
                f"{number(loads.min(), 3)} to {number(loads.max(), 3)}",
                " and ".join(dict.fromkeys(part["role"])),
                ", ".join(dict.fromkeys(part["solver"].astype(str))),
            ]
        )
    blocks.append(
        table(
            ["Texture", "a/R", "b/R", "a/pitch", "Rows", "Q", "p/E", "Role", "Solver"],
            rows,
            text=(0, 7, 8),
        )
    )
    n = len(data.textures)
    if n > len(rows):
        blocks.append(Text(f"{len(rows)} of {n:,} textures shown; all are in table.csv.", "note"))
    return Section("Data", "data", tuple(blocks))


def _counted(comparison: Comparison) -> str:
    data = comparison.table
    used, held_out, left_out = data.calibration, data.held_out, data.left_out
    ratios = [a / (a + b) for a, b in used.textures]
    return (
        f"{Path(data.where).name}: {count(len(data), 'row')}. "
        f"{count(len(used), 'row')} of {count(len(used.textures), 'texture')} fitted, "
        f"{len(held_out):,} held out, {len(left_out):,} left out. Fitted: Q up to "
        f"{used.column('Q').max()}, p/E from {number(used.column('p_over_E').min(), 3)} to "
        f"{number(used.column('p_over_E').max(), 3)}, a/pitch from {number(min(ratios), 3)} to "
        f"{number(max(ratios), 3)}. Error model: {comparison.noise.name}."
    )


def claims_section(comparison: Comparison) -> Section:
    """Return the study's claims one by one."""
    claims = paper_claims(comparison)
    tally = ", ".join(
        f"{sum(claim.verdict == verdict for claim in claims)} {verdict}" for verdict in VERDICTS
    )
    return Section(
        "The study's claims, one by one",
        "claims",
        (
            Text(
                f"{len(claims)} claims of doi:10.1016/j.ijssolstr.2019.06.026: {tally}. Loads to "
                "check against are those of the half-plane equation, which has no fitted "
                "coefficient and no load increment, not the study's own finite elements. A "
                "negative error: the form asks for too little load. "
                "A = a/R, B = b/R."
            ),
            table(
                ["Claim", "Where", "Our numbers", "Verdict"],
                [[claim.text, claim.where, claim.ours, claim.verdict] for claim in claims],
                text=(0, 1, 2, 3),
                badge=3,
                wide=True,
            ),
        ),
    )


def reading_section(comparison: Comparison) -> Section:
    """Return units, signs and words."""
    rows = [
        ["a/R, b/R, pitch L", "Ridge width, groove width and their sum, over the body's radius R."],
        ["p/E", "Load per projected area over Young's modulus; the line load is 2 R p."],
        ["s", "√(p/E), at Poisson's ratio 0.5. Other ratios enter by the load (p/E)(1 − ν²)/0.75."],
        ["Q", "Proximal ridge edges in contact: 2 at first touch, then 4, 6, ..."],
        ["K", "dQ′/ds, how fast the count grows."],
        [
            "ln BF",
            "Natural logarithm of the ratio of evidences; above 0 favours the form named first.",
        ],
        [
            "Reading",
            "2 ln BF of 2, 6, 10 begin positive, strong, very strong (Kass & Raftery 1995).",
        ],
        ["Load error", "100 (p form / p data − 1): above 0 the form asks for too much load."],
        ["Curve band", "Uncertainty of the form's coefficients only."],
        ["Simulation band", "That and the error model: where a further simulation would fall."],
        [
            "Extrapolation",
            "A count above the largest fitted one, or an a/pitch outside the fitted range: the "
            "band knows nothing of how the form fails there.",
        ],
    ]
    return Section("How to read this", "reading", (table(["Word", "Means"], rows, text=(0, 1)),))


def versions_section() -> Section:
    """Return the versions of what made the report."""
    found = [f"Python {platform.python_version()}"]
    for name in _PACKAGES:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} unknown")
    return Section("Made with", "versions", (Text(", ".join(found) + ".", "note"),))
