"""Figure of the verdict study: how often each grade was given, to the right and the wrong form."""

import pandas as pd
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ridgebayes.comparison.verdict import GRADES
from ridgebayes.drawing.style import COLOURS, QUIET, WIDTH, new_figure, styled

_RIGHT = dict(zip(GRADES, ("#08519C", "#4292C6", "#9ECAE1", "#E6E6E6"), strict=True))
_WRONG = {"decisive": "#7F2704", "supports": COLOURS["classic"], "leans": "#FDBE85"}


@styled()
def plot_verdicts(table: pd.DataFrame) -> Figure:
    """Draw a bar for each cell, a panel for each number of textures.

    Parameters
    ----------
    table : pandas.DataFrame
        Columns of `docs/validation/verdicts.csv`.

    Returns
    -------
    matplotlib.figure.Figure
        Shares of the tables: from the left the right form, from the right the wrong one.
    """
    counts = sorted(table["n_texture"].unique(), reverse=True)
    cells = list(dict.fromkeys(zip(table["truth"], table["errors"], strict=True)))
    figure = new_figure(WIDTH, 1.4 + 0.22 * len(cells))
    panels = figure.subplots(1, len(counts), squeeze=False, sharey=True)[0]
    by_cell = table.set_index(["n_texture", "truth", "errors", "grade"])
    for axes, n_texture in zip(panels, counts, strict=True):
        for place, cell in enumerate(cells):
            left, right = 0.0, 1.0
            for grade in (*GRADES, "failed"):
                if (n_texture, *cell, grade) not in by_cell.index:
                    continue
                row = by_cell.loc[(n_texture, *cell, grade)]
                share = row["n_right"] / row["n_tables"]
                axes.barh(place, share, left=left, color=_RIGHT.get(grade, QUIET))
                left += share
                if grade in _WRONG:
                    share = row["n_wrong"] / row["n_tables"]
                    axes.barh(place, -share, left=right, color=_WRONG[grade])
                    right -= share
            axes.barh(place, right - left, left=left, color=_RIGHT["undecided"])
        tables = table.loc[table["n_texture"] == n_texture, "n_tables"]
        lot = (
            f"{tables.min()}" if tables.min() == tables.max() else f"{tables.min()}-{tables.max()}"
        )
        axes.set_title(f"{n_texture} textures, {lot} tables a cell")
        axes.set_xlim(0, 1)
        axes.set_xlabel("share of tables")
        axes.grid(visible=False, axis="y")
    panels[0].set_yticks(range(len(cells)), [f"{truth}; {errors}" for truth, errors in cells])
    panels[0].invert_yaxis()
    handles = [Patch(color=_RIGHT[grade], label=f"right, {grade}") for grade in GRADES[:3]]
    handles.append(Patch(color=_RIGHT["undecided"], label="undecided"))
    handles += [Patch(color=colour, label=f"wrong, {grade}") for grade, colour in _WRONG.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=4)
    return figure
