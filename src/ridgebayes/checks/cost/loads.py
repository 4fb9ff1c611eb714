"""What transition loads of a texture cost: forms, half-plane, finite elements."""

from collections.abc import Callable
from functools import partial

import numpy as np

from ridgebayes._types import FloatArray
from ridgebayes.checks.cost.measured import Setting
from ridgebayes.contact import halfplane
from ridgebayes.contact.cylinder.cylinder import Cylinder, transition_curve
from ridgebayes.contact.homogenised import beyond
from ridgebayes.contact.rigid_profile import Profile
from ridgebayes.contact.strips import solve_strips
from ridgebayes.model.forms import Classic, Form, Hybrid, Modified
from ridgebayes.results import calibrate
from ridgebayes.table.table import ContactTable

_COEFFICIENTS = (3, 4, 6, 8, 12, 16)
_EDGES = (6, 9, 12)
_FINEST = 24
_MOST = 3  # transitions that finite elements compute: each takes seconds
_KNOWN = 8  # exact loads from which the law of many ridges goes on


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
    settings = []
    best, reference = exact, "half-plane, 24 coefficients"
    if elements:
        p_max = min(p_max, 1.02 * float(exact[min(_MOST, len(exact)) - 1]))
        best = _elements(a, b, p_max, _FINEST)
        reference = f"finite elements, finite strain, {_FINEST} edges a ridge"
        exact, Q = exact[: len(best)], Q[: len(best)]
    calibrated = [_calibrated(table, form) for form in (Classic(), Modified(), Hybrid())]
    for form, theta in [(form, None) for form, _ in calibrated] + calibrated:
        printed = "printed" if theta is None else "calibrated"
        settings.append(
            Setting(
                "loads",
                f"{form.name} form",
                f"{printed} coefficients",
                _against(best, partial(form.load, Q, a, b, theta=theta)),
                reference,
            )
        )
    for n in _COEFFICIENTS:
        settings.append(
            Setting(
                "small-strain loads",
                "half-plane",
                f"{n} coefficients a strip",
                _against(exact, partial(_strips, a, b, len(exact), n)),
                "half-plane, 24 coefficients",
            )
        )
    settings.append(
        Setting(
            "loads",
            "half-plane",
            "tolerance 1e-8",
            _against(best, partial(_half_plane, a, b, len(best))),
            reference,
        )
    )
    settings += _many(a, b)
    if elements:
        settings += [
            Setting(
                "loads",
                f"finite elements, {'finite' if finite else 'small'} strain",
                f"{edges} edges a ridge",
                _against(best, partial(_elements, a, b, p_max, edges, finite=finite)),
                reference,
            )
            for finite in (True, False)
            for edges in _EDGES
        ]
    return settings


def _against(best: FloatArray, compute: Callable[[], FloatArray]) -> Callable[[], dict[str, float]]:
    def error() -> dict[str, float]:
        found = compute()
        if len(found) != len(best):
            raise ValueError(f"{len(found)} of {len(best)} transitions")
        return {"largest relative error": float(np.abs(found / best - 1).max())}

    return error


def _half_plane_loads(a: float, b: float, p_max: float) -> FloatArray:
    n = 8
    while True:
        F = solve_strips(2 * b / a, n, 24).F
        loads = F * (a + b) ** 2 / 0.75
        if loads[-1] > p_max:
            return loads[loads <= p_max]
        n *= 2


def _strips(a: float, b: float, n: int, coefficients: int) -> FloatArray:
    return solve_strips(2 * b / a, n, coefficients).F * (a + b) ** 2 / 0.75


def _many(a: float, b: float) -> list[Setting]:
    """List ways to the 100th transition."""
    exact = halfplane.transition_loads(a, b, 100).F[-1:]

    def law(known: int) -> FloatArray:
        F = solve_strips(2 * b / a, known, 8).F
        return beyond(F, 2 * b / a, np.array([100]))[0]

    def last(coefficients: int) -> FloatArray:
        return solve_strips(2 * b / a, 100, coefficients).F[-1:]

    known = (4, _KNOWN, 16, 32)
    return [
        Setting(
            "100th transition",
            "law of many ridges",
            f"from {n} exact loads",
            _against(exact, partial(law, n)),
            "half-plane, tolerance 1e-8",
        )
        for n in known
    ] + [
        Setting(
            "100th transition",
            "half-plane",
            f"{n} coefficients a strip",
            _against(exact, partial(last, n)),
            "half-plane, tolerance 1e-8",
        )
        for n in (3, 4, 8)
    ]


def _half_plane(a: float, b: float, n: int) -> FloatArray:
    halfplane.forget_loads()
    return halfplane.transition_loads(a, b, n).p_over_E(a + b, nu=0.5)


def _elements(a: float, b: float, p_max: float, edges: float, *, finite: bool = True) -> FloatArray:
    body = Cylinder(Profile(a, b), p_max=p_max, finite=finite, edges=edges)
    _, loads, _ = transition_curve(body, p_max)
    return loads[np.isfinite(loads)]


def _calibrated(table: ContactTable, form: Form) -> tuple[Form, FloatArray]:
    fit = calibrate(table, form, rng=0)
    mean = fit.summary.set_index("parameter")["mean"]
    return form, mean.loc[list(form.parameter_names)].to_numpy(dtype=float)
