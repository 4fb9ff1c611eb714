"""Output of a pressed cylinder: XDMF files of its fields, and a table of its contact."""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from skfem import ElementQuad2

from ridgebayes._types import FloatArray
from ridgebayes.contact.cylinder.contact_problem import State
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.material import jacobian
from ridgebayes.contact.cylinder.solid import Solid
from ridgebayes.errors import InputError
from ridgebayes.runtime.atomic import replacing


def write_fields(cylinder: Cylinder, states: Sequence[State], path: Path) -> None:
    """Write states of the meshed part, at undeformed points, as nine-node quadrilaterals.

    Point data are the `nodal_fields`. Only the right half of a mirrored profile is meshed.

    Parameters
    ----------
    cylinder : Cylinder
        Body.
    states : sequence of State
        Time series, whose time is p/E.
    path : pathlib.Path
        Path ending in ``.xdmf``; an existing file is overwritten. The numbers are in a file of the
        same name with the suffix ``.h5``: move both together. Each file is written atomically, the
        ``.h5`` file first.

    Raises
    ------
    InputError
        If there is no state, or the folder does not exist.
    OutputError
        If a file cannot be written, for instance because the disk is full.
    """
    if not states:
        raise InputError(f"{path}: no state to write")
    import h5py
    from meshio.xdmf import TimeSeriesWriter

    solid = cylinder.problem.solid
    side, content = path.with_suffix(".h5"), io.BytesIO()  # in memory: a full disk ends HDF5
    with replacing(path) as partial, replacing(side) as numbers:
        writer = TimeSeriesWriter(partial)
        # As a context manager it would open a file in the current folder.
        writer.h5_filename, writer.h5_file = side.name, h5py.File(content, "w")
        with writer.h5_file:
            # VTK and scikit-fem order nodes alike: corners, consecutive edges, centre.
            writer.write_points_cells(_with_z(solid.points), [("quad9", solid.nodes)])
            for state in states:
                writer.write_data(cylinder.p_over_E(state), nodal_fields(cylinder, state))
            writer.__exit__()
        numbers.write_bytes(content.getvalue())  # a view would keep the buffer open


def nodal_fields(cylinder: Cylinder, state: State) -> dict[str, FloatArray]:
    """Compute the fields that `write_fields` writes.

    Parameters
    ----------
    cylinder : Cylinder
        Body.
    state : State
        State of the body.

    Returns
    -------
    dict of str to ndarray of float
        ``displacement``, shape (n_node, 3), over R; ``pressure``, shape (n_node,), over E: minus
        the mean normal stress, positive in compression; ``cauchy_stress``, shape (n_node, 9), over
        E, row by row; ``volume_ratio``, shape (n_node,): J. All except the displacement are
        bilinear fits to the quadrature points of each element, averaged at shared nodes. Near a
        sharp corner they depend on the mesh.
    """
    solid = cylinder.problem.solid
    F, mean = solid.gradients(state.u), solid.pressures(state.p)
    plane = solid.material.stress(F, mean)
    J = jacobian(F)
    plane = plane @ np.swapaxes(F, -1, -2) / J[..., None, None]
    stress = np.zeros((*mean.shape, 3, 3))
    stress[..., :2, :2] = plane
    stress[..., 2, 2] = 3.0 * mean - np.trace(plane, axis1=-2, axis2=-1)
    return {
        "displacement": _with_z(state.u),
        "pressure": _at_nodes(solid, -mean),
        "cauchy_stress": _at_nodes(solid, stress.reshape(*mean.shape, 9)),
        "volume_ratio": _at_nodes(solid, J),
    }


def surface_table(cylinder: Cylinder, state: State) -> pd.DataFrame:
    """Tabulate the segments of the rigid side that are in contact.

    Parameters
    ----------
    cylinder : Cylinder
        Body.
    state : State
        State of the body.

    Returns
    -------
    pandas.DataFrame
        One row for each segment: ``ridge``, its number, missing on floors; ``x``, ``y``, its
        middle, over R; ``length``, over R; ``normal_x``, ``normal_y``, towards the body;
        ``pressure`` on the body along this normal, and ``shear`` along (normal_y, -normal_x), over
        E. Mirrored profiles have only the right half.
    """
    faces, parts = cylinder.problem.faces, []
    for face in faces.faces:
        point, normal = face.at(0.5 * (face.breaks[1:] + face.breaks[:-1]))
        part = pd.DataFrame({"ridge": pd.array([face.ridge] * len(point), dtype="Int64")})
        part["x"], part["y"] = point[:, 0], point[:, 1] + state.rise
        part["normal_x"], part["normal_y"] = normal.T
        parts.append(part)
    table = pd.concat(parts, ignore_index=True)
    table.insert(3, "length", faces.length)
    table["pressure"], table["shear"] = state.pressure, state.shear
    return table[table["pressure"] > 0].reset_index(drop=True)


def _with_z(plane: FloatArray) -> FloatArray:
    return np.column_stack([plane, np.zeros(len(plane))])


def _at_nodes(solid: Solid, values: FloatArray) -> FloatArray:
    """Return nodal averages of values at quadrature points, shape (n_element, n_point, ...)."""
    points, weights = solid.quadrature
    # Weighted least squares ignore terms that vanish at the 2 x 2 Gauss points, where the gradient
    # of a quadratic is most accurate.
    root = np.sqrt(weights)
    fit = np.linalg.pinv(root[:, None] * _bilinear(points)) * root
    to_nodes = _bilinear(ElementQuad2.doflocs.T) @ fit
    of_element = np.tensordot(values, to_nodes, (1, 1))  # (n_element, ..., 9)
    total = np.zeros((solid.n_node, *values.shape[2:]))
    np.add.at(total, solid.nodes, np.moveaxis(of_element, -1, 1))
    count = np.bincount(solid.nodes.ravel(), minlength=solid.n_node)
    return np.asarray((total.T / count).T)


def _bilinear(at: FloatArray) -> FloatArray:
    return np.stack([np.ones_like(at[0]), at[0], at[1], at[0] * at[1]], axis=-1)
