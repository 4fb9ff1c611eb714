"""CalculiX's contact print: which faces are pressed, and so in which increment ridges are."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.fea.calculix import Level, whole_levels
from ridgebayes.fea.deck import RunDeck
from ridgebayes.fea.record import Imported
from ridgebayes.fea.surface import Body, CylinderSurface, Origin, table_from_gaps


def read_calculix_contact(
    path: Path, body: Body, *, deck: Path, surface: str, reaction: str, sta: Path | None = None
) -> Imported:
    """Read in which increment each ridge is pressed first.

    Parameters
    ----------
    path : pathlib.Path
        The ``.dat`` file: ``*CONTACT PRINT`` of ``CSTR`` (of faces: ``TYPE=SURFACE TO SURFACE``),
        ``*NODE PRINT`` of ``RF`` on the driven set and, to place faces as they are rather than as
        they were, of ``U`` on the surface, at each increment.
    body : Body
        What the files do not say; `top` is not used.
    deck : pathlib.Path
        The run's ``.inp`` file.
    surface, reaction : str
        Node sets: the body's rim, and where the load is read.
    sta : pathlib.Path or None, optional
        The run's ``.sta``: levels that it does not call converged are ignored.

    Returns
    -------
    Imported
        Each load as a bracket.

    Raises
    ------
    InputError
        If a file cannot be understood, with file and line; if a set is missing; if no ridge but
        the first is pressed.

    Notes
    -----
    A face over two ridges leaves open which of them it touches: such an increment is neither end
    of a bracket.
    """
    run = RunDeck.read(deck, surface, reaction, E=body.E, nu=body.nu)
    levels, messages = whole_levels(path, run, sta, contact=True)
    if not levels:
        raise InputError(
            f"{path}: no level with contact stress, a total force of {reaction} and usable "
            f"displacements; expected displacements of all of {surface}, or none, "
            "*CONTACT PRINT of CSTR and *NODE PRINT of RF, TOTALS=ONLY"
        )
    rim = CylinderSurface.of(run.undeformed, str(deck), R=body.R, symmetry=body.symmetry)
    faces = [_intervals(one, run, float(rim.centre[0]), path) for one in levels]
    if n := sum(one.moved is None for one in levels):
        messages.append(f"{n} levels without displacements of {surface}: faces where they were")
    farthest = max((float(one[:, 1].max()) for one in faces if len(one)), default=0.0)
    rim.check_reach("face", farthest, str(path))
    return table_from_gaps(
        np.array([one.force or 0.0 for one in levels]),
        _gaps(faces, farthest, body.a_over_R * rim.R, body.b_over_R * rim.R),
        replace(body, R=rim.R),
        Origin(str(path), "calculix", run.provenance(path, "calculix-contact")),
        messages=(
            f"{path}: {len(levels)} levels",
            *messages,
            f"surface: {len(run.nodes)} nodes on a circle of R = {rim.R:.6g}",
            f"pressed faces: {max(len(one) for one in faces)} at most",
        ),
        brackets=True,
    )


def _intervals(level: Level, run: RunDeck, axis: float, path: Path) -> FloatArray:
    """Return from where to where pressed faces are, outwards from the axis, shape (n_face, 2)."""
    found = []
    for element, side in sorted(level.faces or ()):
        corners = _corners_of(element, run)
        if side > len(corners):
            raise InputError(f"{run.path}: element {element} has no side {side}")
        x = []
        for node in (corners[side - 1], corners[side % len(corners)]):
            moved = 0.0 if level.moved is None else level.moved.get(node, (math.nan,))[0]
            if math.isnan(moved):
                raise InputError(
                    f"{path}, line {level.line}: side {side} of element {element} is pressed, and "
                    f"node {node} of it was not printed; expected a surface with the nodes of all "
                    "pressed faces"
                )
            x.append(run.deck.nodes[node][0] + moved - axis)
        found.append(sorted(x if sum(x) >= 0 else [-one for one in x]))
    return np.array(found, dtype=float).reshape(-1, 2)


def _corners_of(element: int, run: RunDeck) -> tuple[int, ...]:
    nodes = run.deck.elements.get(element)
    if nodes is None:
        raise InputError(
            f"{run.path}: no element {element}, which is pressed; expected the run's deck"
        )
    n = {3: 3, 6: 3, 4: 4, 8: 4}.get(len(nodes))
    places = {run.deck.nodes.get(node) for node in nodes}
    if n is None or None in places or len(places) < len(nodes):
        raise InputError(
            f"{run.path}: element {element} of {len(nodes)} nodes; expected plane triangles and "
            "quadrilaterals"
        )
    return nodes[:n]


def _gaps(placed: list[FloatArray], farthest: float, a: float, b: float) -> FloatArray:
    """Return -inf where a ridge is pressed, inf where not, NaN where that is open.

    Shape (n_level, n_ridge), from the second ridge on.
    """
    n = max(math.ceil((farthest - b / 2) / (a + b)), 1) + 1
    near = b / 2 + (a + b) * np.arange(n)
    gap = np.full((len(placed), n), math.inf)
    for i, faces in enumerate(placed):
        # Faces reach over the groove beside the ridge that presses them, at most to its middle.
        over = (faces[:, 1:] >= near) & (faces[:, :1] <= near + a)
        none = ~over.any(axis=1)
        over[none] = (faces[none, 1:] >= near - b) & (faces[none, :1] <= near + a + b)
        sure = over & (over.sum(axis=1, keepdims=True) == 1)
        gap[i, over.any(axis=0)] = math.nan
        gap[i, sure.any(axis=0)] = -math.inf
    return gap[:, 1:]
