"""Whether two forms can reach the same loads at all fitted rows: then no row tells them apart."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ridgebayes._types import FloatArray, IntArray
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.forms import Form
from ridgebayes.model.rows import Rows

_CLOSE = 1e-7  # of log loads that are the same: those of the half-plane are computed to 1e-8
_N_POINT, _SHIFT = 3, 0.5  # coefficients tried of each form; prior sds between them
_MANY = 200  # coefficients beyond which not all textures are looked at, but so many


def same_loads(first: Posterior, other: Posterior) -> bool:
    """Return whether each of two forms can reach all loads that the other can, at the fitted rows.

    Three sets of coefficients of each, far apart, are looked for in the other: by least squares of
    log loads. Only the rows' textures and counts matter, not their loads.

    Parameters
    ----------
    first, other : Posterior
        Posteriors of two forms, given the same rows.

    Returns
    -------
    bool
        False also where a form has no load at coefficients that are tried.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> found = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], noise="iid", rng=1)
    >>> same_loads(found.fits["modified"], found.fits["hybrid"])  # textures of several a/pitch
    False
    """
    apart = _apart(first.model.rows, other.model.rows, len(first.model.data.textures))
    if apart is None:
        return False
    n = len(apart)
    if max(first.model.n_coefficient, other.model.n_coefficient) > _MANY and n > _MANY:
        chosen = np.linspace(0, n - 1, _MANY).astype(np.int64)
    else:
        chosen = np.arange(n)
    near, far = _Reachable.of(first, chosen), _Reachable.of(other, chosen)
    shift = apart[chosen]
    return far.holds(near.log_rates(near.points) + shift) and near.holds(
        far.log_rates(far.points) - shift
    )


def _apart(first: Rows, other: Rows, n_texture: int) -> FloatArray | None:
    """Return the gap of log rates at equal loads, (n_texture,); None if it varies in a texture.

    A load is (shape/rate)^2, and the rate is one of all rows of a texture.
    """
    texture = np.concatenate([first.texture, first.texture])
    with np.errstate(invalid="ignore"):
        apart = 0.5 * np.concatenate([first.upper - other.upper, first.lower - other.lower])
    has_load = np.isfinite(apart)
    texture, apart = texture[has_load], apart[has_load]
    low, high = np.full(n_texture, np.inf), np.full(n_texture, -np.inf)
    np.minimum.at(low, texture, apart)
    np.maximum.at(high, texture, apart)
    return 0.5 * (low + high) if np.all(high - low < 0.5 * _CLOSE) else None


@dataclass(frozen=True, eq=False)
class _Reachable:
    """The rates that a form reaches at some textures.

    Parameters
    ----------
    form : Form
        Contact form, bound to these textures.
    a, b : ndarray of float, shape (n,)
        Widths.
    points : ndarray of float, shape (n_point, n_coefficient)
        Coefficients, the first those of a draw.
    """

    form: Form
    a: FloatArray
    b: FloatArray
    points: FloatArray

    @classmethod
    def of(cls, posterior: Posterior, chosen: IntArray) -> "_Reachable":
        """Take a form at some of its textures, with coefficients that have loads there."""
        model, data = posterior.model, posterior.model.data
        textures = tuple(data.textures[j] for j in chosen)
        labels = tuple(data.labels[j] for j in chosen) if data.labels else ()
        form = model.form.bind(textures, labels)
        names = [model.parameter_names.index(name) for name in form.parameter_names]
        u = posterior.coordinates[len(posterior.coordinates) // 2, : model.n_parameter]
        a, b = data.a_over_R[chosen], data.b_over_R[chosen]
        reached = cls(form, a, b, model.to_theta(u)[None, names])
        points = [reached.points[0]]
        for k in range(1, _N_POINT):
            step = _SHIFT * np.cos(k + np.arange(len(u)))  # no coefficient, and no pair alike
            while np.abs(step).max() > _CLOSE:  # towards the draw, until the form has loads
                theta = model.to_theta(u + step)[names]
                if np.isfinite(reached.log_rates(theta)).all():
                    points.append(theta)
                    break
                step = 0.5 * step
        return cls(form, a, b, np.array(points))

    def log_rates(self, theta: FloatArray) -> FloatArray:
        """Return log rates, shape (..., n); not finite where there is no load."""
        with np.errstate(all="ignore"):
            return np.log(self.form.rate(theta, self.a, self.b))

    def holds(self, log_rates: FloatArray) -> bool:
        """Return whether the form reaches each of some sets of log rates, (n_point, n)."""
        start = self.log_rates(self.points[0])
        have_loads = np.isfinite(log_rates).all() and np.isfinite(start).all()
        return bool(have_loads) and all(map(self._reaches, log_rates))

    def _reaches(self, target: FloatArray) -> bool:
        """Return whether coefficients lead to log rates, by least squares."""

        def off(theta: FloatArray) -> FloatArray:
            return self.log_rates(theta) - target

        def slopes(theta: FloatArray) -> FloatArray:
            return self.form.log_rate_gradient(theta, self.a, self.b)

        rounding = dict.fromkeys(["ftol", "xtol", "gtol"], float(np.finfo(float).eps))
        nearest = least_squares(off, self.points[0], slopes, x_scale="jac", **rounding)
        return bool(np.abs(nearest.fun).max() < 0.5 * _CLOSE)
