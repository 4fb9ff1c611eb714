"""Forces on the edges of ridges, and the lateral force on a body off centre.

At a sharp corner in full contact the pressure is singular like K/sqrt(2 pi r). Moving the edge
changes the energy per length by G = (1 - nu^2) K^2/(2 E). This is a force on the body, from the
ridge into the groove. The derivation is `docs/derivations/edges.md`.
"""

import math
from dataclasses import dataclass

import numpy as np

from ridgebayes._types import BoolArray, FloatArray, IntArray
from ridgebayes.contact.contact_solution import ContactSolution


@dataclass(frozen=True, eq=False)
class EdgeForces:
    """Forces at both ends of every contact, from left to right, including mirror images.

    Parameters
    ----------
    ridge : ndarray of int, shape (n_edge,)
        Number of the ridge; for a touched floor, number of the ridge to its left.
    is_floor : ndarray of bool, shape (n_edge,)
        Whether the contact is on a groove's floor.
    side : ndarray of int, shape (n_edge,)
        -1 for the left end, 1 for the right end.
    x : ndarray of float, shape (n_edge,)
        Position of the end of contact, from the body's axis, over R.
    K, G : ndarray of float, shape (n_edge,)
        Over E sqrt(R) and E R; 0 if the end is free or the corner round.
    lateral : float
        Net lateral force on the body per length, over E R.
    """

    ridge: IntArray
    is_floor: BoolArray
    side: IntArray
    x: FloatArray
    K: FloatArray
    G: FloatArray
    lateral: float


def edge_forces(solution: ContactSolution, nu: float) -> EdgeForces:
    """Return the forces on the edges of a body pressed on ridges.

    Parameters
    ----------
    solution : ContactSolution
        Solution to evaluate.
    nu : float
        Poisson's ratio.

    Returns
    -------
    EdgeForces
        The lateral force is -P x/R, with the line load P and the centroid x of the pressure. If
        all corners are sharp, it equals the sum of `side` times G.
    """
    profile, pressing, segments = solution.profile, solution.pressing, solution.segments
    intervals, series = pressing.intervals, pressing.coefficients
    half_width, modulus = intervals.half_width, 1 / (1 - nu**2)
    floor = np.array([segment.ridge is None for segment in segments], dtype=bool)
    corners = np.array([(segment.start, segment.stop) for segment in segments]).reshape(-1, 2)
    ends = np.stack([intervals.left, intervals.right], axis=1)
    strength = np.maximum(pressing.singular.T, 0.0)
    K = 0.5 * math.pi * modulus * strength * np.sqrt(math.pi / half_width)[:, None]
    K = np.where((ends == corners) & ((profile.corner == 0) | floor)[:, None], K, 0.0)
    number = np.array([profile.ridge_before(segment) for segment in segments], dtype=np.int64)
    side = np.tile(np.array([-1, 1], dtype=np.int64), (len(number), 1))
    lateral = 0.0
    if profile.mirrored:
        new, first = slice(int(intervals.straddles), None), int(abs(profile.offset) != 0.5)
        number = np.concatenate([number, (-first - number - floor)[new]])
        floor = np.concatenate([floor, floor[new]])
        ends, side = np.concatenate([ends, -ends[new]]), np.concatenate([side, -side[new]])
        K = np.concatenate([K, K[new]])
    else:
        moment = series[:, 0] @ intervals.centre + 0.5 * series[:, 1] @ half_width
        lateral = -0.5 * math.pi**2 * modulus * float(moment)
    order = np.argsort(ends, axis=None)
    K, row = K.ravel()[order], order // 2
    side, x = side.ravel()[order], ends.ravel()[order]
    return EdgeForces(number[row], floor[row], side, x, K, 0.5 * K**2 / modulus, lateral)
