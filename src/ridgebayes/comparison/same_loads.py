"""Test whether two forms can reach the same loads at all fitted rows.

The rows cannot distinguish between such forms.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Form
from ridgebayes.model.rows import Rows

_LOG_LOAD_TOL = 1e-7  # log loads closer than this are equal; the half-plane solver has 1e-8
_N_POINT = 3  # sets of coefficients tried for each form, about a prior sd apart
_MAX_TEXTURES = 200  # with more textures and coefficients, only a selection is compared


def same_loads(first: Posterior, other: Posterior) -> bool:
    """Return whether each of two forms can reach all loads of the other at the fitted rows.

    The loads of one form at three distant sets of coefficients are fitted by the other form, by
    least squares of log loads. Only the rows' textures and counts matter, not their loads.

    Parameters
    ----------
    first, other : Posterior
        Posteriors of two forms given the same rows.

    Returns
    -------
    bool
        False also if a form has no finite loads at the coefficients tried.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), ["modified", "hybrid"], noise="iid", accuracy="quick")
    >>> same_loads(cmp.fits["modified"], cmp.fits["hybrid"])  # textures of several a/pitch
    False
    """
    gap = _log_rate_gap(first.model.rows, other.model.rows, len(first.model.data.textures))
    if gap is None:
        return False
    n, n_coefficient = len(gap), max(first.model.n_coefficient, other.model.n_coefficient)
    if n_coefficient > _MAX_TEXTURES and n > _MAX_TEXTURES:
        chosen = np.linspace(0, n - 1, _MAX_TEXTURES).astype(np.int64)
    else:
        chosen = np.arange(n)
    one, two = _Reachable.of(first, chosen), _Reachable.of(other, chosen)
    shift = gap[chosen]
    return two.reaches_all(one.log_rates(one.points) + shift) and one.reaches_all(
        two.log_rates(two.points) - shift
    )


def _log_rate_gap(first: Rows, other: Rows, n_texture: int) -> FloatArray | None:
    """Return the gap of log rates at equal loads, (n_texture,); None if it varies in a texture.

    A load is (shape/rate)^2, and all rows of a texture have one rate.
    """
    texture = np.concatenate([first.texture, first.texture])
    with np.errstate(invalid="ignore"):
        gap = 0.5 * np.concatenate([first.upper - other.upper, first.lower - other.lower])
    has_load = np.isfinite(gap)
    texture, gap = texture[has_load], gap[has_load]
    low, high = np.full(n_texture, np.inf), np.full(n_texture, -np.inf)
    np.minimum.at(low, texture, gap)
    np.maximum.at(high, texture, gap)
    return 0.5 * (low + high) if np.all(high - low < 0.5 * _LOG_LOAD_TOL) else None


@dataclass(frozen=True, eq=False)
class _Reachable:
    """Rates that a form can reach at a selection of textures.

    Parameters
    ----------
    form : Form
        Contact form, bound to these textures.
    a, b : ndarray of float, shape (n,)
        Ridge and groove widths over R.
    points : ndarray of float, shape (n_point, n_coefficient)
        Sets of coefficients; the first is a posterior draw.
    """

    form: Form
    a: FloatArray
    b: FloatArray
    points: FloatArray

    @classmethod
    def of(cls, posterior: Posterior, chosen: IntArray) -> "_Reachable":
        """Return a posterior's form at the chosen textures, with coefficients of finite loads."""
        model, data = posterior.model, posterior.model.data
        textures = tuple(data.textures[j] for j in chosen)
        labels = tuple(data.labels[j] for j in chosen) if data.labels else ()
        form = model.form.bind(textures, labels)
        names = [model.parameter_names.index(name) for name in form.parameter_names]
        u = posterior.coordinates[len(posterior.coordinates) // 2, : model.n_parameter]
        a, b = data.a_over_R[chosen], data.b_over_R[chosen]
        at_draw = cls(form, a, b, model.to_theta(u)[None, names])
        points = [at_draw.points[0]]
        for k in range(1, _N_POINT):
            step = np.cos(k + np.arange(len(u)))  # differs between coefficients
            while np.abs(step).max() > _LOG_LOAD_TOL:  # halve the step until loads are finite
                theta = model.to_theta(u + step)[names]
                if np.isfinite(at_draw.log_rates(theta)).all():
                    points.append(theta)
                    break
                step = 0.5 * step
        return cls(form, a, b, np.array(points))

    def log_rates(self, theta: FloatArray) -> FloatArray:
        """Return log rates, shape (..., n); not finite where the form has no load."""
        with np.errstate(all="ignore"):
            return np.log(self.form.rate(theta, self.a, self.b))

    def reaches_all(self, log_rates: FloatArray) -> bool:
        """Return whether the form can reach each set of log rates, shape (n_point, n)."""
        start = self.log_rates(self.points[0])
        have_loads = np.isfinite(log_rates).all() and np.isfinite(start).all()
        return bool(have_loads) and all(map(self._reaches, log_rates))

    def _reaches(self, target: FloatArray) -> bool:
        """Return whether least squares finds coefficients that reach the log rates."""

        def residuals(theta: FloatArray) -> FloatArray:
            return self.log_rates(theta) - target

        def jacobian(theta: FloatArray) -> FloatArray:
            return self.form.log_rate_gradient(theta, self.a, self.b)

        rounding = dict.fromkeys(["ftol", "xtol", "gtol"], float(np.finfo(float).eps))
        nearest = least_squares(residuals, self.points[0], jacobian, x_scale="jac", **rounding)
        return bool(np.abs(nearest.fun).max() < 0.5 * _LOG_LOAD_TOL)
