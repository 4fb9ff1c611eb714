"""The rules that hold between rows: one label one texture, and loads that rise along a curve."""

from typing import Any

import numpy as np
import pandas as pd

from ridgebayes._types import BoolArray, IntArray
from ridgebayes.table.cells import row_codes, texture_label
from ridgebayes.table.columns import CURVE, OK, REQUIRED, TRANSITION
from ridgebayes.table.findings import Findings


def check_labels(typed: dict[str, Any], texture: IntArray, found: Findings) -> None:
    """Fill empty labels; find one label on two textures, which no result could tell apart.

    `texture` holds a code of (a_over_R, b_over_R) for each row.
    """
    a, b, label = typed["a_over_R"], typed["b_over_R"], typed["texture"]
    first = np.unique(texture, return_index=True)[1]
    # Python runs per distinct texture, not per row.
    names = pd.Series([texture_label(a[i], b[i]) for i in first], dtype=object).astype(str)
    filled = label.mask((label == "").to_numpy(), names.take(texture).reset_index(drop=True))
    typed["texture"] = filled
    sound = np.flatnonzero(found.sound("a_over_R", "b_over_R", "texture"))
    code = pd.factorize(filled)[0]
    owner = np.full(found.n_row, -1, dtype=np.int64)
    labels, where_first = np.unique(code[sound], return_index=True)
    owner[labels] = sound[where_first]
    other = owner[code]
    clash = np.zeros(found.n_row, dtype=bool)
    clash[sound] = texture[sound] != texture[other[sound]]
    rule = "one label names one texture, and row {other} gives it to another (a_over_R, b_over_R)"
    found.add(clash, "texture", rule, other)


def check_curves(typed: dict[str, Any], texture: IntArray, found: Findings) -> None:
    """Find what stands twice in a curve, and loads that do not rise with Q; as `check_labels`."""
    use = (typed["kind"] == TRANSITION).to_numpy() & (typed["status"] == OK).to_numpy()
    rows = np.flatnonzero(use & found.sound(*REQUIRED, *CURVE, "kind", "status"))
    if not len(rows):
        return
    Q, p = typed["Q"][rows], typed["p_over_E"][rows]
    others = [name for name in CURVE if name not in ("a_over_R", "b_over_R")]
    curve = row_codes(texture[rows], *(pd.Series(typed[name]).iloc[rows] for name in others))
    order = np.lexsort((rows, Q, curve))
    now, before = order[1:], order[:-1]
    same_curve = curve[now] == curve[before]
    same_Q = same_curve & (Q[now] == Q[before])
    beside = ("p_over_E", "p_over_E_lower", "rel_se", "texture", "role")
    identical = same_Q
    if same_Q.any():
        content = row_codes(*(pd.Series(typed[name]).iloc[rows] for name in beside))
        identical = same_Q & (content[now] == content[before])

    def tell(pairs: BoolArray, column: str, rule: str) -> None:
        other: IntArray = np.zeros(found.n_row, dtype=np.int64)
        broken = np.zeros(found.n_row, dtype=bool)
        broken[rows[now[pairs]]] = True
        other[rows[now[pairs]]] = rows[before[pairs]]
        found.add(broken, column, rule, other)

    tell(identical, "Q", "identical row of one curve twice: row {other} is the same")
    tell(same_Q, "Q", "each Q must stand once in a curve, and row {other} has it too")
    falling = same_curve & ~same_Q & ~(p[now] > p[before])
    tell(falling, "p_over_E", "must rise with Q along a curve: row {other} has a lower Q")
