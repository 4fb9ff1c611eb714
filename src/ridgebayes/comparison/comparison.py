"""Result of a comparison of forms, with predictions averaged over forms and error models."""

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import pandas as pd
from scipy.special import softmax

from ridgebayes import drawing
from ridgebayes._types import Tabular
from ridgebayes.comparison.bayes_factors import summed_evidence
from ridgebayes.comparison.same_loads import same_loads
from ridgebayes.comparison.verdict import Verdict, ranked_forms, verdict_of
from ridgebayes.errors import ComputationError
from ridgebayes.evidence.components import component_table
from ridgebayes.evidence.pairs import MIN_FORM_PROBABILITY
from ridgebayes.inference.posterior import Posterior
from ridgebayes.inference.presets import STANDARD
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.predict.extrapolation import MIN_SHARE
from ridgebayes.predict.predict import Predictive
from ridgebayes.results import Fit
from ridgebayes.table.table import ContactTable

if TYPE_CHECKING:  # heavy
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(Predictive, Tabular):
    """Fits of several forms to one table and their comparison.

    Parameters
    ----------
    table : ContactTable
        Table to which the forms were fitted.
    noise : Noise
        Selected error model, under which parameters are shown.
    fits : dict of str to Fit
        Fits by form name.
    evidence : pandas.DataFrame
        Columns form, noise, method, log_evidence, log_evidence_se, used, prior_probability,
        model_probability, status, with rows for each form under each error model weighed.
    bayes_factors : pandas.DataFrame
        Columns form_a, form_b, noise, method, ln_bf, ln_bf_se, log10_bf, reading. If several
        error models were weighed, there are also rows with the error models summed out.
    loo : pandas.DataFrame
        Columns form, noise, elpd, se, p, n_bad_k, stacking_weight.
    prior_sensitivity : pandas.DataFrame
        Columns prior, factor, form, log_evidence. The scale of each prior is multiplied by 0.1 (0.3
        for coefficients) to 10 and the nugget by 0.1 to 10; error models are summed out.
    failures : dict of str to str
        Reason for each form that could not be fitted.
    left_out : pandas.DataFrame
        Scores of each form on left-out textures and steps, see `checks.left_out`; empty if not
        computed.
    coverage : pandas.DataFrame
        Share of the loads of left-out textures inside the best form's bands, see
        `checks.coverage`; empty if not computed.
    accuracy : str
        Name of the requested accuracy, see `ridgebayes.inference.presets`.
    cost : pandas.DataFrame
        Errors and run times of each accuracy, see `checks.cost`; empty if not measured.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), ["modified", "hybrid"], noise="iid", accuracy="quick")
    >>> cmp.best, cmp.to_dataframe()["model_probability"].round(2).tolist()
    ('hybrid', [0.99, 0.01])
    >>> cmp.complete, cmp.unconverged, cmp.verdict.grade
    (True, {}, 'supports')
    >>> {form: round(share, 2) for form, share in cmp.probabilities.items()}
    {'modified': 0.01, 'hybrid': 0.99}
    >>> cmp.prior_probabilities, round(cmp.probabilities_at_equal_odds["hybrid"], 2)
    ({'modified': 0.5, 'hybrid': 0.5}, 0.99)
    >>> [round(weight, 2) for _, weight in cmp.averaged]  # weights of the predictions
    [0.01, 0.99]
    >>> set(cmp.own_evidence["noise"]) | set(cmp.own_bayes_factors["noise"])
    {'iid'}
    >>> len(cmp.components)  # one error model: nothing to compare
    0
    >>> cmp.cautions[0].split(",")[0]
    'Errors of rows were taken as independent'
    >>> cmp.plot().get_xlabel()
    'ln Bayes factor over the most probable form'
    """

    table: ContactTable
    noise: Noise
    fits: dict[str, Fit]
    evidence: pd.DataFrame
    bayes_factors: pd.DataFrame
    loo: pd.DataFrame
    prior_sensitivity: pd.DataFrame
    failures: dict[str, str] = field(default_factory=dict)
    left_out: pd.DataFrame = field(default_factory=pd.DataFrame)
    coverage: pd.DataFrame = field(default_factory=pd.DataFrame)
    accuracy: str = STANDARD.name
    cost: pd.DataFrame = field(default_factory=pd.DataFrame)

    def __repr__(self) -> str:
        parts = [f"{name} {share:.3g}" for name, share in self.probabilities.items()]
        return f"Comparison({self.table.where}: {', '.join(parts)})"

    def to_dataframe(self) -> pd.DataFrame:
        """Return a table with one row for each form, the most probable first.

        Returns
        -------
        pandas.DataFrame
            Columns form, model_probability, log_evidence and log_evidence_se (with error models
            summed out), ln_bf (over the most probable form), elpd, elpd_se, stacking_weight,
            converged. Missing evidences and scores are NaN.
        """
        weighed, shares = summed_evidence(self.evidence), self.probabilities
        top = max((value for value, _ in weighed.values()), default=math.nan)
        scores = self.loo.set_index("form")[["elpd", "se", "stacking_weight"]]
        rows = []
        for name, fit in self.fits.items():
            value, se = weighed.get(name, (math.nan, math.nan))
            rows.append((name, shares.get(name, math.nan), value, se, value - top, fit.converged))
        names = ["form", "model_probability", "log_evidence", "log_evidence_se", "ln_bf"]
        frame = pd.DataFrame(rows, columns=[*names, "converged"])
        frame = frame.join(scores.rename(columns={"se": "elpd_se"}), on="form")
        order = [*names, "elpd", "elpd_se", "stacking_weight", "converged"]
        return frame.sort_values("ln_bf", ascending=False, ignore_index=True)[order]

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Plot the log Bayes factor of each form over the most probable form.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Axes to draw on; those of a new figure if not given.

        Returns
        -------
        matplotlib.axes.Axes
            The axes drawn on.
        """
        return drawing.records.draw_forms(self.to_dataframe(), ax)

    @property
    def cautions(self) -> tuple[str, ...]:
        """Reasons to doubt the result, one sentence each: units, copies, independence, priors."""
        shares = self.probabilities
        return self.fits[max(self.fits, key=lambda name: shares.get(name, -1.0))].cautions

    @property
    def own_evidence(self) -> pd.DataFrame:
        """Rows of `evidence` under the selected error model."""
        return self.evidence[self.evidence["noise"] == self.noise.name]

    @property
    def own_bayes_factors(self) -> pd.DataFrame:
        """Rows of `bayes_factors` under the selected error model."""
        return self.bayes_factors[self.bayes_factors["noise"] == self.noise.name]

    @property
    def components(self) -> pd.DataFrame:
        """Inclusion Bayes factors of the error model's components, with forms summed out.

        Columns component (``texture``, ``step``, ``smooth``, ``series``, ``student``), ln_bf,
        ln_bf_se, probability, reading. Empty if only one error model was weighed.
        """
        return component_table(self.evidence)

    @property
    def probabilities(self) -> dict[str, float]:
        """Posterior probabilities of the forms, with error models summed out."""
        used = self.evidence[self.evidence["used"]]
        sums = used.groupby("form", sort=False)["model_probability"].sum()
        # Normalised, so that a single form has 1, not a little less, which would be shown as < 1.
        return {str(name): float(share) for name, share in (sums / sums.sum()).items()}

    @property
    def probabilities_at_equal_odds(self) -> dict[str, float]:
        """Posterior probabilities of the forms at equal prior odds."""
        values = ranked_forms(self.evidence)
        return dict(zip(values, softmax(list(values.values())).tolist(), strict=True))

    @property
    def prior_probabilities(self) -> dict[str, float]:
        """Prior probabilities of the fitted forms, equal unless prior odds were given."""
        pairs = self.evidence.drop_duplicates(["form", "noise"])
        sums = pairs.groupby("form", sort=False)["prior_probability"].sum()
        return {str(name): float(share) for name, share in sums.items()}

    @cached_property
    def verdict(self) -> Verdict | None:
        """Graded verdict on the best form; None if fewer than two forms have an evidence."""
        data = Observations.from_table(self.table)
        return verdict_of(
            self.evidence,
            self.prior_sensitivity,
            self.noise,
            lambda form, other: same_loads(self.fits[form], self.fits[other]),
            self.failures,
            series_are_textures=data.one_texture_per_series,
        )

    @property
    def best(self) -> str:
        """Name of the form with the highest probability.

        Raises
        ------
        ComputationError
            If no form has an evidence that can be used.
        """
        if not self.probabilities:
            raise ComputationError("no form has an evidence that can be used")
        return max(self.probabilities, key=lambda name: self.probabilities[name])

    @property
    def complete(self) -> bool:
        """Whether all forms have a fit and an evidence, and all but negligible forms converged."""
        weighed = set(self.fits) == set(self.probabilities)
        return not self.failures and weighed and not self.unconverged

    @property
    def unconverged(self) -> dict[str, tuple[str, ...]]:
        """Reasons why forms did not converge, under all error models of their averaged predictions.

        Forms of negligible probability are not listed.
        """
        shares, lacking = self.probabilities, {}
        for name, fit in self.fits.items():
            failures = list(fit.convergence_failures)
            for posterior, _ in fit.averaged:
                if posterior.noise.name != fit.noise.name:
                    noise = posterior.noise.name
                    failures += [f"{noise}: {why}" for why in posterior.convergence_failures]
            if failures and shares.get(name, 1.0) >= MIN_FORM_PROBABILITY:
                lacking[name] = tuple(failures)
        return lacking

    @property
    def averaged(self) -> list[tuple[Posterior, float]]:
        """Posteriors over which predictions are averaged, with their weights.

        These are the pairs of a form and an error model with a weight of at least 1 %.

        Raises
        ------
        ComputationError
            If no form has an evidence that can be used.
        """
        if not self.probabilities:
            raise ComputationError("no form has an evidence that can be used")
        shares = self.probabilities
        parts = [
            (posterior, shares[name] * weight)
            for name, fit in self.fits.items()
            if name in shares
            for posterior, weight in fit.averaged
        ]
        least = min(MIN_SHARE, max(weight for _, weight in parts))
        return [(posterior, weight) for posterior, weight in parts if weight >= least]
