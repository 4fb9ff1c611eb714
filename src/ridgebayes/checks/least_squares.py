"""Least squares on Q, the calibration of the study, to stand beside the posterior.

Every closed form has Q' = Q'_0 + s * slope with the coefficients linear in the slope, so ordinary
least squares on Q has one minimum. It weighs a row by its count, not by its relative load error,
which is why its coefficients differ from the posterior's.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.forms import Form
from ridgebayes.table.table import ContactTable


@dataclass(frozen=True)
class LeastSquares:
    """Coefficients of a form by least squares on Q.

    Parameters
    ----------
    form : str
        Name.
    coefficients, standard_errors : dict of str to float
        By parameter; errors as if the residuals were independent, NaN without spare rows.
    r_squared : float
        R^2 on Q.
    n_row : int
        Rows.
    """

    form: str
    coefficients: dict[str, float]
    standard_errors: dict[str, float]
    r_squared: float
    n_row: int


def fit_by_least_squares(form: Form, table: ContactTable) -> LeastSquares:
    """Fit a form's coefficients to the calibration rows of a table by least squares on Q.

    min over theta of sum_i (Q'(p_i; theta) - Q_i)^2.

    Parameters
    ----------
    form : Form
        With published coefficients to start from: not the power law.
    table : ContactTable
        Transitions of role calibration and status ok are used.

    Returns
    -------
    LeastSquares
        Coefficients with standard errors.

    Raises
    ------
    InputError
        If the form has no published coefficients, or there are fewer rows than coefficients.
    ComputationError
        If the rows lead to coefficients at which the rate of a texture is not positive.

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026, section 3.2: how its coefficients were found.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> found = fit_by_least_squares(rb.Hybrid(), rb.paper_sweep())
    >>> {name: round(value, 4) for name, value in found.coefficients.items()}
    {'c1': 1.3486, 'c2': 0.018}
    """
    frame = table.calibration.frame
    frame = frame[frame["kind"] == "transition"]
    start = form.published
    if start is None or len(frame) < len(start):
        raise InputError(
            f"{form.name}: expected a form with published coefficients and at least as many rows "
            f"as coefficients, got {len(frame)} rows"
        )
    p, a, b, nu = (frame[c].to_numpy() for c in ("p_over_E", "a_over_R", "b_over_R", "nu"))
    q = frame["Q"].to_numpy(float)

    def residual(scaled: FloatArray) -> FloatArray:
        value: FloatArray = form.continuous_count(p, a, b, scaled * start, nu) - q
        if not np.isfinite(value).all():
            raise ComputationError(
                f"{form.name}: least squares on Q failed: the rate of a texture was not positive"
            )
        return value

    # In units of the published coefficients c1 and c2 differ by little, not by a factor of 85.
    solution = least_squares(residual, np.ones(len(start)), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    theta = solution.x * start
    spare = len(q) - len(start)
    errors = np.full(len(start), np.nan)
    jacobian = np.asarray(solution.jac, dtype=float)
    if spare > 0 and np.linalg.matrix_rank(jacobian) == len(start):
        covariance = np.linalg.inv(jacobian.T @ jacobian) * 2 * solution.cost / spare
        errors = np.sqrt(np.diag(covariance)) * np.abs(start)
    names = form.parameter_names
    return LeastSquares(
        form.name,
        dict(zip(names, theta.tolist(), strict=True)),
        dict(zip(names, errors.tolist(), strict=True)),
        r_squared(q, q + residual(solution.x)),
        len(q),
    )


def r_squared(observed: FloatArray, predicted: FloatArray) -> float:
    """Return 1 - (residual sum of squares)/(total sum of squares); NaN where nothing varies.

    Examples
    --------
    >>> r_squared(np.array([1.0, 3.0]), np.array([1.0, 2.0]))
    0.5
    """
    total = float(np.sum((observed - observed.mean()) ** 2))
    return 1 - float(np.sum((observed - predicted) ** 2)) / total if total > 0 else float("nan")
