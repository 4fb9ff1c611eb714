"""A pressed cylinder for other programs: XDMF files, and a table of its contact."""

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
    """Write states of what is meshed, at undeformed points, as nine-node quadrilaterals.

    Point data are the `nodal_fields`. Only the right half of a mirrored profile is meshed.

    Parameters
    ----------
    cylinder : Cylinder
        The body.
    states : sequence of State
        A time series, whose time is p/E.
    path : pathlib.Path
        Ends in ``.xdmf``; an existing file is replaced. Its numbers are in a file beside it, of
        the same name but ``.h5``: move both together. Each appears whole or not at all, the
        ``.h5`` first.

    Raises
    ------
    InputError
        If there is no state, or the folder does not exist.
    OutputError
        If a file cannot be written, such as on a full disk.
    """
    if not states:
        raise InputError(f"{path}: no state to write")
    import h5py
    from meshio.xdmf import TimeSeriesWriter

    solid = cylinder.problem.solid
    side, content = path.with_suffix(".h5"), io.BytesIO()  # a full disk ends HDF5 on a file
    with replacing(path) as partial, replacing(side) as numbers:
        writer = TimeSeriesWriter(partial)
        # Entered as a context it would open a file in the current folder, named as the partial one.
        writer.h5_filename, writer.h5_file = side.name, h5py.File(content, "w")
        with writer.h5_file:
            # VTK's order of nodes is scikit-fem's: corners, edges from each to the next, centre.
            writer.write_points_cells(_with_z(solid.points), [("quad9", solid.nodes)])
            for state in states:
                writer.write_data(cylinder.p_over_E(state), nodal_fields(cylinder, state))
            writer.__exit__()
        numbers.write_bytes(content.getvalue())  # a view would hold it open


def nodal_fields(cylinder: Cylinder, state: State) -> dict[str, FloatArray]:
    """Compute what `write_fields` writes.

    Parameters
    ----------
    cylinder : Cylinder
        The body.
    state : State
        State of the body.

    Returns
    -------
    dict of str to ndarray of float
        ``displacement``, shape (n_node, 3), over R; ``pressure``, shape (n_node,), over E: minus
        the mean of the three normal stresses, positive in compression; ``cauchy_stress``, shape
        (n_node, 9), over E, row by row; ``volume_ratio``, shape (n_node,): J. All but the first
        are bilinear fits in each element to its quadrature points, averaged where elements meet;
        near a sharp corner they depend on the mesh.
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
        The body.
    state : State
        State of the body.

    Returns
    -------
    pandas.DataFrame
        A row a segment: ``ridge``, its number, missing on floors; ``x``, ``y``,
        its middle, over R; ``length``, over R; ``normal_x``, ``normal_y``, towards the body;
        ``pressure``, on the body along that normal, and ``shear``, on it along (normal_y,
        -normal_x), over E. Mirrored profiles have the right half only.
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
    """Return averages at nodes of values at quadrature points, (n_element, n_point, ...)."""
    points, weights = solid.quadrature
    # Weighted least squares leave out what vanishes at two Gauss points a direction, where the
    # gradient of a quadratic is most accurate.
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
