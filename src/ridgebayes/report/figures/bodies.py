"""Figures of a body in contact: a pressed profile, and a cylinder of finite elements."""

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from ridgebayes._types import FloatArray
from ridgebayes.contact.contact_solution import ContactSolution
from ridgebayes.contact.cylinder.contact_problem import State
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.faces import first_height
from ridgebayes.contact.cylinder.fields import nodal_fields, surface_table
from ridgebayes.contact.cylinder.surface import shapes
from ridgebayes.contact.rigid_profile import Profile, RigidSegment
from ridgebayes.drawing.style import COLOURS, WIDTH, new_figure, styled
from ridgebayes.errors import InputError

_BODY, _PRESSURE = COLOURS["modified"], COLOURS["classic"]
_RIDGE, _RIDGE_LINE = "#B8B8B8", "#555555"
# Upper end of the colour scale of the von Mises stress, over the mean contact pressure. It is above
# the stress under a smooth contact and below the stress near sharp corners.
_MAX_MISES_OVER_MEAN = 0.8
# Nodes of an element: end, middle and end of each side, and around its boundary.
_SIDES = [[k, k + 4, (k + 1) % 4] for k in range(4)]
_BOUNDARY = [node for start, middle, _ in _SIDES for node in (start, middle)]
# Close-up: its half width over that of the contact, and its height over its half width.
_WIDTH_OVER_CONTACT, _HEIGHT_OVER_WIDTH = 1.2, 0.68
_ARC = np.linspace(0.0, 0.5 * math.pi, 13)
_MAX_PRESSURE_OVER_MEAN = 3.0  # in the contact; peaks at sharp corners are cut


@styled()
def plot_pressed(solution: ContactSolution) -> Figure:
    """Draw a body pressed on ridges, and its contact pressure.

    Parameters
    ----------
    solution : ContactSolution
        Solution to draw.

    Returns
    -------
    matplotlib.figure.Figure
        The upper panel shows the surfaces of body and ridges with stretched heights, the lower one
        the pressure over E*.
    """
    left, right = solution.ends
    edge = 1.25 * max(right, -left)
    figure = new_figure(WIDTH, 5.2)
    top, bottom = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [3, 2]})
    x = np.linspace(-edge, edge, 1601)
    surface = solution.pressing.surface(np.abs(x) if solution.profile.mirrored else x)
    lowest = min(float(surface.min()), 0.0)
    depth = min(solution.profile.depth, max(-1.6 * lowest, 0.05 * solution.profile.pitch))
    top.fill_between(x, surface, 1e3, color=_BODY, alpha=0.18, linewidth=0)
    top.plot(x, surface, color=_BODY, linewidth=1.2, label="body")
    rigid = _heights(solution.profile, x, depth)
    below = rigid.min() - 0.1 * depth
    top.fill_between(x, rigid, below, color=_RIDGE_LINE, alpha=0.35, linewidth=0)
    top.plot(x, rigid, color=_RIDGE_LINE, linewidth=1.0, label="ridges")
    span = max(float(surface.max()), depth)
    top.set_ylim(-1.15 * depth, min(span, 4 * depth))
    top.set_ylabel("height over $R$, stretched")
    for sign in (1, -1) if solution.profile.mirrored else (1,):
        _half_plane_pressure(bottom, solution, sign)
    # The axis shows the pressure between corners, where it is unbounded.
    between = solution.pressing.pressure(np.cos(np.linspace(0.6, math.pi - 0.6, 20)))
    bottom.set_ylim(0, 4 * 0.5 * math.pi * float(between.max()))
    bottom.set_xlabel("$x/R$ from below the body's centre")
    bottom.set_ylabel("pressure over $E^*$")
    figure.legend(*top.get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return figure


def _heights(profile: Profile, x: FloatArray, depth: float) -> FloatArray:
    height = np.full(len(x), -depth)
    n = math.ceil(float(np.abs(x).max()) / profile.pitch) + 1
    for number in range(-n - 1, n + 1):
        land = profile.ridge(number)
        on = (x >= land.start) & (x <= land.stop)
        height[on] = -np.minimum(land.height(x[on]), depth)
    return height


def _half_plane_pressure(axes: Axes, solution: ContactSolution, sign: int) -> None:
    # Near a sharp corner the pressure is unbounded: the last thousandth is left out.
    s = np.cos(np.linspace(0.03, math.pi - 0.03, 200))
    values = solution.pressing.pressure(s) * 0.5 * math.pi / np.sqrt(1 - s * s)
    intervals = solution.pressing.intervals
    for i in range(len(intervals.left)):
        if sign < 0 and i == 0 and intervals.straddles:
            continue  # the central interval is its mirror image
        at = sign * (intervals.centre[i] + intervals.half_width[i] * s)
        axes.fill_between(at, values[i], color=_PRESSURE, alpha=0.35, linewidth=0)
        axes.plot(at, values[i], color=_PRESSURE, linewidth=0.9)


@styled()
def plot_deformed(cylinder: Cylinder, state: State) -> Figure:
    """Draw a pressed cylinder: the whole mesh, a close-up of the contact, and the pressure.

    Parameters
    ----------
    cylinder : Cylinder
        Body to draw.
    state : State
        State of the body, in contact.

    Returns
    -------
    matplotlib.figure.Figure
        The upper panels show the deformed elements on the rigid surface in true proportions,
        coloured by von Mises stress; the high stresses near sharp corners share one colour. The
        lowest panel shows contact pressure over E, cut off at three times its mean.

    Raises
    ------
    InputError
        If nothing is in contact.
    """
    table = surface_table(cylinder, state)
    if table.empty:
        raise InputError("the body touches nothing: no contact to draw")
    mean = float(np.average(table["pressure"], weights=table["length"]))
    body = _Mesh(cylinder, state, mean)
    low, high = body.points.min(axis=0), body.points.max(axis=0)
    wide = 1.05 * max(high[0], -low[0])
    half = _WIDTH_OVER_CONTACT * float((table["x"].abs() + 0.5 * table["length"]).max())
    # In shares of the close-up the room below the body is that on either side of the contact.
    share_below = 0.5 * (_WIDTH_OVER_CONTACT - 1)
    bottom = float(low[1]) - share_below * _HEIGHT_OVER_WIDTH * half
    # The extra height keeps the close-up as wide as the pressure below it.
    tall = high[1] - low[1] + 0.1
    rows = [WIDTH * 0.5 * tall / wide, WIDTH * 0.5 * _HEIGHT_OVER_WIDTH + 0.1, 1.7]
    figure = new_figure(WIDTH, sum(rows) + 1.3)
    whole, near, below = figure.subplots(3, 1, gridspec_kw={"height_ratios": rows})
    whole.set(xlim=(-wide, wide), ylim=(low[1] - 0.07, high[1] + 0.03))
    near.set(xlim=(-half, half), ylim=(bottom, bottom + _HEIGHT_OVER_WIDTH * half))
    for axes, width in ((whole, 0.1), (near, 0.3)):
        axes.set_aspect("equal")
        axes.grid(visible=False)
        axes.set_ylabel("$y/R$")
        _rigid(axes, cylinder, state)
        body.draw(axes, width)
    _pressure(below, table, _MAX_PRESSURE_OVER_MEAN * mean, mirrored=cylinder.mirrored)
    below.set(xlim=(-half, half), xlabel="$x/R$", ylabel="pressure over $E$")
    return figure


class _Mesh:
    """Deformed mesh with its mirror image, and the von Mises stress at its nodes."""

    def __init__(self, cylinder: Cylinder, state: State, mean: float) -> None:
        solid, self._mean = cylinder.problem.solid, mean
        self.points = solid.points + state.u
        elements = solid.nodes
        stress = nodal_fields(cylinder, state)["cauchy_stress"].reshape(-1, 3, 3)
        deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        self._mises = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
        if cylinder.mirrored:
            elements = np.concatenate([elements, elements + solid.n_node])
            self.points = np.concatenate([self.points, self.points * [-1.0, 1.0]])
            self._mises = np.tile(self._mises, 2)
        around = elements[:, _BOUNDARY]
        centre = np.broadcast_to(elements[:, 8:], around.shape)
        triangles = np.stack([centre, around, np.roll(around, -1, axis=1)], axis=-1)
        self._triangles = triangles.reshape(-1, 3)
        sides = elements[:, _SIDES].reshape(-1, 3)
        self._sides = sides[np.unique(sides[:, 1], return_index=True)[1]]

    def draw(self, axes: Axes, width: float) -> None:
        """Draw the coloured elements with curved edges, and a colour bar."""
        most, highest = float(self._mises.max()), _MAX_MISES_OVER_MEAN * self._mean
        x, y = self.points.T
        coloured = axes.tripcolor(
            Triangulation(x, y, self._triangles),
            self._mises,
            shading="gouraud",
            cmap="YlGnBu",
            vmin=0.0,
            vmax=min(most, highest),
            rasterized=True,
        )
        curves = np.einsum("sk,nki->nsi", shapes(np.linspace(0, 1, 5)), self.points[self._sides])
        lines = LineCollection(list(curves), colors="#000000", linewidths=width, rasterized=True)
        axes.add_collection(lines, autolim=False)
        beyond = "max" if most > highest else "neither"
        label = "von Mises stress over $E$"
        axes.figure.colorbar(coloured, ax=axes, label=label, extend=beyond)


def _rigid(axes: Axes, cylinder: Cylinder, state: State) -> None:
    bottom = axes.get_ylim()[0]
    right = axes.get_xlim()[1]
    profile = cylinder.profile
    if profile is None:
        axes.axhspan(bottom, state.rise - 1.0, color=_RIDGE, linewidth=0)
    else:
        height = first_height(profile) + state.rise
        n = math.ceil(right / profile.pitch) + 1
        ridges = [_outline(profile.ridge(k), height, bottom) for k in range(-n - 1, n + 1)]
        axes.add_collection(PolyCollection(ridges, color=_RIDGE, linewidths=0), autolim=False)
        if height - profile.depth > bottom:
            axes.axhspan(bottom, height - profile.depth, color=_RIDGE, linewidth=0)


def _outline(ridge: RigidSegment, height: float, bottom: float) -> FloatArray:
    (start, stop), r = ridge.flat, ridge.corner
    out, up = r * np.sin(_ARC), height - r + r * np.cos(_ARC)
    x = [ridge.start, *(start - out)[::-1], *(stop + out), ridge.stop]
    return np.column_stack([x, [bottom, *up[::-1], *up, bottom]])


def _pressure(axes: Axes, table: pd.DataFrame, most: float, *, mirrored: bool) -> None:
    half = 0.5 * table["length"] * table["normal_y"].abs()
    low, high = (table["x"] - half).to_numpy(), (table["x"] + half).to_numpy()
    height = table["pressure"].to_numpy()
    zero = 0 * height
    corners = [[low, zero], [high, zero], [high, height], [low, height]]
    bars = np.moveaxis(np.array(corners), -1, 0)  # shape (n_bar, 4, 2)
    if mirrored:
        bars = np.concatenate([bars, bars * [-1.0, 1.0]])
    axes.add_collection(PolyCollection(list(bars), color=_PRESSURE, alpha=0.6, linewidths=0))
    axes.set_ylim(0.0, 1.05 * min(height.max(), most))
    axes.yaxis.set_major_locator(MaxNLocator(4))
