"""`FrictionModel`: adhesion, deformation loss, interlocking, and effects of measurements.

    mu = (tau0 f A/W + alpha + (2/(3 pi)) beta w/R + kappa I/W) exp(u)

A is the touching area at rest, f the share of A in sliding, w the contact half-width, I the sum of
the forces G on the proximal edges of one side, and W the load, all per unit length of the ridges; u
is the sum of the effects of subject, session, rig and repeat. `docs/friction.md` gives the source
and the limits of each term.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
import xarray as xr

from ridgebayes._types import FloatArray, Rng
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.distributions.grammar import parse_distribution
from ridgebayes.errors import InputError
from ridgebayes.friction.bands import FrictionBands, FrictionInputs, predicted
from ridgebayes.friction.terms import COEFFICIENTS, PARAMETERS
from ridgebayes.runtime.randomness import seed_of

Prior = Distribution | float | str


@dataclass(frozen=True)
class FrictionModel:
    """A friction model with priors on its parameters.

    Each parameter is a distribution, its text as in a file of priors (``lognormal(0.1, 50 %)``), or
    a number (a known value). Terms with a coefficient of 0 are omitted. Stresses are divided by
    Young's modulus.

    Parameters
    ----------
    tau0 : Distribution, str or float, optional
        Shear stress of the adhesive contact.
    alpha : Distribution, str or float, optional
        Increase of the shear stress per mean contact pressure, which adds directly to mu.
    area_factor : Distribution, str or float, optional
        Touching area in sliding over touching area at rest.
    beta : Distribution, str or float, optional
        Share of the elastic work that is lost.
    kappa : Distribution, str or float, optional
        Resistance of the proximal edges of one side over the sum of their forces G (an
        assumption).
    tau_subject, tau_session, tau_rig : Distribution, str or float, optional
        Standard deviations of ln mu between subjects, sessions of a subject, and rigs.
    sigma : Distribution, str or float, optional
        Standard deviation of ln mu from one measurement to the next.

    Raises
    ------
    InputError
        If a number is negative or not finite, a distribution has mass below 0, or all terms are 0.

    Examples
    --------
    >>> FrictionModel(kappa=0).unknown  # no interlocking
    ('tau0', 'area_factor', 'beta', 'tau_subject', 'tau_session', 'tau_rig', 'sigma')
    >>> known = FrictionModel(kappa=0, area_factor=0.8, tau_subject=0, tau_session=0, tau_rig=0)
    >>> [(name, prior.words) for name, prior in known.priors.items()][0]
    ('tau0', 'log-normal, median 0.07, log-sd 1')
    >>> known.theta(np.zeros(3)).round(3).tolist()  # at the medians
    [0.07, 0.0, 0.8, 0.24, 0.0, 0.0, 0.0, 0.0, 0.067]
    >>> import ridgebayes as rb
    >>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
    >>> drawn = rb.friction_inputs(fit, rb.Scene.of([(0.022, 0.02)]), [0.003, 0.009], n=100, rng=1)
    >>> known.predict(drawn, rng=1).bands["load"].tolist()
    [0.003, 0.009]
    """

    tau0: Prior = "lognormal(0.07, 1)"
    alpha: Prior = 0.0
    area_factor: Prior = "uniform(0.6, 1)"
    beta: Prior = "lognormal(0.24, 0.3)"
    kappa: Prior = "lognormal(1, 1)"
    tau_subject: Prior = "halfnormal(0.3)"
    tau_session: Prior = "halfnormal(0.15)"
    tau_rig: Prior = "halfnormal(0.1)"
    sigma: Prior = "halfnormal(0.1)"

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, str):
                value = parse_distribution(value, field.name)
                object.__setattr__(self, field.name, value)
            low = value.support[0] if isinstance(value, Distribution) else value
            if not isinstance(low, int | float | np.number) or not 0 <= low < math.inf:
                rule = "expected a distribution of positive values, or a number >= 0"
                raise InputError(f"{field.name}: {rule}, got {value!r}")
        if not any(self._values[name] for name in COEFFICIENTS):
            raise InputError(f"expected one of {', '.join(COEFFICIENTS)} above 0, got none")

    @property
    def _values(self) -> dict[str, Distribution | float]:
        return {name: getattr(self, name) for name in PARAMETERS}

    @property
    def priors(self) -> dict[str, Distribution]:
        """Priors of the unknown parameters."""
        values = self._values.items()
        return {name: prior for name, prior in values if isinstance(prior, Distribution)}

    @property
    def unknown(self) -> tuple[str, ...]:
        """Names of the unknown parameters."""
        return tuple(self.priors)

    def theta(self, scores: FloatArray) -> FloatArray:
        """Return all nine parameters at normal scores of the unknown parameters.

        Parameters
        ----------
        scores : ndarray of float, shape (..., n_unknown), dimensionless
            Scores in the order of `unknown`.

        Returns
        -------
        ndarray of float, shape (..., 9), dimensionless
            Parameters in the order of the fields.
        """
        out = np.empty((*scores.shape[:-1], len(PARAMETERS)))
        unknown = iter(np.moveaxis(scores, -1, 0))
        for i, value in enumerate(self._values.values()):
            out[..., i] = (
                value.value_at(next(unknown)) if isinstance(value, Distribution) else value
            )
        return out

    def predict(
        self, inputs: xr.Dataset | FrictionInputs, *, prob: float = 0.9, rng: Rng = 0
    ) -> FrictionBands:
        """Predict the coefficient of friction from the priors.

        Parameters
        ----------
        inputs : xarray.Dataset
            Draws of `friction_inputs`, with edges unless kappa is 0.
        prob : float, optional
            Probability inside the bands.
        rng : int or numpy.random.Generator, optional
            Seed; the same seed gives the same bands.

        Returns
        -------
        FrictionBands
            Bands for a further measurement on a new subject, session and rig, and the shares of
            terms and inputs in their variance.

        Raises
        ------
        InputError
            If a variable is missing, or edges of round ridges, which have no forces, are needed.
        """
        k = len(self.unknown)
        columns = {name: [PARAMETERS.index(name)] for name in self.unknown}
        return predicted(
            FrictionInputs.of(inputs, edges=self.kappa != 0),
            lambda random, n: self.theta(random.standard_normal((n, k))),
            columns,
            seed=seed_of(rng),
            prob=prob,
        )
