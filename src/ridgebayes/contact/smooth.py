"""Contact width of a smooth cylinder at finite strain, by finite elements."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ridgebayes._types import NEO_HOOKEAN, FloatArray, Ogden
from ridgebayes.contact.cylinder.cylinder import Cylinder
from ridgebayes.contact.cylinder.newton import NotConvergedError

# Share of a contact's segments that determine its end, and number of partly covered last segments.
_FITTED_SHARE, _SEGMENTS_SKIPPED = 0.4, 3
_LOADS = Path(__file__).with_name("stiffening_loads.csv")  # largest load of each mesh, and loads
# Few edges suffice for the ratio of two materials.
_EDGES = 16.0


def half_width(x: FloatArray, pressure: FloatArray) -> float:
    """Return the half-width at which pressure vanishes; its square is smooth in x^2 there.

    Parameters
    ----------
    x, pressure : ndarray of float, shape (n_segment,)
        Centres of segments from the axis outwards, over R, and their pressures, over E.
    """
    on = np.flatnonzero(pressure > 0)
    inside = on[int(len(on) * (1 - _FITTED_SHARE)) : -_SEGMENTS_SKIPPED]
    roots = np.roots(np.polyfit(x[inside] ** 2, pressure[inside] ** 2, 3))
    real = roots[np.abs(roots.imag) < 1e-9].real
    return float(np.sqrt(real[np.argmin(np.abs(real - x[on[-1]] ** 2))]))


def half_widths(body: Cylinder, loads: tuple[float, ...]) -> Iterator[float]:
    """Yield the contact half-width over R at rising loads p/E.

    Raises
    ------
    NotConvergedError
        If no equilibrium is found.
    """
    length, state = body.problem.faces.length, body.unloaded()
    x = np.cumsum(length) - 0.5 * length
    for p in loads:
        state = body.at_load(p, state)
        yield half_width(x, state.pressure)


def stiffening(nu: float, ogden: Ogden, order: int) -> tuple[FloatArray, float]:
    """Compare a material's contact half-width with a neo-Hookean body's on the same mesh.

    Parameters
    ----------
    nu : float, scalar, dimensionless
        Poisson's ratio.
    ogden : tuple of (float, float)
        See `Material`.
    order : int
        Order of the fitted polynomial in sqrt(p/E).

    Returns
    -------
    ndarray of float, shape (order + 1,)
        Coefficients of powers of sqrt(p/E), from 0, of the ratio minus 1.
    float
        Largest p/E with an equilibrium; 0 if there is none.

    Notes
    -----
    *Accuracy.* 2e-3 of the ratio, from the smoothed scatter of three meshes.

    *Cost.* About 15 CPU seconds.
    """
    p: list[float] = []
    ratio: list[float] = []
    meshes, loads_of_meshes = np.loadtxt(_LOADS, delimiter=",", skiprows=1, unpack=True)
    for p_max in np.unique(meshes).tolist():
        loads = tuple(loads_of_meshes[meshes == p_max].tolist())
        widths = (
            half_widths(Cylinder(None, p_max=p_max, nu=nu, edges=_EDGES, ogden=material), loads)
            for material in (ogden, NEO_HOOKEAN)
        )
        try:
            for load, width, soft in zip(loads, *widths, strict=True):
                p.append(load)
                ratio.append(width / soft)
        except NotConvergedError:
            break
    if len(p) < order:
        return np.zeros(order + 1), 0.0
    terms = np.sqrt(p)[:, None] ** np.arange(1, order + 1)
    coefficients = np.linalg.lstsq(terms, np.array(ratio) - 1.0, rcond=None)[0]
    return np.concatenate([[0.0], coefficients]), p[-1]
