# ruff: noqa: RUF001  (typographic signs in cells are intended)
r"""Tables for other programs: CSV, and LaTeX with booktabs.

Examples
--------
>>> table = Table(["Form", "ln BF"], [["Hybrid & co", "−3.0"]])
>>> print(to_csv(table))
Form,ln BF
Hybrid & co,-3.0
<BLANKLINE>
>>> print(to_latex(table).splitlines()[3])
Hybrid \& co & $-$3.0 \\
"""

from urllib.parse import quote

import pandas as pd

from ridgebayes.report.blocks import Table
from ridgebayes.runtime.text import MINUS, visible

_LATEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        MINUS: "$-$",
        "±": r"$\pm$",
        "×": r"$\times$",
        **{character: f"\\{character}" for character in "&%$#_{}"},
    }
)


def to_csv(table: Table) -> str:
    """Return the cells of a table as CSV, with ASCII minus signs."""
    rows = [[cell.replace(MINUS, "-") for cell in row] for row in (table.header, *table.rows)]
    return pd.DataFrame(rows).to_csv(index=False, header=False, lineterminator="\n")


def to_latex(table: Table) -> str:
    """Return a table as a LaTeX tabular, for a compiler that reads Unicode."""
    columns = "".join("l" if i in table.text else "r" for i in range(len(table.header)))
    head, *rows = (
        " & ".join(visible(" ".join(cell.split())).translate(_LATEX) for cell in row) + r" \\"
        for row in (table.header, *table.rows)
    )
    lines = [rf"\begin{{tabular}}{{{columns}}}", rf"\toprule {head}", r"\midrule", *rows]
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""])


def links(table: Table) -> dict[str, str]:
    """Return data links to a table, by file suffix."""
    texts = {"csv": ("text/csv", to_csv(table)), "tex": ("application/x-tex", to_latex(table))}
    return {k: f"data:{kind};charset=utf-8,{quote(text)}" for k, (kind, text) in texts.items()}
