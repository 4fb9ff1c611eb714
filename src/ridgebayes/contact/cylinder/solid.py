"""Forces and stiffness of a meshed body: quadratic displacements, linear pressure in each element.

Nine-node quadrilaterals have three pressures each (Q2/P-1). The pressures of an element are not
shared with other elements, so they are condensed into its displacements.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sparse
from skfem import Basis, ElementQuad2

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.cylinder.material import Material, cofactor, jacobian
from ridgebayes.contact.cylinder.mesh import DiskMesh

# Compressibility, times E, with which the constraint of an incompressible body is condensed. It
# enters only the Newton steps, whose error it determines.
_SOFTENING = 1e-5


@dataclass(frozen=True, eq=False)
class Assembled:
    """Forces of one state and its linearisation.

    Parameters
    ----------
    force : ndarray of float, shape (n_node, 2)
        Internal force on the nodes at the state's pressures.
    volume : ndarray of float, shape (n_element, 3)
        Residual of the pressures' equations.
    condensed : ndarray of float, shape (n_node, 2)
        Force of the condensed pressures; the linear step is force + condensed + stiffness du = 0.
    stiffness : scipy.sparse.csc_array, shape (2 n_node, 2 n_node)
        Stiffness of the displacements alone.
    """

    force: FloatArray
    volume: FloatArray
    condensed: FloatArray
    stiffness: sparse.csc_array
    _coupling: FloatArray
    _inverse: FloatArray

    def pressure_step(self, du: FloatArray, dofs: IntArray) -> FloatArray:
        """Return the step of the pressures for a step of the displacements."""
        change = self.volume + np.einsum("eqd,ed->eq", self._coupling, du.reshape(-1)[dofs])
        value: FloatArray = np.einsum("epq,eq->ep", self._inverse, change)
        return value


class InvertedError(Exception):
    """Raised if an element is turned inside out, because the step was too long."""


class Solid:
    """A meshed body of one material.

    Parameters
    ----------
    mesh : DiskMesh
        Mesh of the body.
    material : Material
        Material of the body.
    """

    def __init__(self, mesh: DiskMesh, material: Material) -> None:
        self.mesh, self.material = mesh, material
        basis = Basis(mesh.mesh, ElementQuad2(), intorder=5)
        self.nodes: IntArray = basis.element_dofs.T.astype(np.int64)  # (element, 9)
        # (element, point, node, direction)
        self._grad = np.stack([basis.basis[i][0].grad for i in range(9)]).transpose(2, 3, 0, 1)
        self._grad = np.ascontiguousarray(self._grad)
        # The same gradients as one matrix for each element: node, and point with direction.
        self._flat = self._grad.transpose(0, 2, 1, 3).reshape(len(self.nodes), 9, -1)
        self._weight, self.quadrature = np.asarray(basis.dx), (basis.X, basis.W)
        at = np.asarray(basis.global_coordinates())  # (2, element, point)
        centre = np.average(at, axis=2, weights=np.broadcast_to(self._weight, at.shape))
        extent = np.sqrt(self._weight.sum(axis=1))
        local = (at - centre[..., None]) / extent[:, None]
        # Pressure modes: constant and linear in space, (element, point, 3).
        self._linear = np.stack([np.ones_like(local[0]), *local], axis=-1)
        self.points = mesh.points
        self.n_node, self.n_element = len(self.points), len(self.nodes)
        self.dofs = np.stack([2 * self.nodes, 2 * self.nodes + 1], axis=-1).reshape(-1, 18)
        self._mass = np.einsum("eg,egp,egq->epq", self._weight, self._linear, self._linear)

    @cached_property
    def _pattern(self) -> tuple[IntArray, IntArray, IntArray]:
        """Positions of the element matrices' entries in the assembled sparse matrix."""
        rows = np.repeat(self.dofs, 18, axis=1).ravel()
        columns = np.tile(self.dofs, (1, 18)).ravel()
        n = 2 * self.n_node
        key, place = np.unique(columns * n + rows, return_inverse=True)
        pointers = np.searchsorted(key // n, np.arange(n + 1))
        return place, key % n, pointers

    def gradients(self, u: FloatArray) -> FloatArray:
        """Return F = 1 + grad u at the quadrature points, shape (n_element, n_point, 2, 2)."""
        flat = u[self.nodes].transpose(0, 2, 1) @ self._flat
        value: FloatArray = np.eye(2) + flat.reshape(self.n_element, 2, -1, 2).transpose(0, 2, 1, 3)
        return value

    def pressures(self, p: FloatArray) -> FloatArray:
        """Return the pressure field at the quadrature points, shape (n_element, n_point)."""
        value: FloatArray = np.einsum("egp,ep->eg", self._linear, p)
        return value

    def no_pressure(self) -> FloatArray:
        """Return the pressures of the unloaded body, shape (n_element, 3)."""
        return np.zeros((self.n_element, 3))

    def force(self, u: FloatArray, p: FloatArray) -> FloatArray:
        """Return the internal force on the nodes, shape (n_node, 2)."""
        stress = self.material.stress(self.gradients(u), self.pressures(p))
        return self._nodal_force(stress)

    def _volume(self, F: FloatArray, pressure: FloatArray) -> FloatArray:
        """Return the residual of J - 1 - p/K = 0, shape (n_element, 3)."""
        change = self._weight * (jacobian(F) - 1.0 - self.material.compressibility * pressure)
        value: FloatArray = (change[:, None] @ self._linear)[:, 0]
        return value

    def assemble(self, u: FloatArray, p: FloatArray) -> Assembled:
        """Linearise the body's equations at a state.

        Parameters
        ----------
        u : ndarray of float, shape (n_node, 2), over R
            Displacements.
        p : ndarray of float, shape (n_element, 3), over E
            Pressures, tension positive.

        Returns
        -------
        Assembled
            Forces, residuals and the stiffness of the displacements.

        Raises
        ------
        InvertedError
            If the volume is not positive everywhere.
        """
        F, pressure = self.gradients(u), self.pressures(p)
        material, n = self.material, self.n_element
        if not jacobian(F).min() > 0:
            raise InvertedError("an element is turned inside out")
        stress = material.stress(F, pressure)
        tangent = material.stiffness(F, pressure) * self._weight[..., None, None, None, None]
        n_point = self._weight.shape[1]
        # K[n i, m k] = sum over g, j, l of grad[n j] A[i j k l] grad[m l]
        by_j = tangent.transpose(0, 1, 3, 2, 4, 5).reshape(n, n_point, 8, 2)
        half = by_j @ self._grad.transpose(0, 1, 3, 2)
        K = self._flat @ half.reshape(n, 2 * n_point, 36)
        K = K.reshape(n, 9, 2, 2, 9).transpose(0, 1, 2, 4, 3).reshape(n, 18, 18)
        pull = (self._grad @ cofactor(F).transpose(0, 1, 3, 2)).reshape(n, n_point, 18)
        weighted = (self._linear * self._weight[..., None]).transpose(0, 2, 1)
        coupling = weighted @ pull  # (e, 3, 18)
        inverse = np.linalg.inv(max(material.compressibility, _SOFTENING) * self._mass)
        volume = self._volume(F, pressure)
        transposed = coupling.transpose(0, 2, 1) @ inverse
        K += transposed @ coupling
        condensed = (transposed @ volume[:, :, None]).reshape(n, 9, 2)
        force, condensed = self._nodal_force(stress), self._scattered(condensed)
        return Assembled(force, volume, condensed, self._summed(K), coupling, inverse)

    def _nodal_force(self, stress: FloatArray) -> FloatArray:
        weighted = (self._weight[..., None, None] * stress).transpose(0, 1, 3, 2)
        return self._scattered(self._flat @ weighted.reshape(self.n_element, -1, 2))

    def _scattered(self, forces: FloatArray) -> FloatArray:
        flat = np.bincount(self.dofs.ravel(), forces.reshape(-1), 2 * self.n_node)
        return np.asarray(flat, dtype=np.float64).reshape(-1, 2)

    def _summed(self, matrices: FloatArray) -> sparse.csc_array:
        place, rows, pointers = self._pattern
        values = np.bincount(place, matrices.ravel(), len(rows))
        n = 2 * self.n_node
        return sparse.csc_array((values, rows, pointers), shape=(n, n))
