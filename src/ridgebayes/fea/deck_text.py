"""Decks of a pressed disk as text, for CalculiX and for Abaqus."""

from collections.abc import Iterable

import numpy as np

from ridgebayes.errors import InputError
from ridgebayes.fea.pressed_disk import PressedDisk

FORMATS = ("calculix", "abaqus")
SURFACE, REACTION = "NARC", "NTOP"
_PENALTY = 1e5  # pressure over overlap, E/R: an overlap shifts the first transition most
_RIGID = 1000.0  # E of the blocks, whose nodes are all held
_STEP = "1.,1.,0.002,1."  # one increment a level, cut where it does not converge


def deck_text(disk: PressedDisk, program: str, *, penalty: float = _PENALTY) -> str:
    """Write a deck.

    Parameters
    ----------
    disk : PressedDisk
        What it holds.
    program : {"calculix", "abaqus"}
        Which reads it.
    penalty : float, optional, E/R
        Stiffness of CalculiX's contact, pressure over overlap.

    Returns
    -------
    str
        Eight-node plane-strain elements; each level a step of its own, at whose end the
        displacements of the rim (node set NARC) and the reaction of the mid-plane (NTOP) are
        printed.

    Raises
    ------
    InputError
        If the program is unknown, or CalculiX is asked for an incompressible body.

    Notes
    -----
    *Validity.* CalculiX leaves a spurious overlap where one step holds several increments: hence
    the steps. Its elements have no pressure of their own: Poisson's ratios near 0.5 lock in full
    integration, so that it is reduced.
    """
    if program not in FORMATS:
        raise InputError(f"--format {program}: expected {' or '.join(FORMATS)}")
    calculix = program == "calculix"
    if calculix and disk.nu > 0.499:
        raise InputError(
            f"nu = {disk.nu:g}: expected at most 0.499 for CalculiX, whose elements have no "
            "pressure of their own; 0.49 is within 1.4 % in load, or --format abaqus"
        )
    lines = [f"** {line}" for line in disk.title]
    lines += ["*HEADING", "soft cylinder on rigid ridges"]
    lines += _body(disk, "CPE8R" if calculix else "CPE8RH")
    lines += _blocks(disk)
    lines += _surfaces(disk)
    lines += _materials(disk)
    lines += _contact(disk, calculix, penalty)
    lines += ["*BOUNDARY", "NRID,1,2", "NAX,1,1"]
    for i, level in enumerate(disk.displacements):
        lines += _level(float(level), first=i == 0, calculix=calculix)
    return "\n".join(lines) + "\n"


def _body(disk: PressedDisk, element: str) -> list[str]:
    points, number, cells = disk.mesh.points, disk.numbers, disk.cells
    lines = ["*NODE,NSET=NDISK"]
    lines += [
        f"{number[i]},{points[i, 0]:.13g},{points[i, 1]:.13g},0." for i in np.flatnonzero(number)
    ]
    lines.append(f"*ELEMENT,TYPE={element},ELSET=EDISK")
    lines += [f"{i},{','.join(map(str, row))}" for i, row in enumerate(number[cells], 1)]
    sets = {REACTION: disk.mesh.mid_plane, "NAX": disk.mesh.axis, SURFACE: disk.rim}
    for name, nodes in sets.items():
        lines += [f"*NSET,NSET={name}", *_rows(n for n in number[nodes] if n)]
    return lines


def _blocks(disk: PressedDisk) -> list[str]:
    n_node, n_cell = int(disk.numbers.max()), len(disk.cells)
    lines = ["*NODE,NSET=NRID"]
    for k, block in enumerate(disk.blocks):
        lines += [f"{n_node + 4 * k + i},{x:.13g},{y:.13g},0." for i, (x, y) in enumerate(block, 1)]
    lines.append("*ELEMENT,TYPE=CPE4,ELSET=ERID")
    for k in range(len(disk.blocks)):
        lines.append(",".join(map(str, [n_cell + k + 1, *(n_node + 4 * k + 1 + np.arange(4))])))
    return lines


def _surfaces(disk: PressedDisk) -> list[str]:
    rim, points = disk.mesh.rim, disk.mesh.points
    middle = np.arctan2(points[:, 0], -points[:, 1])[rim[:, 1]]
    pressed = rim[middle < 2.0 * np.arcsin(min(disk.reach, 0.7)), 1]
    lines = ["*SURFACE,NAME=BODY,TYPE=ELEMENT"]
    for side in range(4):
        faces = np.flatnonzero(np.isin(disk.cells[:, 4 + side], pressed))
        lines += [f"{i + 1},S{side + 1}" for i in faces]
    lines.append("*SURFACE,NAME=RIDGES,TYPE=ELEMENT")
    n_cell = len(disk.cells)
    for k, block in enumerate(disk.blocks):
        # Walls are where no neighbour goes on at the same height.
        left = any(tuple(block[3]) == tuple(other[2]) for other in disk.blocks)
        right = any(tuple(block[2]) == tuple(other[3]) for other in disk.blocks)
        sides = [3, *[2] * (not right), *[4] * (not left)]
        lines += [f"{n_cell + k + 1},S{side}" for side in sides]
    return lines


def _materials(disk: PressedDisk) -> list[str]:
    mu = 0.5 / (1.0 + disk.nu)
    d1 = 6.0 * (1.0 - 2.0 * disk.nu)  # 2/K, and 0 for an incompressible body
    section = "*SOLID SECTION,ELSET={0},MATERIAL={1}"
    return [
        *("*MATERIAL,NAME=BODY", "*HYPERELASTIC,NEO HOOKE", f"{mu / 2:.10g},{d1:.10g}"),
        *("*MATERIAL,NAME=RIDGES", "*ELASTIC", f"{_RIGID},0.3"),
        *(section.format("EDISK", "BODY"), "1."),
        *(section.format("ERID", "RIDGES"), "1."),
    ]


def _contact(disk: PressedDisk, calculix: bool, penalty: float) -> list[str]:
    lines = ["*SURFACE INTERACTION,NAME=SI"]
    if calculix:
        lines += ["*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR", f"{penalty:.10g}"]
    else:
        lines += ["*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=HARD,AUGMENTED LAGRANGE"]
    if disk.friction:
        stick = f",{10 * penalty:.10g}" if calculix else ""
        lines += ["*FRICTION", f"{disk.friction:.10g}{stick}"]
    lines += ["*CONTACT PAIR,INTERACTION=SI,TYPE=SURFACE TO SURFACE", "BODY,RIDGES"]
    return lines


def _level(level: float, *, first: bool, calculix: bool) -> list[str]:
    lines = ["*STEP,NLGEOM,INC=60" if calculix else "*STEP,NLGEOM=YES,INC=200"]
    if first and calculix:
        # The first forces are small beside those that the default tolerances have in mind.
        lines += ["*CONTROLS,PARAMETERS=FIELD", "0.001,0.002"]
    lines += ["*STATIC", _STEP, "*BOUNDARY", f"{REACTION},2,2,{-level:.12g}"]
    totals, force, moved = ("ONLY", "RF", "U") if calculix else ("YES,SUMMARY=NO", "RF2", "U1,U2")
    lines += [f"*NODE PRINT,NSET={REACTION},TOTALS={totals},FREQUENCY=1000", force]
    return [*lines, f"*NODE PRINT,NSET={SURFACE},FREQUENCY=1000", moved, "*END STEP"]


def _rows(numbers: Iterable[int]) -> list[str]:
    """Return numbers in lines of twelve."""
    some = [str(int(number)) for number in numbers]
    return [",".join(some[i : i + 12]) + "," for i in range(0, len(some), 12)]
