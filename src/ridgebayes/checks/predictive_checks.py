"""Predictive checks: test quantities of observed rows and of rows replicated by the model.

Residuals are log loads minus the curve of the form. The quantities detect common failures: an
outlier, a drift with the count, textures or steps that deviate as a whole, and correlated
neighbours along a curve.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy import sparse

from ridgebayes._types import FloatArray, IntArray, Rng
from ridgebayes.errors import InputError
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.model import Model
from ridgebayes.model.observations import Observations
from ridgebayes.model.replicated import form_log_loads, prior_draws, simulate_log_loads
from ridgebayes.predict.load_draws import MAX_DRAWS_TIMES_ROWS
from ridgebayes.runtime.randomness import seed_of, stream

QUANTITIES = {
    "largest residual": "largest absolute residual",
    "trend": "slope of residuals over $\\log h$",
    "texture spread": "sd of the textures' mean residuals",
    "step spread": "sd of the steps' mean residuals",
    "lag-1 correlation": "correlation of neighbours along $Q$",
}
CHECK_COLUMNS = ["quantity", "observed", "lower", "upper", "prob", "p_value", "two_sided"]
BAND_COLUMNS = ["texture", "a_over_R", "b_over_R", "Q", "lower", "median", "upper", "prob"]
_MIN_DRAWS = 200  # with any number of rows


@dataclass(frozen=True, eq=False)
class PredictiveChecks:
    """Test quantities of observed and replicated rows, draw by draw.

    Parameters
    ----------
    names : tuple of str
        Names of the quantities, keys of `QUANTITIES`.
    observed, replicated : ndarray of float, shape (n_draw, n_quantity)
        Values at each posterior draw. The observed values vary because residuals depend on it.
    """

    names: tuple[str, ...]
    observed: FloatArray
    replicated: FloatArray

    @property
    def p_values(self) -> dict[str, float]:
        """Probability that a replicated quantity exceeds the observed one; ties count half."""
        above = (self.replicated > self.observed) + 0.5 * (self.replicated == self.observed)
        return dict(zip(self.names, above.mean(axis=0).tolist(), strict=True))

    def table(self, prob: float = 0.9) -> pd.DataFrame:
        """Return the checks as a table.

        Parameters
        ----------
        prob : float, optional
            Probability of the equal-tailed interval of replicated quantities.

        Returns
        -------
        pandas.DataFrame
            Columns quantity, observed (mean over the draws), lower, upper (of the replicates),
            prob, p_value, two_sided: twice the smaller of p_value and its complement.
        """
        ends = np.quantile(self.replicated, [0.5 - prob / 2, 0.5 + prob / 2], axis=0)
        p = np.array(list(self.p_values.values()))
        of_rows = (self.observed.mean(axis=0), *ends, prob, p, 2 * np.minimum(p, 1 - p))
        return pd.DataFrame(dict(zip(CHECK_COLUMNS, (self.names, *of_rows), strict=True)))


def posterior_checks(fit: Posterior, *, rng: Rng = 0, n_draw: int = 2_000) -> PredictiveChecks:
    """Compare the rows with rows replicated from the posterior predictive distribution.

    Parameters
    ----------
    fit : Posterior
        Posterior.
    rng : int or numpy.random.Generator, optional
        Seed.
    n_draw : int, optional
        Number of posterior draws, with a replicate for each; at most the number kept by the fit.
        Above 8,000 rows it is reduced so that draws times rows is 17 million.

    Returns
    -------
    PredictiveChecks
        Quantities that the rows allow: a spread needs two textures or steps, a correlation needs
        neighbours along Q.

    Raises
    ------
    InputError
        If no row is exact.

    Notes
    -----
    A replicate draws new shared offsets from their prior. The check thus asks whether deviations
    within textures or steps have the size given by the error model. The rows are used for the fit
    and the check, so p-values concentrate near one half, and values near 0 or 1 are strong signs.

    References
    ----------
    Gelman, Meng & Stern (1996), Statistica Sinica 6, 733-807.
    """
    model = fit.model
    exact = model.data.is_exact
    if not exact.any():
        raise InputError("fit: no row gives its load exactly; expected at least one")
    seed = seed_of(rng)
    # The draws are spread evenly over the chains.
    n = min(n_draw, len(fit.draws), max(MAX_DRAWS_TIMES_ROWS // len(model.data), _MIN_DRAWS))
    places = np.linspace(0, len(fit.draws) - 1, n).astype(int)
    theta, rows = fit.draws[places], model.data.take(exact)
    curve = form_log_loads(model, theta)[:, exact]
    loads = simulate_log_loads(model, theta, stream(seed, "replicate"))[0][:, exact]
    observed, replicated = (_quantities(rows, y - curve) for y in (rows.log_load, loads))
    stacked = (np.stack([*values.values()], axis=-1) for values in (observed, replicated))
    return PredictiveChecks(tuple(observed), *stacked)


def prior_bands(
    model: Model, *, rng: Rng = 0, n_draw: int = 4_000, prob: float = 0.9
) -> pd.DataFrame:
    """Return prior predictive bands of the log load at every texture and count of the rows.

    Parameters
    ----------
    model : Model
        Form, error model, priors and rows.
    rng : int or numpy.random.Generator, optional
        Seed.
    n_draw : int, optional
        Number of draws from the prior; reduced above 4,000 rows as in `posterior_checks`.
    prob : float, optional
        Probability of the equal-tailed interval.

    Returns
    -------
    pandas.DataFrame
        One row for each texture and count: columns texture (label), a_over_R, b_over_R, Q, lower,
        median, upper (of the log load), prob. The bands exclude known errors of rows.

    Raises
    ------
    ComputationError
        If almost no prior draw has positive rates.
    """
    data, seed = model.data, seed_of(rng)
    n = min(n_draw, max(MAX_DRAWS_TIMES_ROWS // len(data), _MIN_DRAWS))
    theta = prior_draws(model, stream(seed, "prior"), n)
    loads = simulate_log_loads(model, theta, stream(seed, "rows"))[0]
    ends = np.quantile(loads, [0.5 - prob / 2, 0.5, 0.5 + prob / 2], axis=0)
    labels = data.labels or tuple(f"a{a!r}_b{b!r}" for a, b in data.textures)
    cells, first = np.unique(np.stack([data.texture, data.Q]), axis=1, return_index=True)
    rows = []
    for texture, Q, i in zip(*cells, first, strict=True):
        if np.isfinite(ends[1, i]):
            where = [labels[texture], *data.textures[texture], int(Q)]
            rows.append([*where, *ends[:, i].tolist(), prob])
    return pd.DataFrame(rows, columns=BAND_COLUMNS)


def _quantities(data: Observations, residual: FloatArray) -> dict[str, FloatArray]:
    """Return the test quantities of residuals (n_draw, n_obs) of some rows."""
    values = {"largest residual": np.abs(residual).max(axis=-1)}
    x = np.log(data.Q / 2 - 1)
    x = x - x.mean()
    if np.ptp(x) > 0:
        values["trend"] = residual @ x / (x @ x)
    for name, code in (("texture spread", data.texture), ("step spread", data.Q)):
        means = _mean_matrix(code)
        if means.shape[0] > 1:
            values[name] = (means @ residual.T).std(axis=0, ddof=1)
    # Cells are sorted by texture and then by Q, so neighbours along Q are adjacent.
    cells, code = np.unique(np.stack([data.texture, data.Q]), axis=1, return_inverse=True)
    near = np.flatnonzero(np.diff(cells[0]) == 0)
    if len(near) > 1:
        cell = (_mean_matrix(code.reshape(-1)) @ residual.T).T
        cell = cell - cell.mean(axis=-1, keepdims=True)
        product = (cell[..., near] * cell[..., near + 1]).mean(axis=-1)
        values["lag-1 correlation"] = product / (cell**2).mean(axis=-1)
    return values


def _mean_matrix(code: IntArray) -> sparse.csr_array:
    """Return the matrix that averages rows by code, in sorted order of the codes."""
    _, group, n = np.unique(code, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    return sparse.csr_array((1 / n[group], (group, np.arange(len(group)))))
