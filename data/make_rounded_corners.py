"""Make data/fea/rounded_corners.csv: transition loads on round corners, to high loads.

``python data/make_rounded_corners.py`` (hours of one thread; rows are kept as they come, and a
texture that is there already is not computed again): full finite elements, corners of a tenth of a
ridge. A texture ends where no equilibrium is found, or after its minutes.
"""

import signal
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from ridgebayes._types import __version__
from ridgebayes.contact.cylinder.cylinder import Cylinder, Transition
from ridgebayes.contact.cylinder.newton import NotConvergedError
from ridgebayes.contact.rigid_profile import Profile

TABLE = Path("data/fea/rounded_corners.csv")
CORNER = 0.1
REL_SE = 1e-3  # of the mesh (docs/two-scale.md)
FINE = 24  # edges a ridge for Q = 4, when eight are off by up to 0.6 %: contact is few of them wide
MINUTES = 8
# Ridge and groove width, Poisson's ratio, offset in pitches, edges a ridge, highest load.
RUNS = [
    (0.08, 0.08, 0.5, 0.0, 8, 0.14),
    (0.08, 0.08, 0.45, 0.0, 8, 0.14),
    (0.08, 0.03, 0.5, 0.0, 8, 0.20),
    (0.08, 0.03, 0.3, 0.0, 8, 0.13),
    (0.08, 0.03, 0.45, 0.0, 8, 0.12),
    (0.1, 0.05, 0.5, 0.0, 8, 0.37),
    (0.05, 0.05, 0.5, 0.0, 8, 0.10),
    (0.05, 0.05, 0.3, 0.0, 8, 0.10),
    (0.1, 0.05, 0.3, 0.0, 8, 0.25),
    (0.1, 0.05, 0.45, 0.0, 8, 0.25),
    (0.12, 0.03, 0.5, 0.0, 8, 0.37),
    (0.03, 0.03, 0.5, 0.0, 8, 0.07),
    (0.02, 0.02, 0.5, 0.0, 8, 0.06),
    (0.02, 0.1, 0.5, 0.0, 8, 0.06),
    (0.04, 0.12, 0.5, 0.0, 8, 0.11),
    (0.022, 0.02, 0.5, 0.0, 8, 0.2),
    (0.03, 0.01, 0.5, 0.0, 24, 0.008),
]


class _TimeIsUpError(Exception):
    pass


def _stop(*_: object) -> None:
    raise _TimeIsUpError


def transitions(run: tuple[float, float, float, float, int, float]) -> Iterator[Transition]:
    """Yield the transitions of a texture, the first on a fine mesh."""
    a, b, nu, offset, edges, p_max = run
    profile = Profile(a, b, corner=CORNER * a, offset=offset)
    for one in Cylinder(profile, p_max=p_max, nu=nu, edges=edges).transitions(p_max):
        if one.Q == 4 and edges < FINE:
            top = 1.05 * one.p_over_E
            yield next(iter(Cylinder(profile, p_max=top, nu=nu, edges=FINE).transitions(top)))
        else:
            yield one


def _row(run: tuple[float, float, float, float, int, float], one: Transition) -> dict[str, object]:
    a, b, nu, offset, edges, _ = run
    return {
        "a_over_R": a,
        "b_over_R": b,
        "Q": one.Q,
        "p_over_E": one.p_over_E,
        "rel_se": REL_SE,
        "nu": nu,
        "offset_over_R": offset * (a + b),
        "corner_radius_over_R": CORNER * a,
        "edges": FINE if one.Q == 4 else edges,
        "solver": "cylinder-fe",
        "status": "ok",
        "source": f"ridgebayes {__version__} data/make_rounded_corners.py",
    }


def main() -> None:
    """Compute what is not there yet."""
    signal.signal(signal.SIGVTALRM, _stop)
    rows = pd.read_csv(TABLE).to_dict("records") if TABLE.exists() else []
    known = {(row["a_over_R"], row["b_over_R"], row["nu"], row["offset_over_R"]) for row in rows}
    for run in RUNS:
        a, b, nu, offset, *_ = run
        if (a, b, nu, offset * (a + b)) in known:
            continue
        signal.setitimer(signal.ITIMER_VIRTUAL, 60 * MINUTES)
        try:
            for one in transitions(run):
                rows.append(_row(run, one))
                pd.DataFrame(rows).to_csv(TABLE, index=False)
        except (NotConvergedError, _TimeIsUpError) as ended:
            print(run, repr(ended), flush=True)
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)


if __name__ == "__main__":
    main()
