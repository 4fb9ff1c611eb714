"""Figures of predictions: bands of Q against load, and bands beside observed loads."""

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, MultipleLocator

from ridgebayes._types import FloatArray
from ridgebayes.drawing import MOST_TEXTURES
from ridgebayes.drawing.style import (
    OBSERVED,
    WIDTH,
    colour_of,
    draw_intervals,
    look_of,
    new_figure,
    panel_grid,
    plain,
    rows_by_texture,
    shared_legend,
    styled,
    texture_title,
    title_of,
)
from ridgebayes.errors import InputError

N_EDGES_FIRST = 4  # edges after the first transition
_LOWER = "p_over_E_lower"
_ALPHAS = {"simulation": 0.30, "curve": 0.80}  # opacity by kind of band
_OUTSIDE: dict[str, Any] = {"facecolor": "#9A9A9A", "edgecolor": "#FFFFFF"}  # extrapolation
_MIN_LABEL_GAP = 0.22  # least distance between labels of loads, as a share of the axis


@styled()
def plot_bands(
    bands: pd.DataFrame,
    table: pd.DataFrame,
    form: str,
    *,
    n_texture: int | None = None,
    untitled: bool = False,
    unit: tuple[float, str] | None = None,
    width: float = WIDTH,
) -> Figure:
    """Draw Q against load with the bands of one form, one panel for each texture.

    Parameters
    ----------
    bands : pandas.DataFrame
        Columns of the run folder's bands.csv.
    table : pandas.DataFrame
        Rows of the contact table with status ok, drawn as observed steps.
    form : str
        Form, or ``average``.
    n_texture : int, optional
        Number of textures, if `bands` has only some of them.
    untitled : bool, optional
        Whether to omit the heading.
    unit : tuple of float and str, optional
        Load at which p = E, and its unit. The axis then shows loads in this unit.
    width : float, inches, optional
        Width of the figure, such as the column width of a journal.

    Returns
    -------
    matplotlib.figure.Figure
        The simulation band is light, the curve band dark; extrapolation is hatched and grey.
    """
    by_texture = rows_by_texture(_with_loads_in(unit, bands[bands["form"] == form]))
    table = _with_loads_in(unit, table)
    observed = rows_by_texture(table)
    shown = list(by_texture)[:MOST_TEXTURES]
    labels = (_load_label(unit), "edges in contact $Q$")
    # The untitled figure is lower because it shares the first screen with text.
    height = 1.55 if untitled else 1.8
    figure, panels = panel_grid(len(shown), height, 1.0, labels=labels, width=width)
    for axes, texture in zip(panels, shown, strict=True):
        rows = observed.get(texture, table.iloc[:0])
        draw_band(axes, by_texture[texture], colour_of(form))
        _observed(axes, rows)
        axes.set_title(texture_title(texture, rows), fontsize=9)
    drawn = pd.concat([by_texture[texture] for texture in shown])
    seen = pd.concat([observed.get(texture, table.iloc[:0]) for texture in shown])
    _legend(figure, colour_of(form), drawn, seen)
    total = n_texture or len(by_texture)
    more = f", {len(shown)} of {total} textures" if len(shown) < total else ""
    if not untitled:
        figure.suptitle(f"{title_of(form)}: Q against load{more}", fontsize=11)
    return figure


def _with_loads_in(unit: tuple[float, str] | None, frame: pd.DataFrame) -> pd.DataFrame:
    if unit is None:
        return frame
    loads = [name for name in ("p_over_E", _LOWER) if name in frame]
    return frame.assign(**{name: frame[name] * unit[0] for name in loads})


def _load_label(unit: tuple[float, str] | None) -> str:
    if unit is None:
        return "$p/E$ (square-root scale)"
    name = plain(unit[1])
    return f"load in {name} (square-root scale)\n= $p/E$ times {unit[0]:.4g} {name}"


def draw_band(axes: Axes, bands: pd.DataFrame, colour: str) -> None:
    """Draw the bands of one texture, grey where extrapolated."""
    # A band that holds a single count would have no area. Each band is widened a little, the
    # simulation band more, so that both are visible where they coincide.
    for (kind, alpha), room in zip(_ALPHAS.items(), (0.55, 0.25), strict=True):
        part = bands[bands["kind_of_band"] == kind].sort_values("p_over_E")
        if part.empty:
            continue
        p, lower, upper = (part[c].to_numpy(float) for c in ("p_over_E", "q_lower", "q_upper"))
        outside = part["extrapolation"].to_numpy(bool)
        # Only steps and the ends of extrapolation are kept; other loads enlarge the file.
        steps = np.diff(np.stack([lower, upper, outside]), axis=1).any(axis=0)
        ends = np.flatnonzero(np.diff(outside))
        kept = np.unique(np.r_[0, np.flatnonzero(steps) + 1, ends, len(p) - 1])
        for is_outside in (False, True):
            axes.fill_between(
                p[kept],
                lower[kept] - room,
                upper[kept] + room,
                where=(outside[kept] == is_outside).tolist(),
                step="post",
                linewidth=0,
                hatch="////" if is_outside and kind == "simulation" else None,
                alpha=alpha,
                color=_OUTSIDE["facecolor"] if is_outside else colour,
                edgecolor=_OUTSIDE["edgecolor"] if is_outside else None,
            )
    # Q grows with the square root of the load, so its steps are equally wide on this axis.
    axes.set_xscale("function", functions=(_root, np.square))
    axes.set_xlim(0.0, float(bands["p_over_E"].max()))
    axes.xaxis.set_major_locator(FixedLocator(_load_ticks(float(bands["p_over_E"].max()))))
    # Edges come in pairs: odd counts occur only with a contact off centre.
    axes.yaxis.set_major_locator(MultipleLocator(2 * (1 + int(bands["q_upper"].max()) // 12)))


def _load_ticks(most: float) -> list[float]:
    """Return round loads up to the highest, without those whose labels would overlap."""
    even = np.array(MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(0.0, most))
    kept: list[float] = []
    for load in even[(even >= 0) & (even <= most)].tolist():
        if not kept or _root(load) - _root(kept[-1]) > _MIN_LABEL_GAP * _root(most):
            kept.append(load)
    return kept


def _observed(axes: Axes, rows: pd.DataFrame) -> None:
    for _, curve in rows.groupby(["nu", "solver", "series"], dropna=False, sort=False):
        rise = curve.sort_values("p_over_E")
        load, q = rise["p_over_E"].to_numpy(), rise["Q"].to_numpy()
        # Loads below the first row were not observed, unless this row is the first transition.
        first = 0.0 if q[0] <= N_EDGES_FIRST else load[0]
        steps = np.array([[first, *load], [q[0] - 2, *q]])
        axes.step(*steps, where="post", color=OBSERVED, linewidth=1.0)
        axes.plot(load, q, ".", color=OBSERVED, markersize=6)
        if _LOWER in rise:
            axes.hlines(q - 1, rise[_LOWER], load, color=OBSERVED, linewidth=3)


def _root(p: FloatArray | float) -> FloatArray:
    return np.sqrt(np.maximum(p, 0.0))


def _legend(figure: Figure, colour: str, bands: pd.DataFrame, observed: pd.DataFrame) -> None:
    """Add a legend of the elements that are drawn: some figures have no curve or no rows."""
    handles: list[Artist] = []
    if len(observed):
        look: dict[str, Any] = {"marker": ".", "markersize": 7, "linewidth": 1}
        handles.append(Line2D([], [], color=OBSERVED, label="observed", **look))
    if _LOWER in observed and observed[_LOWER].notna().any():
        handles.append(Line2D([], [], color=OBSERVED, linewidth=3, label="increment"))
    percent = f"{100 * float(bands['prob'].iloc[0]):.0f} %"
    for kind, alpha in reversed(_ALPHAS.items()):
        if (bands["kind_of_band"] == kind).any():
            patch = Patch(color=colour, alpha=alpha, linewidth=0, label=f"{kind}, {percent}")
            handles.append(patch)
    if bands["extrapolation"].any():
        handles.append(Patch(hatch="////", alpha=0.5, label="extrapolation", **_OUTSIDE))
    n_column = max(round(len(handles) * figure.get_figwidth() / WIDTH), 1)
    figure.legend(handles=handles, loc="outside lower center", ncols=n_column)


@styled()
def plot_held_out(loads: pd.DataFrame) -> Figure:
    """Draw the deviation of predicted from observed loads of held-out transitions.

    Parameters
    ----------
    loads : pandas.DataFrame
        Held-out rows of the run folder's loads.csv with kind_of_band simulation, and column
        p_over_E_nearest: the observed load; for a bracket, its load nearest to the median. The
        first three textures are drawn.

    Returns
    -------
    matplotlib.figure.Figure
        Deviations in per cent of the observed load, by form. The probability of the bands is that
        of `loads`.
    """
    textures = list(rows_by_texture(loads).items())[:3]
    forms = list(dict.fromkeys(loads["form"]))
    figure = new_figure(WIDTH, 3.0)
    panels = figure.subplots(1, len(textures), squeeze=False)[0]
    for axes, (texture, here) in zip(panels, textures, strict=True):
        for k, form in enumerate(forms):
            rows = here[here["form"] == form]
            place = rows["Q"] + 1.4 * ((k + 0.5) / len(forms) - 0.5)
            look = look_of(form) | {"markersize": 5, "capsize": 2.5, "elinewidth": 1.3}
            draw_intervals(axes, place, rows, rows["p_over_E_nearest"], **look)
        axes.axhline(0, color=OBSERVED, linewidth=1)
        axes.set_xticks(sorted(set(here["Q"])))
        axes.set(xlabel="edges in contact $Q$", title=texture_title(texture))
    panels[0].set_ylabel("load error of the prediction, %")
    shared_legend(figure, panels[0])
    return figure


@styled()
def plot_prior_bands(bands: pd.DataFrame, rows: pd.DataFrame, form: str) -> Figure:
    """Draw the prior predictive bands of the load with the observed rows.

    Parameters
    ----------
    bands : pandas.DataFrame
        One row for each texture and count: columns a_over_R, b_over_R, Q, and lower, median, upper
        of the log load, and prob.
    rows : pandas.DataFrame
        Observed transitions, shown as dots: columns a_over_R, b_over_R, Q, p_over_E.
    form : str
        Name of the form.

    Returns
    -------
    matplotlib.figure.Figure
        One panel for each of the first `MOST_TEXTURES` textures: load on a logarithmic axis
        against Q.

    Raises
    ------
    InputError
        If there are no bands.
    """
    if bands.empty:
        raise InputError("bands: expected at least one, got none")
    textures = list(rows_by_texture(bands).items())[:MOST_TEXTURES]
    observed = rows_by_texture(rows)
    figure, panels = panel_grid(
        len(textures), 1.8, 1.0, labels=("$Q$", "load $p/E$"), sharex=True, sharey=True
    )
    colour = colour_of(form)
    for axes, (texture, by_count) in zip(panels, textures, strict=True):
        by_count = by_count.sort_values("Q")
        lower, median, upper = (np.exp(by_count[name]) for name in ("lower", "median", "upper"))
        label = f"{title_of(form)}: prior, {100 * by_count['prob'].iloc[0]:g} %"
        look: dict[str, Any] = {"color": colour, "alpha": 0.25, "linewidth": 0, "label": label}
        axes.fill_between(by_count["Q"], lower, upper, **look)
        # A band over a single count has no width, so a line is drawn at each count.
        axes.vlines(by_count["Q"], lower, upper, color=colour, linewidth=0.8, alpha=0.6)
        axes.plot(by_count["Q"], median, color=colour, linewidth=1.2, label="median")
        dots = observed.get(texture, rows.iloc[:0])
        axes.plot(dots["Q"], dots["p_over_E"], ".", color=OBSERVED, markersize=5, label="rows")
        axes.set_title(texture_title(texture), fontsize=9)
    _few_ticks(panels[0], bands)  # all panels share its axes
    shared_legend(figure, panels[0], at="upper")
    return figure


def _few_ticks(axes: Axes, bands: pd.DataFrame) -> None:
    axes.set_yscale("log")
    low, high = np.log10(np.exp([bands["lower"].min(), bands["upper"].max()]))
    powers = np.arange(np.floor(low), np.ceil(high) + 1)
    if high - low < 6:  # few decades leave room for ticks at 3
        powers = np.sort(np.concatenate([powers, powers + np.log10(3)]))
    axes.yaxis.set_major_locator(FixedLocator(list(10**powers)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.2g}"))
    axes.minorticks_off()
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True, steps=[2, 4, 10]))
