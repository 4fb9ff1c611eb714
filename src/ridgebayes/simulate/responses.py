"""Contact of a scene at given loads: counts, widths, penetration, and forces on ridges."""

import math
import os
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from ridgebayes._types import FloatArray
from ridgebayes.contact import two_scale
from ridgebayes.contact.contact_solution import (
    ContactSolution,
    load_factor,
    no_solution,
    solve_many_contacts,
)
from ridgebayes.contact.edges import edge_forces as edges_of
from ridgebayes.contact.halfplane import check_tolerance
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import InputError
from ridgebayes.runtime.pool import one_blas_thread
from ridgebayes.scene.effects import HIGHEST_LOAD, full_profile
from ridgebayes.scene.estimates import plan
from ridgebayes.scene.scene import Scene, as_scene
from ridgebayes.simulate.solvers import offsets_between
from ridgebayes.table.columns import LARGEST_LOAD
from ridgebayes.table.rules import texture_label

_FIRST, _LAST = ["texture", "p_over_E"], ["penetration_over_R", "rel_se", "status"]
RESPONSE_COLUMNS = [*_FIRST, "Q", "contact_fraction", "half_width_over_R", "approach_over_R"]
RESPONSE_COLUMNS += _LAST
FORCE_COLUMNS = [*_FIRST, "land", "ridge", "left_over_R", "right_over_R", "share"]
FORCE_COLUMNS += ["mean_pressure_over_E", *_LAST]
EDGE_COLUMNS = [*_FIRST, "land", "ridge", "side", "x_over_R", "K", "G", "lateral_force", "status"]
_N_OFFSETS = 32  # over which quantities are averaged for a uniform offset


@one_blas_thread()
def contact_at_loads(
    scene: Scene | str | os.PathLike[str],
    p_over_E: ArrayLike,
    *,
    solver: str = "auto",
    rel_tol: float = 1e-6,
) -> pd.DataFrame:
    """Return count, width and depth of the contact of each texture at each load.

    Parameters
    ----------
    scene : Scene or path
        Textures and Poisson's ratio; the scene's load is not used.
    p_over_E : array_like of float, shape (n_load,), dimensionless
        Loads per projected area over Young's modulus.
    solver : {"auto", "half-plane", "two-scale"}
        ``"half-plane"`` (small strain) and ``"two-scale"`` (large deformation of the body) simulate
        all effects in the scene, ``"auto"`` those that matter.
    rel_tol : float, optional
        Tolerance of contact ends.

    Returns
    -------
    pandas.DataFrame
        One row for each texture and load, (n_texture n_load,) in all. Columns texture, p_over_E, Q
        (ridges in contact), contact_fraction (length in contact between its outermost ends),
        half_width_over_R (half the distance between them), approach_over_R (relative to the surface
        at a distance R), penetration_over_R (deepest, into any groove), rel_se (relative standard
        error of the load; that of lengths is about half of it; 0 at small strain), status
        (``"ok"``, or the reason why the numbers of the row must not be used). For an offset
        ``"uniform"`` all values are means over 32 offsets, so Q need not be an integer.

    Raises
    ------
    InputError
        If a load is not finite, positive and at most 1e300, the solver is unknown, or the contact
        of a texture cannot be estimated.

    Notes
    -----
    *Validity.* Friction is neglected. "half-plane" is for small strain: within 1 % of finite strain
    up to p/E = 0.015, for moderate grooves. "two-scale" is for p/E up to 0.5; `status` marks loads
    above those compared with finite elements. "auto" is as for `generate`, with two-scale instead
    of finite elements; if nu is below 0.3, half-plane up to p/E = 0.1. The status marks contacts
    of too many ridges, which are not computed.

    *Accuracy.* In a mean count, the position of each change of the count errs by at most 1/64
    pitch.

    *Cost.* Milliseconds for a texture and load; 32 times that for a uniform offset.

    Examples
    --------
    >>> found = contact_at_loads(Scene.of([(0.012, 0.03)]), [0.0005, 0.001, 0.004])
    >>> found["Q"].tolist(), found["contact_fraction"].round(2).tolist()
    ([2, 4, 6], [0.44, 0.22, 0.26])
    """
    rows = []
    scene = as_scene(scene)
    for label, load, places, scale in _solved(scene, p_over_E, solver, rel_tol):
        measures = np.array([_measures(solution) for solution in places])
        mean = measures[0] if len(places) == 1 else measures.mean(axis=0)
        count = places[0].Q if len(places) == 1 else mean[0]
        status = next((solution.status for solution in places if solution.status != "ok"), "ok")
        profile = places[0].profile
        error, deepest = _error(load, profile, scale, scene), min(mean[4] * scale, profile.depth)
        rows.append([label, load, count, *mean[1:4].tolist(), deepest, error, status])
    return pd.DataFrame(rows, columns=RESPONSE_COLUMNS)


def _measures(solution: ContactSolution) -> list[float]:
    """Return the count, contact fraction, half-width, approach and deepest penetration."""
    left, right = solution.ends
    deepest = max(solution.penetrations.values(), default=math.nan)
    return [solution.Q, solution.contact_fraction, 0.5 * (right - left), solution.approach, deepest]


@one_blas_thread()
def ridge_forces(
    scene: Scene | str | os.PathLike[str],
    p_over_E: ArrayLike,
    *,
    solver: str = "auto",
    rel_tol: float = 1e-6,
) -> pd.DataFrame:
    """Return the contact on each ridge and floor of a scene at each load.

    Parameters
    ----------
    scene : Scene or path
        Textures and Poisson's ratio; the scene's load is not used.
    p_over_E : array_like of float, shape (n_load,), dimensionless
        Loads per projected area over Young's modulus.
    solver : {"auto", "half-plane", "two-scale"}
        ``"half-plane"`` (small strain) and ``"two-scale"`` (large deformation of the body) simulate
        all effects in the scene, ``"auto"`` those that matter.
    rel_tol : float, optional
        Tolerance of contact ends.

    Returns
    -------
    pandas.DataFrame
        Columns texture, p_over_E, land (``ridge`` or ``floor``), ridge (its number, or that of
        the ridge to the left of a floor), left_over_R, right_over_R (ends of contact), share (of
        the load), mean_pressure_over_E, penetration_over_R (into the groove to the right), rel_se
        (see `contact_at_loads`), status. A symmetric position has only the right half. A load that
        could not be computed has one row, whose status gives the reason.

    Raises
    ------
    InputError
        See `contact_at_loads`; also if a texture's offset is ``"uniform"``.

    Notes
    -----
    *Validity.* See `contact_at_loads`.

    Examples
    --------
    Two ridges, each with half of the load:

    >>> found = ridge_forces(Scene.of([(0.012, 0.03)]), [0.0005])
    >>> found["ridge"].tolist(), found["share"].round(6).tolist()
    ([0], [0.5])
    """
    scene = _scene_with_offset(scene)
    rows = []
    for label, load, (solution,), scale in _solved(scene, p_over_E, solver, rel_tol):
        profile, pressing, grooves = solution.profile, solution.pressing, solution.penetrations
        if not solution.segments:
            rows.append([label, load, "", -1, *[math.nan] * 6, solution.status])
        error = _error(load, solution.profile, scale, scene)
        contacts = zip(solution.covered.items(), pressing.forces.tolist(), strict=True)
        for (segment, (left, right)), force in contacts:
            kind, share = "floor" if segment.ridge is None else "ridge", force / pressing.load
            number = profile.ridge_before(segment)
            pressure, penetration = 2 * load * share / (right - left), grooves.get(number, math.nan)
            values = [left, right, share, pressure, min(penetration * scale, profile.depth), error]
            rows.append([label, load, kind, number, *values, solution.status])
    return pd.DataFrame(rows, columns=FORCE_COLUMNS)


@one_blas_thread()
def edge_forces(
    scene: Scene | str | os.PathLike[str], p_over_E: ArrayLike, *, rel_tol: float = 1e-8
) -> pd.DataFrame:
    """Return the forces on the edges of every contact, and the net lateral force on the body.

    At a sharp corner in full contact the pressure is singular like K/sqrt(2 pi r), and
    G = (1 - nu^2) K^2/(2 E) is a force on the body per length, from the ridge into the groove.

    Parameters
    ----------
    scene : Scene or path
        Textures and Poisson's ratio; the scene's load is not used. All its effects are simulated.
    p_over_E : array_like of float, shape (n_load,), dimensionless
        Loads per projected area over Young's modulus.
    rel_tol : float, optional
        Tolerance of contact ends.

    Returns
    -------
    pandas.DataFrame
        Edges from left to right. Columns texture, p_over_E, land (``ridge`` or ``floor``), ridge
        (its number, or that of the ridge to the left of a floor), side (-1 left, 1 right), x_over_R
        (end of contact, from the body's axis), K (over E sqrt(R)), G (over E R), lateral_force (net
        force on the body, over E R: the load is 2 p/E), status. K and G are 0 if contact ends on a
        ridge's top, or the corner is round. A load that could not be computed has one row, whose
        status gives the reason.

    Raises
    ------
    InputError
        See `contact_at_loads`; also if a texture's offset is ``"uniform"``.

    Notes
    -----
    *Validity.* Small strain, as for "half-plane" in `contact_at_loads`. The resistance of edges to
    sliding is not included: see `docs/derivations/edges.md`.

    *Accuracy.* The lateral force is computed from the pressure's centroid. With sharp corners it
    equals the sum of side times G to 1e-6 of the sum of G.

    Examples
    --------
    For an offset body the forces of edges do not balance:

    >>> from ridgebayes.scene.scene import Texture
    >>> scene = Scene(textures=(Texture(a_over_R=0.012, b_over_R=0.03, offset=0.2),))
    >>> found = edge_forces(scene, [0.0003])
    >>> found["side"].tolist(), bool(found["lateral_force"].iloc[0] < 0)
    ([-1, 1, -1, 1], True)
    >>> net = (found["side"] * found["G"]).sum()
    >>> bool(abs(net - found["lateral_force"].iloc[0]) < 1e-6 * found["G"].sum())
    True
    """
    scene = _scene_with_offset(scene)
    rows = []
    for label, load, (solution,), _ in _solved(scene, p_over_E, "half-plane", rel_tol):
        if not solution.segments:
            rows.append([label, load, "", -1, 0, *[math.nan] * 4, solution.status])
            continue
        edges = edges_of(solution, scene.nu)
        kinds = np.where(edges.is_floor, "floor", "ridge")
        columns = (kinds, edges.ridge, edges.side, edges.x, edges.K, edges.G)
        for row in zip(*(column.tolist() for column in columns), strict=True):
            rows.append([label, load, *row, edges.lateral, solution.status])
    return pd.DataFrame(rows, columns=EDGE_COLUMNS)


def _scene_with_offset(source: Scene | str | os.PathLike[str]) -> Scene:
    """Return a scene, or raise InputError if a texture's offset is uniform."""
    scene = as_scene(source)
    if any(texture.offset == "uniform" for texture in scene.textures):
        raise InputError("offset: expected a number, got 'uniform' (forces depend on the offset)")
    return scene


def _error(load: float, profile: Profile, scale: float, scene: Scene) -> float:
    """Return the relative error of a load at large deformation; 0 at small strain."""
    if scale == 1.0:
        return 0.0
    return float(two_scale.relative_error(load, profile, scene.nu, scene.ogden))


def _solved(
    scene: Scene, p_over_E: ArrayLike, solver: str, rel_tol: float
) -> Iterator[tuple[str, float, tuple[ContactSolution, ...], float]]:
    """Yield each texture's label and load with its solutions, one for each offset.

    The last item is the load over the equivalent half-plane load; pressures and penetrations are
    larger by this factor.
    """
    check_tolerance(rel_tol)
    try:
        loads = np.atleast_1d(np.asarray(p_over_E, dtype=np.float64))
    except (OverflowError, TypeError, ValueError):
        raise InputError(f"p_over_E: expected numbers, got {p_over_E!r}") from None
    within = (loads > 0) & (loads <= LARGEST_LOAD)
    if not loads.size or not np.all(within):
        rule = f"finite and > 0, at most {LARGEST_LOAD:g}"
        raise InputError(f"p_over_E = {next(iter(loads[~within]), 'none')}; expected {rule}")
    if solver not in ("auto", "half-plane", "two-scale"):
        raise InputError(f"solver = {solver!r}; expected auto, half-plane or two-scale")
    profiles = [full_profile(texture) for texture in scene.textures]
    solvers = [solver] * len(profiles)
    if solver == "auto":
        # Forces on ridges need ridges, even if these have no effect on transition loads.
        sharp = [Profile(texture.a_over_R, texture.b_over_R) for texture in scene.textures]
        highest = {"max_p_over_E": min(float(loads.max()), two_scale.REACH)}
        loaded = tuple(texture.model_copy(update=highest) for texture in scene.textures)
        plans = plan(scene.model_copy(update={"textures": loaded}))
        profiles = [planned.profile or ridges for planned, ridges in zip(plans, sharp, strict=True)]
        solvers = [planned.solver for planned in plans]
    for texture, profile, chosen in zip(scene.textures, profiles, solvers, strict=True):
        label = texture_label(texture.a_over_R, texture.b_over_R)
        offsets = offsets_between(_N_OFFSETS) if texture.offset == "uniform" else [profile.offset]
        places = [replace(profile, offset=offset) for offset in offsets]
        load_ratio = np.ones_like(loads)
        if solver == "auto" and scene.nu < two_scale.LEAST_NU:
            load_ratio[loads > HIGHEST_LOAD] = math.nan
        elif chosen != "half-plane":
            load_ratio = two_scale.width_ratio(loads, scene.nu, scene.ogden) ** -2.0
        by_place = [_pressed(place, scene, loads, load_ratio, rel_tol) for place in places]
        scales = zip(loads.tolist(), load_ratio.tolist(), strict=True)
        for (load, scale), solutions in zip(scales, zip(*by_place, strict=True), strict=True):
            yield label, load, solutions, scale


def _pressed(
    profile: Profile, scene: Scene, loads: FloatArray, load_ratio: FloatArray, rel_tol: float
) -> list[ContactSolution]:
    """Return the contact at each load, from a half-plane at the load over `load_ratio`."""
    within = np.isfinite(load_ratio)
    W = load_factor(scene.nu) * loads[within] / load_ratio[within]
    checked = two_scale.checked(scene.ogden)
    solved = iter(solve_many_contacts(profile, W, rel_tol=rel_tol))
    beyond = no_solution(profile, two_scale.BEYOND)
    solutions = [next(solved) if reached else beyond for reached in within]
    return [
        replace(solution, status=two_scale.UNCHECKED)
        if scale != 1.0 and load > checked and solution.status == "ok"
        else solution
        for load, scale, solution in zip(loads, load_ratio, solutions, strict=True)
    ]
