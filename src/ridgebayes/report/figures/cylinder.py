"""Figures of the whole cylinder: its deformed mesh on ridges, and its contact beside Hertz's."""

import math

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from ridgebayes._types import FloatArray
from ridgebayes.contact.cylinder.contact_problem import State
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.faces import first_height
from ridgebayes.contact.cylinder.fields import nodal_fields, surface_table
from ridgebayes.contact.cylinder.surface import shapes
from ridgebayes.contact.rigid_profile import RigidSegment
from ridgebayes.drawing.style import COLOURS, WIDTH, new_figure, styled
from ridgebayes.errors import InputError

_BODY, _RIDGE, _PRESSURE = COLOURS["modified"], "#B8B8B8", COLOURS["classic"]
# Label, and the highest that has a colour of its own, over the mean contact pressure: more than
# there is under a smooth contact, less than near sharp corners.
_FIELDS = {
    "von Mises": ("von Mises stress over $E$", 0.8),
    "pressure": ("pressure inside over $E$", 1.4),
}
_SIDES = [[0, 4, 1], [1, 5, 2], [2, 6, 3], [3, 7, 0]]  # of an element: end, middle, end
_AROUND = [0, 4, 1, 5, 2, 6, 3, 7]  # its nodes but the centre: eight triangles
_MARGIN, _HEIGHT = 1.2, 0.68  # of the close-up: half its width, over the contact's; height over it
_BELOW = 0.1  # of that height under the body
_ACROSS = 7.3  # inches of panels: the width less labels and colours
_BEYOND = {  # of the colours, by whether anything is below, and above
    (False, False): "neither",
    (False, True): "max",
    (True, False): "min",
    (True, True): "both",
}
_ARC = np.linspace(0.0, 0.5 * math.pi, 13)
_HIGHEST = 3.0  # of the mean contact pressure: sharp corners stand out of any axis


@styled()
def plot_deformed(
    cylinder: Cylinder, state: State, *, fields: tuple[str, str] = ("von Mises", "von Mises")
) -> Figure:
    """Draw a pressed cylinder: the whole of it, its contact close up, and the pressure there.

    Parameters
    ----------
    cylinder : Cylinder
        The body.
    state : State
        Its state, in contact.
    fields : tuple of {"von Mises", "pressure"}
        What colours the whole, and the close-up. Tension is one colour, and so is what is found
        near sharp corners alone.

    Returns
    -------
    matplotlib.figure.Figure
        Deformed elements on the rigid side, nothing stretched; below, contact pressure over E, cut
        off at three times its mean.

    Raises
    ------
    InputError
        If there is no such field, or nothing is in contact.
    """
    for field in fields:
        if field not in _FIELDS:
            raise InputError(f"fields: no {field!r}; expected {' or '.join(_FIELDS)}")
    table = surface_table(cylinder, state)
    if table.empty:
        raise InputError("the body touches nothing: no contact to draw")
    mean = float(np.average(table["pressure"], weights=table["length"]))
    body = _Body(cylinder, state, mean)
    low, high = body.points.min(axis=0), body.points.max(axis=0)
    wide = 1.05 * max(high[0], -low[0])
    half = _MARGIN * float((table["x"].abs() + 0.5 * table["length"]).max())
    bottom = float(low[1]) - _BELOW * _HEIGHT * half
    # The close-up has room to spare in height, lest it be narrower than the pressure below it.
    tall = high[1] - low[1] + 0.1
    rows = [_ACROSS * 0.5 * tall / wide, _ACROSS * 0.5 * _HEIGHT + 0.1, 1.7]
    figure = new_figure(WIDTH, sum(rows) + 1.3)
    whole, near, below = figure.subplots(3, 1, gridspec_kw={"height_ratios": rows})
    whole.set(xlim=(-wide, wide), ylim=(low[1] - 0.07, high[1] + 0.03))
    near.set(xlim=(-half, half), ylim=(bottom, bottom + _HEIGHT * half))
    for axes, field, width in ((whole, fields[0], 0.1), (near, fields[1], 0.3)):
        axes.set_aspect("equal")
        axes.grid(visible=False)
        axes.set_ylabel("$y/R$")
        _rigid(axes, cylinder, state)
        body.draw(axes, field, width)
    _pressure(below, table, _HIGHEST * mean, mirrored=cylinder.mirrored)
    below.set(xlim=(-half, half), xlabel="$x/R$", ylabel="pressure over $E$")
    return figure


@styled()
def plot_departure(
    loads: FloatArray, half_widths_over_hertz: FloatArray, *, nu: float = 0.5
) -> Figure:
    """Draw how far the contact of a smooth cylinder departs from Hertz's.

    Parameters
    ----------
    loads : ndarray of float, shape (n,)
        p/E.
    half_widths_over_hertz : ndarray of float, shape (n,)
        Contact half-width over that of Hertz at the same load.
    nu : float, optional
        Poisson's ratio.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = new_figure(WIDTH, 4.2)
    axes = figure.subplots()
    label = rf"smooth cylinder, $\nu$ = {nu:g}"
    axes.plot(loads, half_widths_over_hertz, "o-", color=_BODY, markersize=4, label=label)
    axes.axhline(1.0, color="#000000", linewidth=0.8, linestyle=":", label="Hertz")
    axes.set_xlim(left=0.0)
    axes.set_xlabel("load $p/E$")
    axes.set_ylabel("contact half-width over Hertz")
    figure.legend(loc="outside upper center", ncols=2)
    return figure


class _Body:
    """The deformed mesh with its mirror image, and what colours it."""

    def __init__(self, cylinder: Cylinder, state: State, mean: float) -> None:
        solid, self._mean = cylinder.problem.solid, mean
        self.points = solid.points + state.u
        elements = solid.nodes
        found = nodal_fields(cylinder, state)
        stress = found["cauchy_stress"].reshape(-1, 3, 3)
        deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        mises = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
        self._values = {"von Mises": mises, "pressure": found["pressure"]}
        if cylinder.mirrored:
            elements = np.concatenate([elements, elements + solid.n_node])
            self.points = np.concatenate([self.points, self.points * [-1.0, 1.0]])
            self._values = {name: np.tile(one, 2) for name, one in self._values.items()}
        around = elements[:, _AROUND]
        centre = np.broadcast_to(elements[:, 8:], around.shape)
        triangles = np.stack([centre, around, np.roll(around, -1, axis=1)], axis=-1)
        self._triangles = triangles.reshape(-1, 3)
        sides = elements[:, _SIDES].reshape(-1, 3)
        self._sides = sides[np.unique(sides[:, 1], return_index=True)[1]]

    def draw(self, axes: Axes, field: str, width: float) -> None:
        """Draw elements, coloured, their edges curved, and what the colours mean."""
        values = self._values[field]
        label, share = _FIELDS[field]
        least, most = float(values.min()), float(values.max())
        x, y = self.points.T
        coloured = axes.tripcolor(
            Triangulation(x, y, self._triangles),
            values,
            shading="gouraud",
            cmap="YlGnBu",
            vmin=0.0,
            vmax=min(most, share * self._mean),
            rasterized=True,
        )
        curves = np.einsum("sk,nki->nsi", shapes(np.linspace(0, 1, 5)), self.points[self._sides])
        lines = LineCollection(list(curves), colors="#000000", linewidths=width, rasterized=True)
        axes.add_collection(lines, autolim=False)
        beyond = _BEYOND[least < 0, most > share * self._mean]
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
    top = np.concatenate(
        [np.column_stack([start - out, up])[::-1], np.column_stack([stop + out, up])]
    )
    return np.concatenate([[[ridge.start, bottom]], top, [[ridge.stop, bottom]]])


def _pressure(axes: Axes, table: pd.DataFrame, most: float, *, mirrored: bool) -> None:
    half = 0.5 * table["length"] * table["normal_y"].abs()
    low, high = (table["x"] - half).to_numpy(), (table["x"] + half).to_numpy()
    height = table["pressure"].to_numpy()
    bars = np.stack(
        [
            np.column_stack([low, high, high, low]),
            np.column_stack([0 * height, 0 * height, height, height]),
        ],
        axis=-1,
    )
    if mirrored:
        bars = np.concatenate([bars, bars * [-1.0, 1.0]])
    axes.add_collection(PolyCollection(list(bars), color=_PRESSURE, alpha=0.6, linewidths=0))
    axes.set_ylim(0.0, 1.05 * min(height.max(), most))
    axes.yaxis.set_major_locator(MaxNLocator(4))
