# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on the study behind the package, shown for its own sweep and for no other table.

They lay out the record `ridgebayes.checks.study.Study`.

Examples
--------
>>> import ridgebayes as rb
>>> from ridgebayes.checks.study import study_of
>>> study = study_of(rb.compare(rb.paper_sweep(), [rb.Modified()], rng=1))
>>> [section.title for section in study_sections(study)]
['Smooth cylinder against Hertz', "The study's claims"]
"""

from collections import Counter

from ridgebayes.checks.study import Study
from ridgebayes.checks.study.claims import VERDICTS
from ridgebayes.checks.study.smooth import FIG_3_TEXTURE
from ridgebayes.report.blocks import Block, Picture, Section, Table, Text
from ridgebayes.report.wording import decimals

_SOLVERS = {
    "half-plane": "Half-plane equation, no grooves",
    "small-strain": "Finite elements, small strain",
    "neo-hooke": "Finite elements, neo-Hookean",
}


def study_sections(study: Study) -> tuple[Section, Section]:
    """Return the smooth cylinder against Hertz (the study's Fig. 3), and the claims one by one."""
    return _smooth(study), _claims(study)


def _smooth(study: Study) -> Section:
    rows = [
        [
            _SOLVERS.get(curve.name, curve.name),
            str(len(curve.count)),
            decimals(curve.r_squared, 5),
            decimals(100 * curve.worst_count_error, 2),
            decimals(100 * curve.worst_load_error, 2),
        ]
        for curve in study.curves
    ]
    a, b = FIG_3_TEXTURE
    caption = (
        f"Contact length without grooves, in ridges of a/R = {a:g}, b/R = {b:g} by eq. (2), "
        "against Hertz, eq. (1). The half-plane equation equals Hertz to rounding. A whole "
        "cylinder of finite elements becomes slightly stiffer as the contact widens."
    )
    header = ("Computed by", "Loads", "R² of Hertz on Q′", "Worst error in Q′, %", "in load, %")
    blocks: list[Block] = [Picture("smooth-cylinder", caption), Table(header, rows)]
    return Section("Smooth cylinder against Hertz", "smooth", blocks)


def _claims(study: Study) -> Section:
    counted = Counter(claim.verdict for claim in study.claims)
    tally = ", ".join(f"{counted[verdict]} {verdict}" for verdict in VERDICTS)
    words = (
        f"{len(study.claims)} claims of doi:10.1016/j.ijssolstr.2019.06.026: {tally}. They are "
        "checked against loads of the half-plane equation, which has no fitted coefficient and no "
        "load increment, not against the study's own finite elements. A negative error means that "
        "the form predicts too low a load. A = a/R, B = b/R."
    )
    rows = [[claim.text, claim.where, claim.ours, claim.verdict] for claim in study.claims]
    header = ("Claim", "Where", "Our numbers", "Verdict")
    found = Table(header, rows, text=(0, 1, 2, 3), badge=3, wide=True)
    return Section("The study's claims", "claims", [Text(words), found])
