"""Forms under error models weighed anew, where a prior of the error models has another scale."""

from collections.abc import Collection, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

from scipy.special import logsumexp

from ridgebayes.evidence.error_models import weigh_error_models
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.inference.chains import ProgressCallback
from ridgebayes.inference.presets import ROUGH
from ridgebayes.model.default_priors import NOISE_PRIORS
from ridgebayes.model.forms import Form
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.prior_files import OF_ERRORS, ResolvedPriors


@dataclass(frozen=True, eq=False)
class WeighingAnew:
    """What a comparison was made of, so that it can be made again under another prior.

    Parameters
    ----------
    data : Observations
        Rows.
    forms : sequence of Form
        Contact forms.
    noises : sequence of Noise
        Error models.
    priors : mapping of str to mapping of str to Distribution
        Replacements for default priors.
    seed : int
        Seed.
    executor : concurrent.futures.Executor, optional
        Runs the pairs; one after the other in this process if not given.
    progress : callable, optional
        Called with a line of text now and then.
    """

    data: Observations
    forms: Sequence[Form]
    noises: Sequence[Noise]
    priors: ResolvedPriors
    seed: int
    executor: Executor | None = None
    progress: ProgressCallback | None = None

    def evidences(self, prior: str, factor: float, names: Collection[str]) -> dict[str, float]:
        """Return ln evidences under another prior, those of the error models added.

        Parameters
        ----------
        prior : str
            Parameter of the error models.
        factor : float
            By which the scale of its prior is multiplied.
        names : collection of str
            Forms.

        Returns
        -------
        dict of str to float
            By form, of those that have one, to some tenths.
        """
        of_errors = self.priors.get(OF_ERRORS, {})
        scaled = of_errors.get(prior, NOISE_PRIORS[prior]).stretched(factor)
        weighed = weigh_error_models(
            self.data,
            [form for form in self.forms if form.name in names],
            self.noises,
            priors={**self.priors, OF_ERRORS: {**of_errors, prior: scaled}},
            seed=self.seed,
            executor=self.executor,
            progress=self.progress,
            accuracy=ROUGH,
        )
        by_form = used_evidence(weighed.evidence).groupby("form")["log_evidence"]
        return {str(form): float(logsumexp(values)) for form, values in by_form}
