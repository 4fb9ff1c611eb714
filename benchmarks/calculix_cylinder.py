"""Check the finite-element cylinder with CalculiX: ``python benchmarks/calculix_cylinder.py``.

An independent solution, by a solver that shares nothing with the package but its mesh: a
neo-Hookean quarter disk (radius 1, E = 1, plane strain) whose flat mid-plane is driven down onto
frictionless rigid ridges with sharp corners. It prints the loads at which the rim meets the next
ridge, and the CPU seconds and memory they cost, beside those of the package's own finite elements
and of its half-plane, with errors against the reference rows where these have the texture.
Needs `ccx`, the solver of CalculiX 2.20 or later, on the path.

What is compared: p is the line load over 2R, so p/E is the reaction of the quarter's mid-plane. A
ridge counts as reached when the rim meets the inner upper corner of it.

The contact is a penalty, so that the body is inside the ridges by w = pressure / stiffness. By
reciprocity the rim at the next corner is lower for that, at the same load, by the mean of w
weighted with the pressure that a unit force at that corner would cause: nearly all of it on the
outermost ridge that carries, and most at its corners, where w is large too. The gap is therefore
taken as that of the rim plus `OVERLAP` times the plain mean of w on that ridge. The factor is
measured: it is about what makes loads with stiffnesses of 2e4 and 1e5 E/R agree, at the first two
transitions of (0.022, 0.02) with elements of 4e-4 R at corners. Elements of 1.7e-3 R there raise
loads by 1 % at the first transition and 0.4 % at the fourth, so a soft contact and large elements
may look right together.

The gap is extrapolated to zero from the last two levels before touching, which lie close: a first
run with large elements tells where the transitions are. Levels are many because the contact
converges only in small ones, and each is a step of its own.
"""

import argparse
import math
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes.contact.cylinder.cylinder import Cylinder, transition_curve
from ridgebayes.contact.cylinder.mesh import disk_mesh
from ridgebayes.contact.halfplane import forget_loads, transition_loads
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.fea.deck_text import DEPTH, PressedDisk, deck_text
from ridgebayes.table.datafiles import CALCULIX_FE, data_path

OVERLAP = 1.6  # see above; 1.5 to 1.9 at the first two transitions of (0.022, 0.02)
LEVELS = (0.12, 0.24, 0.36, 0.48, 0.6, 0.72, 0.84, 0.93, 0.98)  # between transitions
MEMORY = 4 * 2**30  # bytes for the solver: where it diverges it may want all there are


@dataclass(frozen=True)
class Setup:
    """A texture on which a cylinder is pressed, and how it is computed; lengths over R.

    Parameters
    ----------
    a, b : float
        Ridge and groove widths.
    nu : float
        Poisson's ratio.
    edge, corner : float
        Length of the rim's elements under the ridges, and beside their corners.
    reach : float
        Angle to which the rim is fine.
    penalty : float
        Stiffness of the contact, pressure over overlap, over E/R.
    n_ridge : int
        Ridges in the half x >= 0.
    """

    a: float
    b: float
    nu: float
    edge: float
    corner: float
    reach: float
    penalty: float
    n_ridge: int

    @property
    def inner(self) -> np.ndarray:
        """Inner corners of the ridges."""
        return self.b / 2 + (self.a + self.b) * np.arange(self.n_ridge)

    @property
    def height(self) -> float:
        """Height of the ridges' tops: the undeformed disk touches the first corner."""
        return -math.sqrt(1.0 - (self.b / 2) ** 2)

    def size(self, theta: np.ndarray) -> np.ndarray:
        """Return the wanted length of the rim's elements at angles from the lowest point."""
        places = np.concatenate([self.inner, self.inner + self.a])
        corners = np.arcsin(places[places < 1.0])
        # Points of the rim that meet a corner slide as the load grows: hence the widths.
        apart = np.abs(theta[:, None] - corners) - (0.5 * self.corner + 0.005 * corners)
        near = self.corner + 0.3 * np.maximum(apart.min(axis=1), 0.0)
        return np.minimum(near, self.edge) + 0.3 * np.maximum(theta - self.reach, 0.0)


@dataclass
class Run:
    """What a run of the solver gave and cost."""

    nodes: int
    elements: int
    load: list[float] = field(default_factory=list)  # p/E of each level
    rim: list[np.ndarray] = field(default_factory=list)  # positions of the rim's nodes, (n, 2)
    cpu: float = 0.0
    wall: float = 0.0
    memory: float = 0.0  # MiB
    ended: str = ""


def find_solver() -> str | None:
    """Return the path of CalculiX's solver."""
    return shutil.which("ccx") or shutil.which("ccx_2.20")


def hertz_load(half_width: float, nu: float) -> float:
    """Return p/E of a smooth cylinder in contact over a half-width."""
    return math.pi * half_width**2 / (8.0 * (1.0 - nu**2))


def approach(p: float, nu: float) -> float:
    """Estimate how far the mid-plane comes down at p/E."""
    half_width = math.sqrt(8.0 * p * (1.0 - nu**2) / math.pi)
    return 2.0 * p * (1.0 - nu**2) / math.pi * (2.0 * math.log(4.0 / half_width) - 1.0)


def solve_contact(setup: Setup, levels: Iterable[float]) -> PressedDisk:
    """Return what the solver's input holds: the mesh, the ridges, and how far to press."""
    top, bottom = setup.height, setup.height - DEPTH
    blocks = tuple(
        np.array([[x, bottom], [x + setup.a, bottom], [x + setup.a, top], [x, top]])
        for x in setup.inner
    )
    return PressedDisk(disk_mesh(setup.size), blocks, setup.nu, 0.0, np.array(list(levels)))


def read_results(path: Path, undeformed: np.ndarray) -> tuple[list[float], list[np.ndarray]]:
    """Read loads p/E and positions of the rim's nodes, of all levels that are complete."""
    loads: list[float] = []
    rims: list[np.ndarray] = []
    moved: list[tuple[float, float]] | None = None
    force = False
    for line in path.read_text(encoding="ascii").splitlines():
        words = line.split()
        if not words:
            continue
        if line.startswith(" total force"):
            force, moved = True, None
        elif line.startswith(" displacements"):
            moved = []
        elif force:
            loads.append(-float(words[1]))
            force = False
        elif moved is not None:
            moved.append((float(words[1]), float(words[2])))
            if len(moved) == len(undeformed):
                rims.append(undeformed + np.array(moved))
    return loads[: len(rims)], rims


def solve(setup: Setup, levels: Iterable[float], *, limit: float = 600.0) -> Run:
    """Run the solver with one thread in a temporary folder.

    Parameters
    ----------
    setup : Setup
        What is computed.
    levels : iterable of float
        Displacements of the mid-plane.
    limit : float, s
        Wall time after which the solver is stopped; the levels it has done count.
    """
    solver = find_solver()
    if solver is None:
        raise FileNotFoundError("no `ccx` on the path")
    levels = list(levels)
    disk = solve_contact(setup, levels)
    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "cylinder.inp"
        deck.write_text(deck_text(disk, "calculix", penalty=setup.penalty), encoding="ascii")
        run = Run(int(disk.numbers.max()), len(disk.cells))
        start = time.perf_counter()
        with (Path(folder) / "log").open("wb") as log:
            process = subprocess.Popen(
                [solver, "-i", "cylinder"],
                cwd=folder,
                env={**os.environ, "OMP_NUM_THREADS": "1"},
                stdout=log,
                stderr=subprocess.STDOUT,
                preexec_fn=_limit_memory,
            )
            pid = 0
            while pid == 0:
                pid, status, used = os.wait4(process.pid, os.WNOHANG)
                if pid == 0 and time.perf_counter() - start > limit:
                    process.kill()
                    pid, status, used = os.wait4(process.pid, 0)
                elif pid == 0:
                    time.sleep(0.1)
        process.returncode = os.waitstatus_to_exitcode(status)
        run.wall = time.perf_counter() - start
        run.cpu = used.ru_utime + used.ru_stime
        # ru_maxrss is in bytes on macOS and in KiB elsewhere.
        run.memory = used.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
        results = deck.with_suffix(".dat")
        if results.exists():
            # The solver writes the set's nodes in the order they were given in.
            run.load, run.rim = read_results(results, disk.mesh.points[disk.rim])
        if len(run.load) < len(levels):
            why = f"stopped after {limit:.0f} s" if process.returncode < 0 else "did not converge"
            run.ended = f"{why}; {len(run.load)} of {len(levels)} levels"
    return run


def along(rim: np.ndarray) -> np.ndarray:
    """Return a polyline along the rim's quadratic edges, eight pieces an edge."""
    s = np.linspace(0.0, 1.0, 9)[:-1]
    shapes = np.stack([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)])
    nodes = np.stack([rim[:-2:2], rim[1:-1:2], rim[2::2]])
    return np.concatenate([np.einsum("ks,kni->nsi", shapes, nodes).reshape(-1, 2), rim[-1:]])


def gap_at(line: np.ndarray, x: float, height: float) -> float:
    """Return how high above the ridges' tops the rim's outermost crossing of x lies."""
    low = line[: np.argmax(line[:, 0]) + 1]
    i = int(np.flatnonzero(low[:, 0] < x)[-1])
    t = (x - low[i, 0]) / (low[i + 1, 0] - low[i, 0])
    return float(low[i, 1] + t * (low[i + 1, 1] - low[i, 1]) - height)


def overlap_on(line: np.ndarray, start: float, stop: float, height: float) -> float:
    """Return the mean overlap where the rim is inside the ridge between start and stop."""
    x, depth = line[:, 0], height - line[:, 1]
    on = (x > start) & (x < stop) & (depth > 0.0)
    return float(depth[on].mean()) if on.any() else 0.0


def _limit_memory() -> None:
    if sys.platform != "darwin":  # which knows no such limit
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def transitions(
    setup: Setup, values: Iterable[float], run: Run, *, correct: bool = True
) -> list[tuple[int, float]]:
    """Find where the rim meets corners.

    Parameters
    ----------
    setup : Setup
        What was computed.
    values : iterable of float
        One for each level, in terms of which to say it: loads, or displacements.
    run : Run
        The result.
    correct : bool
        Correct for the overlap.

    Returns
    -------
    list of (int, float)
        Number Q of ridges, both sides counted, that are touched afterwards, and the value there.
    """
    value = np.array(list(values))[: len(run.rim)]
    lines = [along(rim) for rim in run.rim]
    found = []
    for k in range(1, setup.n_ridge):
        gaps = np.array([gap_at(line, setup.inner[k], setup.height) for line in lines])
        if not (gaps <= 0.0).any():
            break
        overlap = np.zeros(len(lines))
        if correct:
            before = setup.inner[k - 1]
            overlap += OVERLAP * np.array(
                [overlap_on(line, before, before + setup.a, setup.height) for line in lines]
            )
        last = int(np.flatnonzero(gaps <= 0.0)[0]) - 1
        if last < 1:
            continue
        # Straight: there the contact ends at the corner of the ridge before, and does not grow.
        near, far = (gaps + overlap)[[last, last - 1]]
        step = value[last] - value[last - 1]
        found.append((2 * (k + 1), float(value[last] + step * near / (far - near))))
    return found


def make_setup(
    a: float,
    b: float,
    p_max: float,
    *,
    nu: float = 0.49,
    edge: float = 1.5e-3,
    corner: float = 4e-4,
    penalty: float = 1e5,
) -> Setup:
    """Choose how far the rim is fine, and how many ridges there are."""
    half_width = math.sqrt(8.0 * p_max * (1.0 - nu**2) / math.pi)
    reach = math.asin(min(half_width, 0.95)) + 0.5 * (a + b)
    n_ridge = max(2, math.ceil((half_width - b / 2) / (a + b)) + 2)
    return Setup(a, b, nu, edge, corner, reach, penalty, n_ridge)


def first_levels(setup: Setup, p_max: float, each: int) -> np.ndarray:
    """Return displacements to p_max, so many for each pitch of contact half-width."""
    widest = math.sqrt(8.0 * p_max * (1.0 - setup.nu**2) / math.pi)
    n = math.ceil(each * widest / (setup.a + setup.b))
    widths = np.linspace(0.0, widest, n + 1)[1:]
    return np.array([approach(hertz_load(w, setup.nu), setup.nu) for w in widths])


def refined_levels(at: list[float], each: Iterable[float] = LEVELS) -> np.ndarray:
    """Return displacements of which some lie just below each transition."""
    start, some = 0.0, []
    for stop in at:
        some += [start + part * (stop - start) for part in each]
        start = stop
    return np.array([*some, at[-1] + 0.02 * (at[-1] - (at[-2] if len(at) > 1 else 0.0))])


def locate(setup: Setup, p_max: float, *, each: int = 6, limit: float = 600.0) -> tuple[list, Run]:
    """Find roughly, with large elements, the displacements at which ridges are reached."""
    rough = Setup(
        **{
            **vars(setup),
            "edge": max(setup.edge, min(setup.a, setup.b) / 8),
            "corner": max(setup.corner, min(setup.a, setup.b) / 8),
            "penalty": min(setup.penalty, 2e4),
        }
    )
    levels = first_levels(rough, p_max, each)
    run = solve(rough, levels, limit=limit)
    return [d for _, d in transitions(rough, levels, run)], run


def calculix_transitions(
    a: float,
    b: float,
    p_max: float,
    *,
    limit: float = 600.0,
    report: Callable[[str], None] | None = None,
    **options: float | str,
) -> list[tuple[int, float]]:
    """Compute the loads at which the next ridge is reached.

    Parameters
    ----------
    a, b : float, over R
        Ridge and groove widths.
    p_max : float, over E
        Load to which to go, about.
    limit : float, s
        Wall time of each of the two runs.
    report : callable, optional
        Told what runs cost and how they ended.
    **options
        Of `make_setup`: nu, edge, corner, penalty.

    Returns
    -------
    list of (int, float)
        Q, the number of ridges touched from there on, and p/E.
    """
    setup = make_setup(a, b, p_max, **options)  # type: ignore[arg-type]
    tell = report or (lambda text: None)
    at, rough = locate(setup, p_max, limit=limit)
    tell(describe("rough", rough))
    if not at:
        return []
    levels = refined_levels(at)
    run = solve(setup, levels, limit=limit)
    tell(describe("fine", run))
    for Q, p in transitions(setup, run.load, run, correct=False):
        tell(f"  without correction: {Q:3d} {p:.6e}")
    return transitions(setup, run.load, run)


def describe(name: str, run: Run) -> str:
    """Return a line about a run."""
    last = f"p/E = {run.load[-1]:.5f}" if run.load else "no level"
    return (
        f"{name}: {run.elements} elements, {len(run.load)} levels to {last}, CPU {run.cpu:.1f} s, "
        f"wall {run.wall:.1f} s, {run.memory:.0f} MiB{'; ' * bool(run.ended)}{run.ended}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--a", type=float, default=0.022, help="ridge width over R")
    parser.add_argument("--b", type=float, default=0.02, help="groove width over R")
    parser.add_argument("--p-max", type=float, default=0.02, help="largest p/E")
    parser.add_argument("--nu", type=float, default=0.49)
    parser.add_argument("--edge", type=float, default=1.5e-3, help="elements under ridges, over R")
    parser.add_argument("--corner", type=float, default=4e-4, help="elements at corners, over R")
    parser.add_argument("--penalty", type=float, default=1e5, help="contact stiffness over E/R")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for each run")
    given = vars(parser.parse_args())
    if find_solver() is None:
        print("no `ccx` on the path: CalculiX is not installed, nothing to compare with")
        return
    before = _children_cpu()
    found = calculix_transitions(report=print, **given)
    theirs = _children_cpu() - before
    before = time.process_time()
    own = own_transitions(given["a"], given["b"], given["p_max"], given["nu"])
    ours = time.process_time() - before
    plane, quick = half_plane_transitions(given["a"], given["b"], given["p_max"], given["nu"])
    columns = {"CalculiX": dict(found), "cylinder here": own, "half-plane": plane}
    best = reference_rows(given["a"], given["b"], given["nu"])
    if not best:
        print("no reference rows of this texture: errors are against the cylinder here")
    print(f"{'Q':>3}" + "".join(f"{name:>15} {'error':>8}" for name in columns))
    for Q, p in sorted((best or own).items()):
        cells = [
            f"{loads[Q]:15.6e} {loads[Q] / p - 1:8.2%}" if Q in loads else " " * 24
            for loads in columns.values()
        ]
        print(f"{Q:3d}" + "".join(cells))
    print(
        f"CPU seconds: CalculiX {theirs:.1f}, cylinder here {ours:.1f} (ratio "
        f"{theirs / ours:.1f}), half-plane {quick:.6f} (ratio {theirs / quick:,.0f})"
    )
    print("CalculiX's are those of both its runs: the first tells the second where to look.")


def reference_rows(a: float, b: float, nu: float) -> dict[int, float]:
    """Return the loads by Q of the finest neo-Hookean rows of a texture, where there are any."""
    rows = pd.read_csv(data_path(CALCULIX_FE))
    rows = rows[(rows["a_over_R"] == a) & (rows["b_over_R"] == b) & (rows["nu"] == nu)]
    return dict(zip(rows["Q"].tolist(), rows["p_over_E"].tolist(), strict=True))


def half_plane_transitions(
    a: float, b: float, p_max: float, nu: float
) -> tuple[dict[int, float], float]:
    """Return the half-plane's loads by Q, and CPU seconds of one solution with nothing kept."""
    n = 1
    while half_plane_loads(a, b, nu, n)[-1] <= p_max:
        n += 1
    began = time.process_time()
    for _ in range(50):
        forget_loads()
        loads = half_plane_loads(a, b, nu, n)
    seconds = (time.process_time() - began) / 50
    return {2 * k + 4: p for k, p in enumerate(loads.tolist()) if p <= p_max}, seconds


def half_plane_loads(a: float, b: float, nu: float, n: int) -> np.ndarray:
    """Return p/E of the first n transitions."""
    return transition_loads(a, b, n).F * (a + b) ** 2 / (1 - nu**2)


def own_transitions(a: float, b: float, p_max: float, nu: float) -> dict[int, float]:
    """Return the loads by Q that the package's own finite elements find, on the default mesh."""
    body = Cylinder(Profile(a, b), p_max=p_max, nu=nu)
    Q, p_over_E, _ = transition_curve(body, p_max)
    ok = np.isfinite(p_over_E)
    return dict(zip(Q[ok].tolist(), p_over_E[ok].tolist(), strict=True))


def _children_cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    main()
