"""Least squares on Q, the calibration of the study, for comparison with the posterior.

Every closed form has Q' = Q'_0 + s * slope with the coefficients linear in the slope, so ordinary
least squares on Q has one minimum. It weights rows by their count and not by their relative load
error, so its coefficients differ from the posterior's.
"""

import warnings

import numpy as np
import pandas as pd
from scipy.optimize import OptimizeWarning, curve_fit

from ridgebayes._types import FloatArray
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.model.forms import Form
from ridgebayes.table.table import ContactTable


def fit_by_least_squares(form: Form, table: ContactTable) -> pd.DataFrame:
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
    pandas.DataFrame
        Columns coefficients and standard_errors, one row for each parameter name. The errors assume
        independent residuals, and are NaN if there are only as many rows as coefficients.

    Raises
    ------
    InputError
        If the form has no published coefficients, or there are fewer rows than coefficients.
    ComputationError
        If the search reaches coefficients for which the rate of a texture is not positive, or the
        textures do not tell the coefficients apart.

    References
    ----------
    doi:10.1016/j.ijssolstr.2019.06.026, section 3.2: calibration of the coefficients.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> squares = fit_by_least_squares(rb.Hybrid(), rb.paper_sweep())
    >>> {name: round(value, 4) for name, value in squares.coefficients.items()}
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

    def count(_: object, *scaled: float) -> FloatArray:
        value: FloatArray = form.continuous_count(p, a, b, np.multiply(scaled, start), nu)
        if not np.isfinite(value).all():
            raise ComputationError(
                f"{form.name}: least squares on Q failed: the rate of a texture was not positive"
            )
        return value

    # Scaled by the published values, c1 and c2 are of similar size instead of a factor 85 apart.
    with warnings.catch_warnings(action="ignore", category=OptimizeWarning):  # no covariance
        scaled, covariance, found, *_ = curve_fit(
            count, None, q, np.ones(len(start)), full_output=True, xtol=1e-14, ftol=1e-14
        )
    # The Jacobian is by differences, so half its digits are noise; its triangle is in `fjac`.
    triangle = np.triu(found["fjac"].T[: len(start)])
    if np.linalg.cond(triangle) > np.finfo(float).eps ** -0.25:
        raise ComputationError(f"{form.name}: the textures do not tell the coefficients apart")
    errors = np.sqrt(np.diag(covariance)) * np.abs(start)
    errors[np.isinf(errors)] = np.nan
    columns = {"coefficients": scaled * start, "standard_errors": errors}
    return pd.DataFrame(columns, index=list(form.parameter_names))
