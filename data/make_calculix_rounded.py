"""Make data/fea/calculix_rounded.csv: transition loads on round corners by CalculiX, to p/E = 0.07.

``python data/make_calculix_rounded.py FOLDER`` (ccx 2.20 on the path; some three CPU minutes a
texture): the package's own decks at nu = 0.49, corners of a tenth of a ridge. Decks and output stay
in the folder; a run that is there already is not computed again. A texture ends where CalculiX
finds no equilibrium.
"""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import krogh_interpolate

from ridgebayes._types import FloatArray
from ridgebayes.fea.calculix import read_calculix
from ridgebayes.fea.deck import Run, read_deck
from ridgebayes.fea.deck_text import REACTION, SURFACE, deck_text, pressed_disk
from ridgebayes.fea.record import Given
from ridgebayes.fea.rim import Rim
from ridgebayes.scene.scene import Scene, Texture

TABLE = Path("data/fea/calculix_rounded.csv")
NU, CORNER = 0.49, 0.1
# Ridge and groove width, edges a ridge, contact stiffness over E/R, load of the deck's scene.
RUNS = [
    (0.08, 0.04, 12, 5e4, 0.075),
    (0.05, 0.05, 12, 1e5, 0.055),
]
# By reciprocity an overlap of the last ridge pressed counts as a gap that is larger by this factor
# (benchmarks/calculix_cylinder.py).
OVERLAP = 1.6
REL_SE, FIRST_REL_SE = 1e-3, 2e-3  # of the mesh, and at Q = 4
BEYOND = 0.01  # of the load: how far above the last level a transition may lie


def name_of(a: float, b: float, edges: float, penalty: float) -> str:
    """Return the name of a run's files."""
    return f"a{a:g}_b{b:g}_{edges:g}_{penalty:.0e}"


def solve(folder: Path, a: float, b: float, edges: float, penalty: float, p_max: float) -> None:
    """Write a deck and run it, as far as CalculiX gets."""
    name = name_of(a, b, edges, penalty)
    texture = Texture(a_over_R=a, b_over_R=b, corner_radius_over_R=CORNER * a)
    disk = pressed_disk(Scene(textures=(texture,), nu=NU, p_over_E=p_max), edges=edges)
    text = deck_text(disk, "calculix", penalty=penalty)
    (folder / f"{name}.inp").write_text(text, encoding="ascii")
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    with (folder / f"{name}.log").open("wb") as log:
        subprocess.run(["ccx", "-i", name], cwd=folder, env=environment, stdout=log, check=False)


def transitions(folder: Path, a: float, b: float, edges: float, penalty: float) -> pd.DataFrame:
    """Return the transitions of a run: Q, load, and what overlap and levels change of it.

    The load is the zero of a parabola of the gap through the last three levels before touching.
    """
    name, radius = name_of(a, b, edges, penalty), CORNER * a
    facts, deck = Given(surface=SURFACE, reaction=REACTION), read_deck(folder / f"{name}.inp")
    history = read_calculix(Run(a, b, NU, paths=[folder / f"{name}.dat"], facts=facts, deck=deck))
    assert history.at is not None
    assert history.undeformed is not None
    assert history.rigid is not None
    load, position = np.abs(history.load), history.at
    surface = Rim.of(history.undeformed, name, R=1.0, symmetry="half")
    far = b / 2 + (a + b) * np.arange(math.ceil(0.6 / (a + b)))
    top = float(history.rigid[:, 1].max())
    corners = np.column_stack([far, np.full(len(far), top)])
    gaps = np.array([surface.gaps(at, corners, radius) for at in position])
    rows = []
    for k in range(1, len(far)):
        after = int(np.append(np.flatnonzero(gaps[:, k] <= 0), len(load))[0])
        if after < 3:
            continue
        last = slice(after - 3, after)
        flat = corners[[k - 1]] + [radius, 0.0]
        overlap = np.array([surface.overlap(at, flat, a - 2 * radius) for at in position[last]])
        p, gap = load[last], gaps[last, k]
        found, plain, straight = (
            _zero(gap + OVERLAP * overlap, p),
            _zero(gap, p),
            _zero(gap[1:] + OVERLAP * overlap[1:], p[1:]),
        )
        if found > (1 + BEYOND) * load[-1]:
            break
        rows.append(
            {
                "Q": 2 * k + 2,
                "p_over_E": found,
                "by_overlap": found / plain - 1,
                "by_levels": found / straight - 1,
            }
        )
    return pd.DataFrame(rows, columns=["Q", "p_over_E", "by_overlap", "by_levels"])


def _zero(gap: FloatArray, load: FloatArray) -> float:
    """Return the load of no gap: as a polynomial of the gap through all points."""
    return float(krogh_interpolate(gap, load, 0.0))


def main() -> None:
    """Compute what is not there yet, and write the table."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    tables = []
    for a, b, edges, penalty, p_max in RUNS:
        if not (folder / f"{name_of(a, b, edges, penalty)}.dat").exists():
            solve(folder, a, b, edges, penalty, p_max)
        found = transitions(folder, a, b, edges, penalty)
        print(a, b, edges, penalty, found.to_string(index=False), sep="\n", flush=True)
        mesh = np.where(found["Q"] == 4, FIRST_REL_SE, REL_SE)
        # A fifth of the correction, and what another level would change: a fifth of a parabola.
        doubt = 0.2 * np.hypot(found["by_overlap"], found["by_levels"])
        rows = {
            "a_over_R": a,
            "b_over_R": b,
            "Q": found["Q"],
            "p_over_E": found["p_over_E"],
            "rel_se": np.hypot(mesh, doubt).round(6),
            "nu": NU,
            "offset_over_R": 0.0,
            "corner_radius_over_R": CORNER * a,
            "edges": edges,
            "solver": "calculix 2.20 neo-hooke",
            "status": "ok",
            "source": "data/make_calculix_rounded.py",
        }
        tables.append(pd.DataFrame(rows))
    pd.concat(tables).to_csv(TABLE, index=False, float_format="%.9g")


if __name__ == "__main__":
    main()
