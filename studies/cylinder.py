"""What the finite-element cylinder is worth: ``python -m studies.cylinder [NAME ...]``.

Each NAME is a table docs/validation/cylinder-NAME.csv and, of some, a figure beside it; all of them
if none is given. Seconds are of one thread.

meshes         loads against edges a ridge: corners that are round, and sharp ones (1 minute)
smooth         the smooth cylinder to p/E = 0.25 against Hertz (half a minute)
small-strain   textures of 0.3 to 0.04 times their size against the half-plane equation (2 minutes)
friction       loads against the coefficient, up to sticking (1 minute)
energy         work of the load against the energy stored, by steps (1 minute)
radii          (0.012, 0.09) at corner radii of a/10, a/20 and a/40 (half an hour)
high           (0.022, 0.02) to p/E = 0.1 at corner radii of a/20 and a/40 (half an hour)

Run it from the repository's root with OMP_NUM_THREADS=1.
"""

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from ridgebayes._types import FloatArray
from ridgebayes.contact import halfplane, hertz
from ridgebayes.contact.contact_solution import load_factor
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.newton import Control, NotConvergedError, solve
from ridgebayes.contact.reaching import reaching_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.drawing.style import COLOURS, WIDTH, as_bytes, new_figure, styled
from ridgebayes.report.figures.bodies import plot_deformed
from tests.contact.cylinder.energy import stored_energy

OUT = Path("docs/validation")
A, B = 0.022, 0.02


def _save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG alone: meshes are large as vectors."""
    path.with_suffix(".png").write_bytes(as_bytes(figure, "png"))


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
    axes.plot(
        loads, half_widths_over_hertz, "o-", color=COLOURS["modified"], markersize=4, label=label
    )
    axes.axhline(1.0, color="#000000", linewidth=0.8, linestyle=":", label="Hertz")
    axes.set_xlim(left=0.0)
    axes.set_xlabel("load $p/E$")
    axes.set_ylabel("contact half-width over Hertz")
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def transitions(
    profile: Profile, p_max: float, edges: float, keep: list | None = None, **others
) -> pd.DataFrame:
    """Return the transitions of a profile; the last row says why there are no more, if so."""
    start = time.process_time()
    body = Cylinder(profile, p_max=p_max, edges=edges, **others)
    rows, status = [], "ok"
    try:
        for one in body.transitions(p_max):
            seconds = time.process_time() - start
            rows.append({"Q": one.Q, "p_over_E": one.p_over_E, "cpu_s": round(seconds, 1)})
            print(rows[-1], flush=True)
            if keep is not None:
                keep[:] = [body, one.state]
    except NotConvergedError as failed:
        status = f"not converged: {failed}"
    frame = pd.DataFrame(rows, columns=["Q", "p_over_E", "cpu_s"])
    frame["status"] = "ok"
    if status != "ok":
        last = int(frame["Q"].max()) if len(frame) else 2
        frame.loc[len(frame)] = [last + 2, np.nan, time.process_time() - start, status]
    frame.insert(0, "elements", body.problem.solid.mesh.mesh.nelements)
    frame.insert(0, "edges", edges)
    frame.insert(0, "corner_over_a", profile.corner / profile.a)
    return frame


def meshes() -> pd.DataFrame:
    """Double the edges three times; the order is that of the last three values."""
    parts = []
    for corner, p_max, all_edges in ((0.125, 0.0045, (6, 12, 24, 48)), (0.0, 0.0045, (12, 24, 48))):
        profile = Profile(A, B, corner=corner * A)
        parts += [transitions(profile, p_max, edges, nu=0.49) for edges in all_edges]
    frame = pd.concat(parts, ignore_index=True)
    for _, group in frame.groupby(["corner_over_a", "Q"]):
        p = group["p_over_E"].to_numpy()
        steps = np.diff(p)
        frame.loc[group.index[2:], "order"] = np.log2(np.abs(steps[:-1] / steps[1:]))
        limit = p[-1] - steps[-1] / (1 - steps[-2] / steps[-1])
        frame.loc[group.index, "off_limit"] = p / limit - 1
    return frame


def half_width(body: Cylinder, pressure: np.ndarray) -> float:
    """Return where the contact ends: pressure squared falls to zero there, linear in x^2."""
    length = body.problem.faces.length
    x = np.cumsum(length) - 0.5 * length
    inside = np.flatnonzero(pressure > 0)[-9:-2]  # the last two hold part of a contact
    slope, level = np.polyfit(x[inside] ** 2, pressure[inside] ** 2, 1)
    return float(np.sqrt(-level / slope))


def smooth() -> pd.DataFrame:
    """Press the smooth cylinder to p/E = 0.25."""
    rows = []
    body = Cylinder(None, p_max=0.25, edges=48)
    state = body.unloaded()
    for p in (0.005, 0.01, 0.02, 0.04, 0.06, 0.08, 0.1, 0.125, 0.15, 0.175, 0.2, 0.225, 0.25):
        state = body.at_load(p, state)
        width = half_width(body, state.pressure)
        over = width / float(hertz.half_width(p, nu=0.5))
        rows.append({"p_over_E": p, "half_width_over_R": width, "over_hertz": over})
    _save(plot_deformed(body, state), OUT / "cylinder-smooth-deformed")
    frame = pd.DataFrame(rows)
    figure = plot_departure(frame["p_over_E"].to_numpy(), frame["over_hertz"].to_numpy())
    _save(figure, OUT / "cylinder-smooth")
    return frame


def small_strain() -> pd.DataFrame:
    """Shrink a texture, and with it the contact: what is left is the discretisation."""
    rows = []
    for scale in (1.0, 0.3, 0.1, 0.04):
        a, b = 0.032 * scale, 0.01 * scale
        loads = halfplane.transition_loads(a, b, 3).p_over_E(a + b, nu=0.5)
        found = transitions(Profile(a, b), 1.02 * float(loads[-1]), 24)
        for exact, row in zip(loads, found.to_dict("records"), strict=True):
            rows.append({"scale": scale, **row, "over_half_plane": row["p_over_E"] / exact})
    return pd.DataFrame(rows)


def friction() -> pd.DataFrame:
    """Raise the coefficient until nothing slides."""
    parts = []
    for coefficient in (0.0, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0):
        found = transitions(Profile(A, B), 0.004, 8, nu=0.3, friction=coefficient)
        parts.append(found.assign(friction=coefficient))
    frame = pd.concat(parts, ignore_index=True)
    without = frame[frame["friction"] == 0].set_index("Q")["p_over_E"]
    frame["over_frictionless"] = frame["p_over_E"] / frame["Q"].map(without)
    return frame


def energy() -> pd.DataFrame:
    """Integrate the load over the rise in more and more steps, on ridges and on a flat."""
    rows = []
    for name, profile in (("flat", None), ("ridges", Profile(0.06, 0.03, corner=0.0075))):
        body = Cylinder(profile, p_max=0.01, nu=0.3, edges=16)
        for n in (10, 20, 40, 80):
            state, rises, loads = body.unloaded(), [0.0], [0.0]
            for rise in 0.02 * (np.arange(n) + 1) / n:
                state = solve(body.problem, state, Control("rise", float(rise)))[0]
                rises.append(float(rise))
                loads.append(2 * body.p_over_E(state))
            work = float(np.trapezoid(loads, rises))
            stored = 2 * stored_energy(body.problem.solid, state.u)
            rows.append({"on": name, "steps": n, "work": work, "stored_over_work": stored / work})
    return pd.DataFrame(rows)


def radii() -> pd.DataFrame:
    """Press into wide grooves between narrow ridges, with rounder and sharper corners."""
    parts, kept = [], []
    for corner in (0.1, 0.05, 0.025):
        profile = Profile(0.012, 0.09, corner=corner * 0.012)
        found = transitions(profile, 0.045, 8, kept)
        if kept:
            _save(plot_deformed(*kept), OUT / f"cylinder-radii-{1 / corner:.0f}")
        exact = reaching_loads(profile, W_max=1.0, n_max=4, rel_tol=1e-6)
        factor = load_factor(0.5)
        known = dict(zip(exact.Q.tolist(), (exact.W / factor).tolist(), strict=True))
        parts.append(found.assign(half_plane=found["Q"].map(known)))
    return pd.concat(parts, ignore_index=True)


def high() -> pd.DataFrame:
    """Go to p/E = 0.1, where the contact is as wide as the radius is long."""
    parts, kept = [], []
    for corner in (0.05, 0.025):
        found = transitions(Profile(A, B, corner=corner * A), 0.1, 8, kept)
        if kept:
            _save(plot_deformed(*kept), OUT / f"cylinder-high-{1 / corner:.0f}")
        parts.append(found)
    return pd.concat(parts, ignore_index=True)


def finer() -> pd.DataFrame:
    """Go to high loads on round corners with two or three meshes."""
    parts = []
    for a, b, p_max, all_edges in ((0.08, 0.03, 0.2, (8, 16)), (A, B, 0.2, (6, 8, 12))):
        for edges in all_edges:
            found = transitions(Profile(a, b, corner=0.1 * a), p_max, edges)
            parts.append(found.assign(a_over_R=a, b_over_R=b))
    return pd.concat(parts, ignore_index=True)


@styled()
def convergence(frame: pd.DataFrame) -> None:
    """Draw distances from the limit against edges a ridge."""
    figure = new_figure(WIDTH, 4.0)
    axes = figure.subplots()
    # Sharp corners have no order to be seen: the segment at the corner nearly cancels it.
    for Q, group in frame[frame["corner_over_a"] > 0].groupby("Q"):
        style, colour = ("o-", "modified") if Q == 4 else ("s--", "classic")
        label = f"round corners, Q = {Q}"
        axes.loglog(
            group["edges"], group["off_limit"].abs(), style, color=COLOURS[colour], label=label
        )
    edges = np.array([6.0, 48.0])
    axes.loglog(edges, 5e-3 / edges, "k:", linewidth=1, label="first order")
    axes.set_xlabel("edges a ridge")
    axes.set_ylabel("load, relative distance from the limit")
    figure.legend(loc="outside upper center", ncols=2)
    _save(figure, OUT / "cylinder-meshes")


TABLES = {
    "meshes": meshes,
    "smooth": smooth,
    "small-strain": small_strain,
    "friction": friction,
    "energy": energy,
    "radii": radii,
    "high": high,
    "finer": finer,
}


def main() -> None:
    """Make the tables that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(TABLES))
    names = parser.parse_args().names or list(TABLES)
    unknown = [name for name in names if name not in TABLES]
    if unknown:
        parser.error(f"{', '.join(unknown)}: not one of {', '.join(TABLES)}")
    for name in names:
        frame = TABLES[name]()
        frame.to_csv(OUT / f"cylinder-{name}.csv", index=False, float_format="%.8g")
        print(frame.to_string(), flush=True)
        if name == "meshes":
            convergence(frame)


if __name__ == "__main__":
    main()
