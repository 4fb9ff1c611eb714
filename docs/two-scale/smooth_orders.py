"""Hold the smooth cylinder's contact width against a second element order: smooth_orders.csv.

``python docs/two-scale/smooth_orders.py`` (some two minutes of one thread). The package's elements
are quadratic, with linear pressures. Here each is also four bilinear ones on the same nodes, with
one pressure each.
"""

from itertools import product
from pathlib import Path
from unittest import mock

import numpy as np
import pandas as pd

from ridgebayes.contact import hertz
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.material import Material
from ridgebayes.contact.cylinder.mesh import DiskMesh
from ridgebayes.contact.cylinder.solid import Solid
from ridgebayes.contact.smooth import half_widths
from ridgebayes.contact.two_scale import width_ratio

TABLE = Path(__file__).with_suffix(".csv")
LOADS = {0.11: (0.05, 0.1), 0.52: (0.2, 0.3, 0.4, 0.5)}
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
        self._linear = np.broadcast_to(pressure, (self.n_element, 16, 4)).copy()
        self._mass = np.einsum("eg,egp,egq->epq", weight, self._linear, self._linear)

    def no_pressure(self) -> np.ndarray:
        """Return the pressures of the unloaded body, shape (n_element, 4)."""
        return np.zeros((self.n_element, 4))


def main() -> None:
    """Compute all; rows are kept as they come."""
    rows = []
    for nu, edges, (order, kind) in product((0.5,), (24.0, 48.0), ((2, Solid), (1, BilinearSolid))):
        for p_max, loads in LOADS.items():
            with mock.patch("ridgebayes.contact.cylinder.cylinder.Solid", kind):
                body = Cylinder(None, p_max=p_max, nu=nu, edges=edges)
            for p, width in zip(loads, half_widths(body, loads), strict=True):
                ratio = width / float(hertz.half_width(p, nu=nu))
                row = {"nu": nu, "edges": edges, "order": order, "p_over_E": p}
                row |= {"width_over_hertz": ratio}
                rows.append(row | {"off_table": ratio / float(width_ratio(p, nu)) - 1})
                pd.DataFrame(rows).round(6).to_csv(TABLE, index=False)


if __name__ == "__main__":
    main()
