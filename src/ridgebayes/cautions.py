"""Cautions that a fit or comparison prints with its result."""

from collections.abc import Collection, Mapping

import numpy as np
from scipy.special import logsumexp, ndtri

from ridgebayes.contact.hertz import transition_load
from ridgebayes.contact.two_scale import REACH
from ridgebayes.inference.chains import N_KEPT
from ridgebayes.inference.posterior import Posterior
from ridgebayes.model.noise import SERIES, Noise
from ridgebayes.model.observations import Observations
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
    "No texture has rows of two series (sources, where no series is named). Differences between "
    "series cannot be told from differences between textures, and bands are for a new series. If "
    "all rows come from one rig or solver, give them one series label."
)
_MAX_PRIOR_SDS = 4.0  # distance from a prior's centre above which loads contradict it
# A groove ten times as wide as its ridge reduces the load of Q = 4 to 0.4 of a smooth body's; wrong
# units change loads by a factor of ten or a thousand.
_MAX_LOAD_OVER_SMOOTH = 5.0
# Neighbouring loads differ by less than offsets of steps; docs/derivations/error-models.md.
_MIN_CLOSE_Q = 40
_CHECK = "Check that widths are over R and loads are p/E"
# Distance of a load from the fit over the median distance; six sds. Normal loads exceed it in 1 %
# of tables with six rows, and in 0.06 % with 41 rows.
_MAX_DISTANCE = 8.9
_N_DRAW = N_KEPT // 20  # draws for a row's mean density, whose error they make some 1 %


def cautions(
    table: ContactTable,
    noises: Collection[str],
    selected: Noise,
    posteriors: Mapping[str, Posterior],
) -> dict[str, tuple[str, ...]]:
    """Return sentences on the table, the error model, and priors contradicted by the loads.

    Parameters
    ----------
    table : ContactTable
        Fitted table.
    noises : collection of str
        Names of the error models that were compared.
    selected : Noise
        Error model whose parameters are shown.
    posteriors : mapping of str to Posterior
        Posteriors whose priors are compared with the loads, by form.

    Returns
    -------
    dict of str to tuple of str
        Sentences by form.
    """
    sentences = []
    if n_repeated := len(table.repeated):
        sentences.append(
            f"{count(n_repeated, 'row')} of curves whose loads are those of another source, solver "
            "or series to all digits. Copies count twice: leave one of each out."
        )
    sentences += beyond_any_body(table)
    data = Observations.from_table(table)
    factors = {factor for name in noises for factor in Noise.named(name).factors}
    if SERIES in factors and data.one_series_per_texture:
        sentences.append(_ONE_SERIES)
    n_close = int((data.is_count & (data.Q >= _MIN_CLOSE_Q)).sum())
    if n_close and "step" in factors:
        sentences.append(
            f"{count(n_close, 'count')} of Q = {_MIN_CLOSE_Q} and more: where each step has an "
            "offset, the probabilities of all counts at one load add up to more than 1 (1.006 at "
            "Q = 40, 1.1 at Q = 100), and evidences are too high by this factor a row at most."
        )
    if selected.caution and len(noises) == 1:
        sentences.append(_OF_NOISE.get(selected.caution, selected.caution))
    times = _times_smooth(table)
    if not 1 / _MAX_LOAD_OVER_SMOOTH <= times <= _MAX_LOAD_OVER_SMOOTH:
        sentences.append(
            f"The loads are {times:.2g} times those that make a smooth body touch as far (Hertz, "
            f"median of the rows). {_CHECK}."
        )
        return dict.fromkeys(posteriors, tuple(sentences))
    with_tails = any(Noise.named(name).tail != "normal" for name in noises)
    return {
        form: (*sentences, *_contradicted(posterior), *([] if with_tails else _outlying(posterior)))
        for form, posterior in posteriors.items()
    }


def beyond_any_body(table: ContactTable) -> list[str]:
    """Return sentences on rows that are impossible for a soft cylinder."""
    rows = table.calibration.frame
    a, b, Q = rows["a_over_R"], rows["b_over_R"], rows["Q"]
    reach = b / 2 + (Q / 2 - 1) * (a + b)  # distance of the last proximal edge from the axis
    sentences = []
    if n := int((reach > 1).sum()):
        worst = rows.iloc[int(reach.argmax())]
        sentences.append(
            f"{count(n, 'row')} with a contact wider than the body: Q = {worst['Q']:.0f} at a/R = "
            f"{worst['a_over_R']:g}, b/R = {worst['b_over_R']:g} ends {reach.max():.2g} R from the "
            f"axis. {_CHECK}."
        )
    if n := int((rows["rel_se"] > 1).sum()):
        sentences.append(
            f"{count(n, 'row')} with rel_se above 1, up to {rows['rel_se'].max():.3g}. Check that "
            "rel_se is a fraction: 0.05 for 5 %."
        )
    if n := int((rows["p_over_E"] > REACH).sum()):
        sentences.append(
            f"{count(n, 'row')} with p/E above {REACH:g}, up to {rows['p_over_E'].max():.3g}: "
            f"no model here holds there. {_CHECK}."
        )
    return sentences


def _times_smooth(table: ContactTable) -> float:
    """Return the median ratio of a table's loads to Hertz's for a smooth body; 1 without loads."""
    rows = table.calibration.frame
    rows = rows[(rows["kind"] == "transition") & (rows["Q"] >= 4)]  # Q = 2 is reached at no load
    if not len(rows):
        return 1.0
    Q, a, b, nu = (rows[name].to_numpy() for name in ("Q", "a_over_R", "b_over_R", "nu"))
    return float(np.median(rows["p_over_E"] / transition_load(Q, a, b, nu=nu)))


def _contradicted(fit: Posterior) -> list[str]:
    """Return a sentence on the coefficient farthest outside its prior, if there is one."""
    means, priors = fit.summary.set_index("parameter")["mean"], fit.model.priors
    scores = {name: float(priors[name].score(means[name])) for name in fit.form.parameter_names}
    worst = max(scores, key=lambda name: abs(scores[name]))
    if not abs(scores[worst]) > _MAX_PRIOR_SDS:
        return []
    low, high = (float(priors[worst].value_at(ndtri(p))) for p in (0.01, 0.99))
    return [
        f"The loads contradict a prior: {worst} of {fit.form.name} is "
        f"{means[worst]:.3g}, expected {low:.3g} to {high:.3g} (98 %). "
        f"{_CHECK}, or give other priors."
    ]


def _outlying(fit: Posterior) -> list[str]:
    """Return a sentence on the least likely load, if normal errors do not explain it."""
    exact = np.flatnonzero(fit.model.rows.exact)
    of_draws = fit.thinned(_N_DRAW).rows_log_likelihood()
    # With fewer rows a fit can pass through most of them, and the median distance is near 0.
    if of_draws is None or len(exact) < 2 * fit.model.n_parameter:
        return []
    log_density = logsumexp(of_draws[:, exact], axis=0) - np.log(len(of_draws))
    # In sds if errors are normal; outliers hardly change the median.
    distance = np.sqrt(2 * (log_density.max() - log_density))
    farthest, median = float(distance.max()), float(np.median(distance))
    if not farthest > max(_MAX_DISTANCE * median, 1.0):  # within one sd no load is an outlier
        return []
    data, worst = fit.model.data, int(exact[distance.argmax()])
    a, b = data.textures[data.texture[worst]]
    return [
        f"The load of Q = {data.Q[worst]} at a/R = {a:g}, b/R = {b:g} is {farthest:.1f} sds from "
        f"the fit, the median load {median:.2g}, and only normal errors were weighed. Check this "
        "row; accuracy `standard`, or an error model that ends in `:student`, gives it little "
        "weight."
    ]
