"""Cautions that a comparison prints beside its answer."""

import numpy as np

from ridgebayes.comparison.comparison import Comparison
from ridgebayes.comparison.ranking import forms_by_probability
from ridgebayes.contact.hertz import transition_load
from ridgebayes.model.noise import SERIES
from ridgebayes.model.observations import Observations
from ridgebayes.results import Fit
from ridgebayes.runtime.text import count
from ridgebayes.table.table import ContactTable

_OF_NOISE = {
    "rows are not independent": (
        "Errors of rows were taken as independent, and no other error model was weighed. Where "
        "they repeat within a texture or from step to step, this makes posteriors too narrow and "
        "overstates Bayes factors."
    )
}
_ONE_SERIES = (
    "No texture has rows of two series (sources, where no series is named). What sets series apart "
    "cannot be told from what sets textures apart, and bands are for a new series. If all rows "
    "come from one rig or solver, give them one series label."
)
_CONFLICT = 4.0  # prior sds from a prior's centre at which loads contradict it
# A groove ten times as wide as its ridge lowers the load of Q = 4 to 0.4 of a smooth body's; a unit
# that is not the one expected changes loads by ten or a thousand.
_OTHER_UNITS = 5.0
_CHECK = "Check that widths are over R and loads are p/E"
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
    of_series = comparison.evidence["noise"].str.contains(SERIES).any()
    if of_series and Observations.from_table(comparison.table).one_series_per_texture:
        found.append(_ONE_SERIES)
    caution = comparison.noise.caution
    if caution and comparison.evidence["noise"].nunique() == 1:
        found.append(_OF_NOISE.get(caution, caution))
    times = _times_smooth(comparison.table)
    if not 1 / _OTHER_UNITS <= times <= _OTHER_UNITS:
        found.append(
            f"The loads are {times:.2g} times those that make a smooth body touch as far (Hertz, "
            f"median of the rows). {_CHECK}."
        )
    else:
        for name in forms_by_probability(comparison)[:1]:
            found += _contradicted(comparison.fits[name])
    return tuple(found)


def _times_smooth(table: ContactTable) -> float:
    """Return the median ratio of a table's loads to Hertz' for a smooth body; 1 without loads."""
    rows = table.calibration.frame
    rows = rows[(rows["kind"] == "transition") & (rows["Q"] >= 4)]  # two ridges touch at no load
    if not len(rows):
        return 1.0
    Q, a, b, nu = (rows[name].to_numpy() for name in ("Q", "a_over_R", "b_over_R", "nu"))
    return float(np.median(rows["p_over_E"] / transition_load(Q, a, b, nu=nu)))


def _contradicted(fit: Fit) -> list[str]:
    """Say which coefficient lies far outside its prior; nothing where none does."""
    means, priors = fit.summary.set_index("parameter")["mean"], fit.model.priors
    scores = {name: float(priors[name].score(means[name])) for name in fit.form.parameter_names}
    worst = max(scores, key=lambda name: abs(scores[name]))
    if not abs(scores[worst]) > _CONFLICT:
        return []
    low, high = (float(priors[worst].value_at(score)) for score in (-_98_PERCENT, _98_PERCENT))
    return [
        f"The loads contradict a prior: {worst} of {fit.form.name} is "
        f"{means[worst]:.3g}, expected {low:.3g} to {high:.3g} (98 %). "
        f"{_CHECK}, or give other priors."
    ]
