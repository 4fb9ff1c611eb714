"""Forms under error models weighed anew, where a prior of the error models has another scale."""

from collections.abc import Callable, Collection, Sequence

from scipy.special import logsumexp

from ridgebayes.evidence.error_models import WeighedErrorModels
from ridgebayes.evidence.tables import used_evidence
from ridgebayes.inference.presets import ROUGH
from ridgebayes.model.default_priors import NOISE_PRIORS
from ridgebayes.model.forms import Form
from ridgebayes.model.prior_files import OF_ERRORS, ResolvedPriors


def weighed_anew(
    weigh: Callable[..., WeighedErrorModels],
    forms: Sequence[Form],
    priors: ResolvedPriors,
    prior: str,
    factor: float,
    names: Collection[str],
) -> dict[str, float]:
    """Return ln evidences under another prior, those of the error models added.

    Parameters
    ----------
    weigh : callable
        `weigh_error_models` of what the comparison is made of; forms, priors and accuracy are open.
    forms : sequence of Form
        Contact forms.
    priors : mapping of str to mapping of str to Distribution
        Replacements for default priors.
    prior : str
        Parameter of the error models.
    factor : float
        By which the scale of its prior is multiplied.
    names : collection of str
        Forms that are weighed.

    Returns
    -------
    dict of str to float
        By form, of those that have one, to some tenths.
    """
    of_errors = priors.get(OF_ERRORS, {})
    scaled = of_errors.get(prior, NOISE_PRIORS[prior]).stretched(factor)
    weighed = weigh(
        forms=[form for form in forms if form.name in names],
        priors={**priors, OF_ERRORS: {**of_errors, prior: scaled}},
        accuracy=ROUGH,
    )
    by_form = used_evidence(weighed.evidence).groupby("form")["log_evidence"]
    return {str(form): float(logsumexp(values)) for form, values in by_form}
