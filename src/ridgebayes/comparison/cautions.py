"""What a reader of a comparison has to be told beside the answer."""

import numpy as np

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import forms_by_probability
from ridgebayes.results import Fit
from ridgebayes.runtime.text import count

_OF_NOISE = {
    "rows are not independent": (
        "Errors of rows were taken as independent, and no other error model was weighed. Where "
        "they repeat within a texture or from step to step, this makes posteriors too narrow and "
        "overstates Bayes factors."
    )
}
_CONFLICT = 4.0  # prior sds from a prior's centre at which loads contradict it
_98_PERCENT = 2.326  # prior sds on either side


def cautions(comparison: Comparison) -> tuple[str, ...]:
    """Return sentences on the table, the error model, and priors that the loads contradict.

    Parameters
    ----------
    comparison : Comparison
        One form will do.
    """
    found = []
    if n_repeated := len(comparison.table.repeated):
        found.append(
            f"{count(n_repeated, 'row')} with the load of another source, solver or series to all "
            "digits. Copies count twice: leave one of each out."
        )
    caution = comparison.noise.caution
    if caution and comparison.evidence["noise"].nunique() == 1:
        found.append(_OF_NOISE.get(caution, caution))
    for name in forms_by_probability(comparison)[:1]:
        found += _contradicted(comparison.fits[name])
    return tuple(found)


def _contradicted(fit: Fit) -> list[str]:
    """Say which coefficient lies far outside its prior; nothing where none does."""
    model = fit.model
    parameters = fit.summary.set_index("parameter")["mean"]
    mean = parameters[list(model.parameter_names)].to_numpy(dtype=float)
    u = model.to_unconstrained(mean)[: model.n_coefficient]
    worst = int(np.argmax(np.abs(u)))
    if not abs(u[worst]) > _CONFLICT:
        return []
    at = np.zeros((3, model.n_parameter))
    at[:, worst] = -_98_PERCENT, 0.0, _98_PERCENT
    low, _, high = model.to_theta(at)[:, worst]
    return [
        f"The loads contradict a prior: {model.parameter_names[worst]} of {fit.form.name} is "
        f"{mean[worst]:.3g}, expected {low:.3g} to {high:.3g} (98 %). Check that widths are over "
        "R and loads are p/E, or give other priors."
    ]
