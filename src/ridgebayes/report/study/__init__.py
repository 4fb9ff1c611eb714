# ruff: noqa: RUF001  (typographic minus, times and Greek are meant: readers see them)
"""Sections on the study behind the package, shown for its own sweep and for no other table.

They lay out the record `ridgebayes.checks.study.Study`.

Examples
--------
>>> import ridgebayes as rb
>>> from ridgebayes.checks.report_data import report_data
>>> data = report_data(rb.compare(rb.paper_sweep(), [rb.Modified()], noise="iid", rng=1))
>>> [type(block).__name__ for block in (*smooth_section(data), *claims_section(data))]
['Picture', 'Table', 'Text', 'Folded']
"""

from collections import Counter

from ridgebayes.checks.report_data import ReportData
from ridgebayes.checks.study.claims import VERDICTS
from ridgebayes.checks.study.smooth import FIG_3_TEXTURE
from ridgebayes.report.blocks import Block, Folded, Picture, Table, Text
from ridgebayes.report.wording import decimals

_SOLVERS = {
    "half-plane": "Half-plane equation, no grooves",
    "small-strain": "Finite elements, small strain",
    "neo-hooke": "Finite elements, neo-Hookean",
}


def smooth_section(data: ReportData) -> list[Block]:
    """Return the smooth cylinder against Hertz (the study's Fig. 3)."""
    if data.study is None:
        return []
    rows = [
        [
            _SOLVERS.get(curve.name, curve.name),
            str(len(curve.count)),
            decimals(curve.r_squared, 5),
            decimals(100 * curve.worst_count_error, 2),
            decimals(100 * curve.worst_load_error, 2),
        ]
        for curve in data.study.curves
    ]
    a, b = FIG_3_TEXTURE
    caption = (
        f"Contact length without grooves, in ridges of a/R = {a:g}, b/R = {b:g} by eq. (2), "
        "against Hertz, eq. (1). The half-plane equation equals Hertz to rounding. A whole "
        "cylinder of finite elements becomes slightly stiffer as the contact widens."
    )
    header = ("Computed by", "Loads", "R² of Hertz on Q′", "Worst error in Q′, %", "in load, %")
    return [Picture("smooth-cylinder", caption), Table(header, rows)]


def claims_section(data: ReportData) -> list[Block]:
    """Return the claims one by one."""
    if data.study is None:
        return []
    claims = data.study.claims
    counted = Counter(claim.verdict for claim in claims)
    tally = ", ".join(f"{counted[verdict]} {verdict}" for verdict in VERDICTS)
    words = (
        f"{len(claims)} claims of doi:10.1016/j.ijssolstr.2019.06.026: {tally}. They are "
        "checked against loads of the half-plane equation, which has no fitted coefficient and no "
        "load increment, not against the study's own finite elements. A negative error means that "
        "the form predicts too low a load. A = a/R, B = b/R."
    )
    rows = [[claim.text, claim.where, claim.ours, claim.verdict] for claim in claims]
    header = ("Claim", "Where", "Our numbers", "Verdict")
    found = Table(header, rows, text=(0, 1, 2, 3), badge=3)
    return [Text(words), Folded("All claims, with numbers", [found])]
