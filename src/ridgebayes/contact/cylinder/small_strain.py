"""Transitions at small strain: one linear step from the undeformed body for each.

The body is linear and contact is imposed on the undeformed surface, as in half-plane theory: gaps
are vertical, above the undeformed rim. One Newton step therefore gives the pressures on segments
and the rise of the ridges at which the next corner touches.
"""

from dataclasses import replace

import numpy as np
import scipy.sparse as sparse

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.contact.cylinder.contact_problem import ContactProblem, State
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.faces import Corner, first_height, proximal_corner
from ridgebayes.contact.cylinder.newton import Control, NewtonStep
from ridgebayes.contact.cylinder.surface import cast
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.errors import ComputationError

_RAY_LENGTH = 2.0  # over R; rays from the ridges reach all of the rim


class _LinearProblem(ContactProblem):
    """Contact problem with vertical gaps that depend on vertical displacements only."""

    def corner_distance(self, state: State, corner: Corner) -> tuple[float, FloatArray]:
        """Return the vertical distance of a corner from the body, and its derivative."""
        point, up = np.array([corner.centre]), np.array([[0.0, 1.0]])
        hit = cast(self.rim(state), point, up, behind=np.zeros(1), ahead=_RAY_LENGTH)
        row = np.zeros(2 * self.solid.n_node)
        row[2 * self.solid.mesh.rim[hit.edge[0]] + 1] = hit.gradient[0, :, 1]
        return float(hit.gap[0]), row


def small_strain_transitions(
    a: float, b: float, *, nu: float = 0.5, p_max: float = 0.02, edges: float = 24.0
) -> tuple[IntArray, FloatArray]:
    """Compute transition loads of a centred cylinder at small strain, by finite elements.

    Parameters
    ----------
    a, b : float, over R
        Ridge and groove width.
    nu : float, scalar, dimensionless
        Poisson's ratio, 0 to 0.5.
    p_max : float, scalar, dimensionless
        Highest load p/E.
    edges : float, scalar, count
        Number of the rim's edges over a ridge's width.

    Returns
    -------
    Q : ndarray of int, shape (n,)
        Counts 4, 6, ...
    p_over_E : ndarray of float, shape (n,), dimensionless
        Loads, rising.

    Raises
    ------
    InputError
        See `Cylinder`.
    ComputationError
        If no consistent set of segments in contact is found.

    Notes
    -----
    *Validity.* Small strain. Loads differ from those of contact in the deformed configuration by
    0.5 % at p/E = 0.004, and by 3 % at 0.02.

    *Cost.* A few tenths of a second per transition.

    Examples
    --------
    >>> Q, loads = small_strain_transitions(0.032, 0.01, nu=0.49, p_max=0.002)
    >>> Q.tolist(), round(float(loads[0]), 6)
    ([4], 0.000966)
    """
    profile = Profile(a, b)
    body = Cylinder(profile, p_max=p_max, nu=nu, edges=edges).problem
    problem = _LinearProblem(body.solid, body.faces, body.held)
    start, height = problem.unloaded(), first_height(profile)
    inner = problem.solid.assemble(start.u, start.p)
    vertical = sparse.diags_array(problem.up)
    on, loads = np.zeros(len(problem.faces), dtype=bool), list[float]()
    while not loads or loads[-1] <= p_max:
        control = Control("corner", 0.0, proximal_corner(profile, len(loads) + 1, height))
        gaps = problem.gaps(start, start, control.left_out(problem.faces), ahead=_RAY_LENGTH)
        gaps = replace(gaps, normal=sparse.csr_array(gaps.normal @ vertical))
        step = NewtonStep(problem, control, start, gaps, inner, np.zeros(len(on)))
        pressed, on = step.solve(on | problem.faces.of_ridge(len(loads)))
        sunk = pressed.u.ravel() - pressed.rise * problem.up
        left = gaps.gap + gaps.normal @ sunk / problem.faces.length
        if (left[~on] < 0).any() or not pressed.pressure[on].min() > 0:
            raise ComputationError("small strain: no set of segments in contact fits")
        loads.append(float(pressed.pressure @ problem.faces.length))
    return 4 + 2 * np.arange(len(loads) - 1), np.array(loads[:-1])
