"""Hold the smooth cylinder's contact width against a second element order: smooth_orders.csv.

``python docs/two-scale/smooth_orders.py`` (some five minutes of one thread). The package's elements
are quadratic, with linear pressures. Here each is also four bilinear ones on the same nodes, with
one pressure each. Each mesh is the one before with all elements cut in four.
"""

from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray
from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder import contact_problem, cylinder, surface
from ridgebayes.contact.cylinder.contact_problem import ContactProblem, State
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.material import Material
from ridgebayes.contact.cylinder.mesh import DiskMesh, _joined
from ridgebayes.contact.cylinder.solid import Solid
from ridgebayes.contact.smooth import half_width

TABLE = Path(__file__).with_suffix(".csv")
LOADS = {0.11: (0.05, 0.1), 0.52: (0.2, 0.3, 0.4, 0.5)}
COARSEST, N_MESH = 8.0, 3  # edges of the first mesh; number of meshes
BESIDE = 1.03, 1.15  # of the moment's half-width: where the gap beside the contact is fitted
# Nodes of the four, counter-clockwise.
FOUR = np.array([[0, 4, 8, 7], [4, 1, 5, 8], [8, 5, 2, 6], [7, 8, 6, 3]])


class BilinearSolid(Solid):
    """A body of bilinear elements, four on the nodes of each quadratic one."""

    def __init__(self, mesh: DiskMesh, material: Material) -> None:
        super().__init__(mesh, material)
        gauss = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)
        x, y = (one.ravel() for one in np.meshgrid(gauss, gauss))
        local = np.array([[y - 1, 1 - y, y, -y], [x - 1, -x, x, 1 - x]])  # (direction, node, point)
        grad = np.zeros((self.n_element, 16, 9, 2))
        weight, pressure = np.zeros((self.n_element, 16)), np.zeros((16, 4))
        for i, nodes in enumerate(FOUR):
            own = slice(4 * i, 4 * i + 4)
            corners = self.points[self.nodes[:, nodes]]  # (element, node, 2)
            jacobian = np.einsum("dnp,enk->epkd", local, corners)
            weight[:, own] = 0.25 * np.linalg.det(jacobian)
            slopes = np.einsum("dnp,epdk->epnk", local, np.linalg.inv(jacobian))
            grad[:, own, nodes] = slopes
            pressure[own, i] = 1.0
        self._grad, self._weight = grad, weight
        self._flat = grad.transpose(0, 2, 1, 3).reshape(self.n_element, 9, -1)
        self._linear = np.broadcast_to(pressure, (self.n_element, 16, 4)).copy()
        self._mass = np.einsum("eg,egp,egq->epq", weight, self._linear, self._linear)

    def no_pressure(self) -> FloatArray:
        """Return the pressures of the unloaded body, shape (n_element, 4)."""
        return np.zeros((self.n_element, 4))


class StraightRim(ContactProblem):
    """Contact of a rim of straight edges, two for each bent one: the sides of bilinear elements.

    Bent edges would give their middle nodes two thirds of an even pressure, bilinear elements take
    half there. The contact pressure makes up for that by a ripple that finer meshes keep.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        first, middle, last = self._rim.T
        pairs = [[first, first, middle], [middle, middle, last]]
        self._rim = np.array(pairs).transpose(2, 0, 1).reshape(-1, 3)

    def rim(self, state: State) -> FloatArray:
        """Return the deformed rim's edges as bent ones that happen to be straight."""
        found = super().rim(state)
        found[:, 1] = 0.5 * (found[:, 0] + found[:, 2])
        return found


def straight_shapes(s: FloatArray) -> FloatArray:
    """Return the shape functions of a straight edge's ends; its middle has none of its own."""
    return np.stack([1 - s, np.zeros_like(s), s], axis=-1)


def straight_slopes(s: FloatArray) -> FloatArray:
    """Return their derivatives by s."""
    return np.stack([-np.ones_like(s), np.zeros_like(s), np.ones_like(s)], axis=-1)


_BILINEAR = [(cylinder, "Solid", BilinearSolid)]
_STRAIGHT = [
    (cylinder, "ContactProblem", StraightRim),
    (contact_problem, "shapes", straight_shapes),
    (surface, "shapes", straight_shapes),
    (surface, "slopes", straight_slopes),
]
REPLACED: dict[str, list[tuple[Any, str, Any]]] = {
    "quadratic": [],
    "bilinear": _BILINEAR + _STRAIGHT,
    "bilinear, bent rim": _BILINEAR,
}


def refined(mesh: DiskMesh, times: int) -> DiskMesh:
    """Cut each element in four, and again; new nodes of the ring lie on circles."""
    for _ in range(times):
        nodes = mesh.mesh.dofs.element_dofs.T
        mesh = _joined(mesh.points[nodes][:, FOUR].reshape(-1, 4, 2))
    return mesh


def press(
    elements: str, nu: float, level: int, p_max: float, loads: tuple[float, ...]
) -> tuple[Cylinder, list[State]]:
    """Press a smooth cylinder by rising loads, on a mesh that was refined so many times."""
    coarse = Cylinder(None, p_max=p_max, nu=nu, edges=COARSEST).problem.solid.mesh
    mesh = refined(coarse, level)
    with ExitStack() as stack:
        for place, name, value in REPLACED[elements]:
            stack.enter_context(mock.patch.object(place, name, value))
        stack.enter_context(mock.patch.object(cylinder, "disk_mesh", return_value=mesh))
        body = Cylinder(None, p_max=p_max, nu=nu, edges=COARSEST * 2**level)
        states = [body.unloaded()]
        for p in loads:
            states.append(body.at_load(p, states[-1]))
    return body, states[1:]


def moment_width(breaks: FloatArray, pressure: FloatArray) -> float:
    """Return 2 sqrt(<x^2>), weighted by pressure: Hertz's profile has its half-width there."""
    second = pressure @ np.diff(breaks**3) / 3
    return float(2 * np.sqrt(second / (pressure @ np.diff(breaks))))


def gap_width(x: FloatArray, gap: FloatArray, near: float) -> float:
    """Return where the gap closes: its power of 2/3 is smooth there, and so is x^2 by it."""
    low, high = BESIDE
    beside = (x > low * near) & (x < high * near)
    found = np.polyfit(gap[beside] ** (2 / 3), x[beside] ** 2, 3)
    return float(np.sqrt(found[-1]))


def ripple(x: FloatArray, pressure: FloatArray, width: float) -> float:
    """Return how far pressure is from smooth under the inner half of the contact, over itself."""
    inner = x < 0.5 * width
    smooth = np.polyval(np.polyfit(x[inner] ** 2, pressure[inner], 2), x[inner] ** 2)
    return float(np.abs(pressure[inner] / smooth - 1).max())


def measured(body: Cylinder, state: State, hertz_width: float) -> dict[str, float]:
    """Measure one contact in three ways, over Hertz's half-width."""
    mesh, breaks = body.problem.solid.mesh, body.problem.faces.faces[0].breaks
    middles = 0.5 * (breaks[1:] + breaks[:-1])
    with np.errstate(invalid="ignore"):  # pressures that ripple may have no root
        root = half_width(middles, state.pressure)
    moment = moment_width(breaks, state.pressure)
    rim = np.append(mesh.rim[:, :2], mesh.rim[-1, 2])
    x, y = (mesh.points + state.u)[rim].T
    gap = gap_width(x, y + 1.0 - state.rise, moment)
    widths = {"root": root, "moment": moment, "gap": gap}
    over = {f"{name}_over_hertz": width / hertz_width for name, width in widths.items()}
    return over | {"ripple": ripple(middles, state.pressure, moment)}


def rows_of(elements: str, nu: float, level: int) -> list[dict[str, float | str]]:
    """Return the rows of one mesh."""
    rows: list[dict[str, float | str]] = []
    for p_max, loads in LOADS.items():
        body, states = press(elements, nu, level, p_max, loads)
        for p, state in zip(loads, states, strict=True):
            row = {"nu": nu, "elements": elements, "edges": COARSEST * 2**level, "p_over_E": p}
            rows.append(row | measured(body, state, float(hertz.half_width(p, nu=nu))))
    return rows


def main() -> None:
    """Compute all; rows are kept as they come."""
    rows = []
    for nu, kinds in ((0.5, tuple(REPLACED)), (0.49, ("quadratic", "bilinear"))):
        for elements in kinds:
            for level in range(N_MESH):
                rows += rows_of(elements, nu, level)
                pd.DataFrame(rows).round(6).to_csv(TABLE, index=False)


if __name__ == "__main__":
    main()
