"""Cost of a texture's transition loads: forms, half-plane, finite elements."""

from collections.abc import Callable
from functools import partial

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.checks.cost.measured import Setting, Way, settings, turned
from ridgebayes.contact import halfplane
from ridgebayes.contact.cylinder.cylinder import Cylinder, transition_curve
from ridgebayes.contact.cylinder.small_strain import small_strain_transitions
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.model.forms import Classic, Form, Hybrid, Modified
from ridgebayes.results import calibrate
from ridgebayes.table.table import ContactTable

_COEFFICIENTS = (3, 4, 6, 8, 12, 16)
_EDGES = (6, 9, 12)
_FINEST = 24
_MOST = 3  # transitions that finite elements compute: each takes seconds
_SMALL_STRAIN = "half-plane, 24 coefficients"


def load_settings(
    table: ContactTable, texture: tuple[float, float], p_max: float, *, elements: bool = True
) -> list[Setting]:
    """List ways to compute a texture's transition loads.

    Parameters
    ----------
    table : ContactTable
        To calibrate the forms on.
    texture : (float, float)
        a/R and b/R.
    p_max : float, scalar, dimensionless
        Highest load p/E.
    elements : bool, optional
        Whether finite elements run too: seconds, and the best reference there is.

    Returns
    -------
    list of Setting
        Errors are the largest relative ones over the transitions.
    """
    a, b = texture
    exact = _half_plane_loads(a, b, p_max)
    Q = 4 + 2 * np.arange(len(exact))
    best, reference = exact, _SMALL_STRAIN
    if elements:
        p_max = min(p_max, 1.02 * float(exact[min(_MOST, len(exact)) - 1]))
        best = _elements(a, b, p_max, _FINEST)
        reference = f"finite elements, finite strain, {_FINEST} edges a ridge"
        exact, Q = exact[: len(best)], Q[: len(best)]
    forms = (Classic(), Modified(), Hybrid())
    known: list[tuple[str, Form, FloatArray | None]]
    known = [("printed", form, None) for form in forms]
    known += [("calibrated", form, _coefficients(table, form)) for form in forms]
    ways: list[Way[FloatArray]] = [
        (f"{form.name} form", f"{where} coefficients", partial(form.load, Q, a, b, theta=theta))
        for where, form, theta in known
    ]
    ways.append(("half-plane", "tolerance 1e-8", partial(_half_plane, a, b, len(best))))
    for strain, loads in (("finite", _elements), ("small", _linear)) if elements else ():
        method = f"finite elements, {strain} strain"
        ways += turned(method, "{} edges a ridge", partial(loads, a, b, p_max), _EDGES)
    strips = partial(_strips, a, b, len(exact))
    small = turned("half-plane", "{} coefficients a strip", strips, _COEFFICIENTS)
    return [
        *settings("loads", reference, _off(best), ways),
        *settings("small-strain loads", _SMALL_STRAIN, _off(exact), small),
        *_many_settings(a, b),
    ]


def _off(best: FloatArray) -> Callable[[FloatArray], dict[str, float]]:
    def errors(found: FloatArray) -> dict[str, float]:
        if len(found) != len(best):
            raise ValueError(f"{len(found)} of {len(best)} transitions")
        return {"largest relative error": float(np.abs(found / best - 1).max())}

    return errors


def _half_plane_loads(a: float, b: float, p_max: float) -> FloatArray:
    n = 8
    while (loads := _strips(a, b, n, 24))[-1] <= p_max:
        n *= 2
    return loads[loads <= p_max]


def _strips(a: float, b: float, n: int, coefficients: int) -> FloatArray:
    return halfplane.solve_strips(2 * b / a, n, coefficients).F * (a + b) ** 2 / 0.75


def _many_settings(a: float, b: float) -> list[Setting]:
    """List ways to the 100th transition."""
    exact = halfplane.transition_loads(a, b, 100).F[-1:]

    def last(coefficients: int) -> FloatArray:
        return halfplane.solve_strips(2 * b / a, 100, coefficients).F[-1:]

    ways = turned("half-plane", "{} coefficients a strip", last, (3, 4, 8))
    return settings("100th transition", "half-plane, tolerance 1e-8", _off(exact), ways)


def _half_plane(a: float, b: float, n: int) -> FloatArray:
    halfplane.forget_loads()
    return halfplane.transition_loads(a, b, n).p_over_E(a + b, nu=0.5)


def _linear(a: float, b: float, p_max: float, edges: float) -> FloatArray:
    return small_strain_transitions(a, b, p_max=p_max, edges=edges)[1]


def _elements(a: float, b: float, p_max: float, edges: float) -> FloatArray:
    body = Cylinder(Profile(a, b), p_max=p_max, edges=edges)
    _, loads, _ = transition_curve(body, p_max)
    return loads[np.isfinite(loads)]


def _coefficients(table: ContactTable, form: Form) -> FloatArray:
    """Return the posterior means of a form's coefficients."""
    mean = calibrate(table, form, noise="iid", rng=0).summary.set_index("parameter")["mean"]
    return mean.loc[list(form.parameter_names)].to_numpy(dtype=float)
