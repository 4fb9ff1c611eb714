"""Least squares on Q, the calibration of the study, for comparison with the posterior.

Every closed form has Q' = Q'_0 + s * slope with the coefficients linear in the slope, so ordinary
least squares on Q has one minimum. It weights rows by their count and not by their relative load
error, so its coefficients differ from the posterior's.
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
        Name of the form.
    coefficients, standard_errors : dict of str to float
        Values by parameter. The errors assume independent residuals, and are NaN if there are only
        as many rows as coefficients.
    r_squared : float
        R^2 on Q.
    n_row : int
        Number of rows.
    """

    form: str
    coefficients: dict[str, float]
    standard_errors: dict[str, float]
    r_squared: float
    n_row: int


def fit_by_least_squares(form: Form, table: ContactTable) -> LeastSquares:
    """Fit a form's coefficients to the calibration rows of a table by least squares on Q.

    The coefficients minimise sum_i (Q'(p_i; theta) - Q_i)^2.

    Parameters
    ----------
    form : Form
        Form with published coefficients as initial values; the power law has none.
    table : ContactTable
        Table whose transitions of role calibration and status ok are used.

    Returns
    -------
    LeastSquares
        Coefficients with standard errors.

    Raises
    ------
    InputError
        If the form has no published coefficients, or there are fewer rows than coefficients.
    ComputationError
        If the search reaches coefficients for which the rate of a texture is not positive.

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026, section 3.2: calibration of the coefficients.

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

    # Scaled by the published values, c1 and c2 are of similar size instead of a factor 85 apart.
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
    """Return 1 - (residual sum of squares)/(total sum of squares); NaN for constant values.

    Examples
    --------
    >>> r_squared(np.array([1.0, 3.0]), np.array([1.0, 2.0]))
    0.5
    """
    total = float(np.sum((observed - observed.mean()) ** 2))
    return 1 - float(np.sum((observed - predicted) ** 2)) / total if total > 0 else float("nan")
