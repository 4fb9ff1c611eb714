"""Abaqus's printed tables, written from numbers of another program.

No file made here comes from Abaqus: each says so in its title. The layout is Abaqus's, so that
readers of the real one can be tried where Abaqus is not.
"""

import math

import numpy as np

TITLE = "not from Abaqus: numbers of another program, in its layout"


def pressed(*, a=0.05, b=0.03, R=1.0, E=1.0, full=False, n_level=34, depth=0.034, n_node=241):
    """A rim moved in closed form, whose transition loads are known.

    A cylinder sinks by d, stretches sideways by 1 + 0.4 d and stays above ridges' tops, at a load
    p/E = 0.3 d + 12 d^2. Lengths in the unit of R; a, b and depth over R.

    Returns a dict: ``nodes`` (n, 2) of the rim, ``position`` (level, n, 2), ``force`` (level) in
    the unit of E R, of the half or the full body, ``top``, ``corners`` (distance from the axis),
    ``Q`` and ``load``, the transitions up to the last level.
    """
    half = np.linspace(0.0, 1.0, n_node) * 0.9
    angle = np.concatenate([-half[:0:-1], half]) if full else half
    nodes = R * np.column_stack([np.sin(angle), -np.cos(angle)])
    top = -R * math.sqrt(1 - (b / 2) ** 2)
    d = depth * np.arange(1, n_level + 1) / n_level
    corners = R * (b / 2 + (a + b) * np.arange(6))
    position = np.stack([_sunk(nodes, one, R, top, corners, a * R) for one in d])
    force = _load(d) * 2 * R * E * (1.0 if full else 0.5)
    reached = [_depth_at(one / R, top / R) for one in corners[1:]]
    known = [k for k, one in enumerate(reached) if one <= depth]
    return {
        "a": a,
        "b": b,
        "R": R,
        "E": E,
        "nodes": nodes,
        "position": position,
        "force": force,
        "top": top,
        "corners": corners,
        "Q": [4 + 2 * k for k in known],
        "load": [float(_load(reached[k])) for k in known],
    }


def _load(d):
    return 0.3 * d + 12 * d**2


def _sunk(nodes, d, R, top, corners, a):
    x = nodes[:, 0] * (1 + 0.4 * d)
    y = nodes[:, 1] - d * R
    away = np.abs(x)[:, None]
    over = ((corners - 1e-12 * R <= away) & (away <= corners + a)).any(axis=1)
    return np.column_stack([x, np.where(over, np.maximum(y, top), y)])


def _depth_at(corner, top):
    """The d at which -sqrt(1 - (corner / (1 + 0.4 d))^2) - d = top, by bisection."""
    low, high = 0.0, 0.2
    for _ in range(80):
        d = 0.5 * (low + high)
        above = -math.sqrt(1 - (corner / (1 + 0.4 * d)) ** 2) - d > top
        low, high = (d, high) if above else (low, d)
    return 0.5 * (low + high)


def deck_text(run, *, depth=0.06, elements=True):
    """An input deck: rim, a driven node above, ridges of one element each, sets RIM and TOP."""
    n = len(run["nodes"])
    lines = ["*NODE, NSET=BODY"]
    lines += [f"{k},{x:.12g},{y:.12g},0." for k, (x, y) in enumerate(run["nodes"], start=1)]
    lines += [f"{n + 1},0.,{0.5 * run['R']:.12g},0."]
    lines += ["*ELEMENT, TYPE=CPE3, ELSET=EBODY"]
    lines += [f"{k},{k},{k + 1},{n + 1}" for k in range(1, n)]
    lines += ["*NODE, NSET=RIDGES"]
    low, high, quads = run["top"] - depth * run["R"], run["top"], []
    for k, far in enumerate(run["corners"]):
        for sign in (1, -1) if (run["nodes"][:, 0] < 0).any() else (1,):
            first = n + 2 + 4 * (2 * k + (sign < 0))
            out = far + run["a"] * run["R"]
            for i, (x, y) in enumerate(((far, low), (out, low), (out, high), (far, high))):
                lines.append(f"{first + i},{sign * x:.12g},{y:.12g},0.")
            quads.append(f"{n + first},{first},{first + 1},{first + 2},{first + 3}")
    lines += ["*ELEMENT, TYPE=CPE4, ELSET=ERIDGES", *quads] if elements else []
    lines += ["*NSET, NSET=RIM, GENERATE", f"1,{n},1", "*NSET, NSET=TOP", f"{n + 1},"]
    lines += ["*MATERIAL, NAME=RUBBER", "*HYPERELASTIC, NEO HOOKE", f"{run['E'] / 6:.12g},0."]
    return "\n".join(lines) + "\n"


def printed(value):
    """A number of a .dat: five digits with an exponent, four without."""
    if value == 0:
        return " 0.000    "
    if 0.1 <= abs(value) < 1e4:
        decimals = 3 - math.floor(math.log10(abs(value)))
        return f"{value:.{max(decimals, 0)}f}" + ("." if decimals <= 0 else "") + "    "
    return f"{value:.4E}"


def dat_text(force, nodes, position, *, surface="RIM", reaction="TOP", driven=None, total=False):
    """A .dat of one step: *NODE PRINT of U on one set and of RF on another, at each increment."""
    driven = driven or [len(nodes) + 1]
    n = len(force)
    out = ["1", "", "   Abaqus 2023", "", f" {TITLE}", "", "  STEP    1     INCREMENT     1"]
    out += ["                        S T E P       1     S T A T I C   A N A L Y S I S", "", ""]
    for k in range(n):
        out += [f"                                INCREMENT {k + 1:5d} SUMMARY", "", ""]
        out += [
            f" TIME INCREMENT COMPLETED {1 / n:10.3E},  FRACTION OF STEP COMPLETED {k / n:10.3E}"
        ]
        out += [f" STEP TIME COMPLETED {(k + 1) / n:10.3E},  TOTAL TIME COMPLETED {k / n:10.3E}"]
        out += ["", "", "                                       N O D E   O U T P U T", "", ""]
        moved = position[k] - nodes
        out += _table(surface, ("U1", "U2"), range(1, len(nodes) + 1), moved, total=False)
        shared = [(0.0, force[k] / len(driven))] * len(driven)
        out += _table(reaction, ("RF1", "RF2"), driven, shared, total=total)
    return "\n".join([*out, "", "          THE ANALYSIS HAS BEEN COMPLETED", ""])


def _table(name, columns, numbers, values, *, total):
    numbers, words = list(numbers), [[printed(v) for v in row] for row in values]
    out = [f"   THE FOLLOWING TABLE IS PRINTED FOR NODES BELONGING TO NODE SET {name}", ""]
    out += ["       NODE FOOT-   " + "".join(f"{one:<12}" for one in columns)]
    out += ["            NOTE", ""]
    values = np.array([[float(word) for word in row] for row in words])
    if not values.any():
        return [*out, "     ALL VALUES IN THIS TABLE ARE ZERO", "", ""]
    for number, row in zip(numbers, words, strict=True):
        if any(float(word) for word in row):
            out += [f" {number:10d}     " + " ".join(f"{word:>11}" for word in row)]
    for word, at in (("MAXIMUM", values.argmax(axis=0)), ("MINIMUM", values.argmin(axis=0))):
        picked = [words[i][j] for j, i in enumerate(at)]
        out += ["", f" {word:15}" + " ".join(f"{one:>11}" for one in picked)]
        out += [" AT NODE        " + " ".join(f"{numbers[i]:11d}" for i in at)]
    if total:
        out += ["", " TOTAL          " + " ".join(f"{printed(v):>11}" for v in values.sum(axis=0))]
    return [*out, "", ""]


def calculix_text(force, nodes, position, *, surface="RIM", reaction="TOP"):
    """A .dat of CalculiX: totals of forces and displacements, a time each."""
    out = []
    for k in range(len(force)):
        out += ["", f" total force (fx,fy,fz) for set {reaction} and time  {_fortran(k + 1.0)}", ""]
        out += [f"        {0.0:13.6E} {force[k]:13.6E} {0.0:13.6E}", ""]
        out += [f" displacements (vx,vy,vz) for set {surface} and time  {_fortran(k + 1.0)}", ""]
        for number, (x, y) in enumerate(position[k] - nodes, start=1):
            out += [f"{number:10d} {x:13.6E} {y:13.6E} {0.0:13.6E}"]
    return "\n".join([*out, ""])


def _fortran(value):
    """0.1000000E+01, as Fortran's E format has it."""
    power = math.floor(math.log10(value)) + 1
    return f"{value / 10.0**power:.7f}E{power:+03d}"
