"""Make `sliding.csv`: what holds a soft cylinder back that is moved sideways over ridges.

``python data/friction/make_sliding.py [JOB ...]`` computes rows that the file lacks, of all jobs
or of those with the given numbers: an hour or so on one processor. It can be stopped and started
again; a path with friction that was broken off begins anew. What did not converge is printed.

Without friction the difference of two rows' potentials is the mean net force between them. It has a
few per cent of the error of the nodes' forces, which changes its sign as nodes pass corners.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes import edge_forces
from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder.contact_problem import ContactProblem, State
from ridgebayes.contact.cylinder.faces import Faces, Resolution, first_height, ridge_faces
from ridgebayes.contact.cylinder.material import Material
from ridgebayes.contact.cylinder.mesh import disk_mesh
from ridgebayes.contact.cylinder.newton import Control, NotConvergedError, solve
from ridgebayes.contact.cylinder.solid import Solid
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.scene.scene import Scene, Texture

FILE = Path(__file__).parent / "sliding.csv"
TEXTURES = ((0.022, 0.03), (0.012, 0.03), (0.012, 0.09))
LOADS = (0.005, 0.015)
OFFSETS = tuple(((np.arange(12) + 0.5) / 24).tolist())  # pitches: half of one, the rest mirrors it
CORNER = 0.2  # radius, over the ridge's width
RUBBED = ((0.022, 0.03), 0.005, 0.3)  # texture, load, friction
COARSE = (0.012, 0.015)  # ridge width and load whose rows would take five times as long else
STEPS = 48  # rows a pitch with friction


@dataclass(frozen=True)
class Body:
    """A cylinder whose mid-plane is glued to a rigid backing, as finely meshed all along its path.

    Parameters
    ----------
    a, b : float, over R
        Ridge and groove width.
    arc : int
        Segments of a round corner: what the mesh is made for.
    p_max : float, over E
        Largest load.
    """

    a: float
    b: float
    arc: int
    p_max: float

    def __post_init__(self) -> None:
        reach = 1.2 * float(hertz.half_width(self.p_max, nu=0.5)) + self.a
        # 1.25 edges of the rim above each segment, as in `contact.cylinder.cylinder`.
        edge = CORNER * self.a * math.pi / 2 / self.arc / 1.25
        mesh = disk_mesh(lambda at: edge + 0.3 * np.maximum(at - reach, 0.0), both_sides=True)
        object.__setattr__(self, "edge", edge)
        object.__setattr__(self, "reach", reach + self.a + self.b)
        object.__setattr__(self, "solid", Solid(mesh, Material(0.5)))

    def on(self, offset: float, mu: float = 0.0) -> ContactProblem:
        """Put the body on ridges, so many pitches from a groove's centre."""
        profile = Profile(self.a, self.b, corner=CORNER * self.a, offset=offset)
        n = math.ceil(self.reach / profile.pitch)
        resolution = Resolution(self.edge, self.arc, 2.5 * self.edge, self.edge)
        faces = ridge_faces(profile, range(-n, n + 1), first_height(profile), resolution)
        held = np.zeros((self.solid.n_node, 2), dtype=bool)
        held[self.solid.mesh.mid_plane] = True
        return ContactProblem(self.solid, Faces(faces), held, friction=mu)


def pressed(problem: ContactProblem, state: State, line: float) -> State:
    """Raise the load to a line load, in eighths or what converges."""
    now, step = 0.0, line / 8
    while now < line:
        goal = min(now + step, line)
        try:
            state, n = solve(problem, state, Control("load", goal))
        except NotConvergedError:
            step /= 2
            if step < 1e-3 * line:
                raise
            continue
        now = goal
        step *= 1.5 if n < 7 else 1.0
    return state


def moved(problem: ContactProblem, state: State, line: float, to: float) -> State:
    """Move the backing sideways to x = `to` at constant load, half a corner's radius at most."""
    plane = problem.solid.mesh.mid_plane
    most = step = 0.5 * max(face.radius for face in problem.faces.faces)
    now = float(state.u[plane[0], 0])
    while to - now > 1e-12:
        goal = min(now + step, to)
        u = state.u.copy()
        u[plane, 0] = goal
        try:
            state, _ = solve(problem, replace(state, u=u), Control("load", line))
        except NotConvergedError:
            step = (goal - now) / 4
            if step < 1e-6:
                raise
            continue
        now, step = goal, min(2 * step, most)
    return state


def potential(problem: ContactProblem, state: State, load: float) -> float:
    """Return stored energy less the load's work, over the load; a neo-Hookean body of nu = 0.5.

    The work is that on the ridges from where their tops are at the disk's lowest point.
    """
    solid = problem.solid
    F = solid.gradients(state.u)
    J = np.linalg.det(F)
    square = np.einsum("...ij,...ij->...", F, F)
    stored = 0.5 * solid.material.mu * ((square + 1.0) * J ** (-2 / 3) - 3.0)
    risen = 1.0 + problem.faces.faces[0].origin[1] + state.rise
    return float((solid._weight * stored).sum() / load - risen)


def row(problem: ContactProblem, state: State) -> dict[str, float]:
    """Measure a state: lateral force on the body over the load, count, the pressure's centroid."""
    gaps = problem.gaps(state, state, np.zeros(len(problem.faces), dtype=bool))
    force = problem.force(state, gaps).reshape(-1, 2)
    load = force[:, 1].sum()
    x = (problem.solid.points + state.u)[:, 0] - state.u[problem.solid.mesh.mid_plane[0], 0]
    touched = state.pressure > 0
    ridges = {problem.faces.faces[i].ridge for i in problem.faces.face[touched]}
    return {
        "Q": len(ridges),
        "lateral_over_W": force[:, 0].sum() / load,
        "centroid_over_W": -(force[:, 1] @ x) / load,
    }


def half_plane(a: float, b: float, offset: float, p: float) -> float:
    """Return the half-plane's net lateral force over the load: that of the pressure's centroid."""
    offset = (offset + 0.5) % 1.0 - 0.5
    texture = Texture(a_over_R=a, b_over_R=b, corner_radius_over_R=CORNER * a, offset=offset)
    found = edge_forces(Scene(textures=(texture,)), [p])
    return float(found["lateral_force"].iloc[0]) / (2 * p)


def frictionless(job: "Job", offsets: list[float]) -> Iterator[dict[str, float]]:
    """Press the body at the first offset and move it on to the others."""
    if not offsets:
        return
    problem, line = Body(job.a, job.b, job.arc, job.p).on(offsets[0]), 2 * job.p
    try:
        state = pressed(problem, problem.unloaded(), line)
        for offset in offsets:
            state = moved(problem, state, line, (offset - offsets[0]) * (job.a + job.b))
            found = {"offset": offset, **row(problem, state)}
            yield found | {"potential_over_WR": potential(problem, state, line)}
    except NotConvergedError as failed:
        print(f"{job}: {failed}", flush=True)


def rubbed(job: "Job") -> Iterator[dict[str, float]]:
    """Press the body over a groove, with friction, and move it to the right by a pitch."""
    problem = Body(job.a, job.b, job.arc, job.p).on(1e-9, job.mu)  # at 0 it would be half a model
    try:
        state = pressed(problem, problem.unloaded(), 2 * job.p)
        yield {"offset": 0.0, **row(problem, state)}
        for i in range(1, STEPS + 1):
            state = moved(problem, state, 2 * job.p, i * (job.a + job.b) / STEPS)
            yield {"offset": i / STEPS, **row(problem, state)}
    except NotConvergedError as failed:
        print(f"{job}: {failed}", flush=True)


@dataclass(frozen=True)
class Job:
    """A texture, a load, a coefficient of friction and a mesh."""

    a: float
    b: float
    p: float
    mu: float = 0.0
    arc: int = 8

    def add(self) -> None:
        """Append the rows that the file lacks, each when it is there."""
        keys = {
            "a_over_R": self.a,
            "b_over_R": self.b,
            "corner_over_R": round(CORNER * self.a, 6),
            "p_over_E": self.p,
            "mu": self.mu,
            "corner_segments": self.arc,
        }
        rows = pd.read_csv(FILE) if FILE.exists() else pd.DataFrame(columns=[*keys, "offset"])
        done = rows[np.logical_and.reduce([rows[name] == value for name, value in keys.items()])]
        if self.mu and len(done):
            if done["offset"].max() > 0.999:
                return
            rows.drop(done.index).to_csv(FILE, index=False)
        lacking = [o for o in OFFSETS if not np.isclose(done["offset"].astype(float), o).any()]
        for one in rubbed(self) if self.mu else frictionless(self, lacking):
            net = half_plane(self.a, self.b, one["offset"], self.p)
            frame = pd.DataFrame([{**keys, **one, "half_plane_over_W": net}])
            frame = frame.round({name: 8 for name in frame if name != "potential_over_WR"})
            old = [pd.read_csv(FILE)] if FILE.exists() else []
            pd.concat([*old, frame]).to_csv(FILE, index=False)


if __name__ == "__main__":
    wanted = [Job(a, b, p, arc=4 if (a, p) == COARSE else 8) for p in LOADS for a, b in TEXTURES]
    wanted.append(Job(*TEXTURES[0], LOADS[0], arc=12))  # a finer mesh, for the error
    wanted.append(Job(*RUBBED[0], *RUBBED[1:], arc=4))
    which = sys.argv[1:] and [wanted[int(i)] for i in sys.argv[1:]]
    for job in which or wanted:
        job.add()
