"""Variables and attributes of a posterior file, as `tests/inference/test_netcdf.py` checks it."""

SAMPLE = ("chain", "draw")
_EACH_ROW, _EACH_TEXTURE = ("row",), ("texture",)
_PARAMETERS = {  # `PARAMETER` means each of c, c1, c2, sigma, tau_texture, ...
    "PARAMETER": (SAMPLE, "each parameter but K"),
    "K": ((*SAMPLE, "texture"), "slopes of the power law"),
}
# Groups of a posterior's file: dimensions and meaning of each variable. A file
# has those that its form, error model and rows call for.
CONTENT: dict[str, dict[str, tuple[tuple[str, ...], str]]] = {
    "posterior": _PARAMETERS,
    "sample_stats": {
        "lp": (SAMPLE, "log posterior density in the coordinates `u`"),
        "u": ((*SAMPLE, "coordinate"), "unconstrained coordinates that were sampled"),
        "acceptance_rate": (("chain",), "share of proposals that were accepted"),
        "tau": (("quantity",), "autocorrelation times in steps: of each coordinate, and of `lp`"),
        "log_likelihood_joint": (SAMPLE, "log-likelihood of all rows, where they share offsets"),
    },
    "log_likelihood": {
        "log_load": ((*SAMPLE, "row"), "log density of each row; of shared offsets, given the rest")
    },
    "log_prior": {
        "PARAMETER": (SAMPLE, "log prior density of each parameter but K"),
        "K": (SAMPLE, "that of the slopes of the power law, summed over textures"),
    },
    "prior": _PARAMETERS,
    "prior_predictive": {"log_load": ((*SAMPLE, "row"), "log loads that the prior predicts")},
    "posterior_predictive": {
        "log_load": ((*SAMPLE, "row"), "log loads predicted at some draws, shared offsets anew")
    },
    "observed_data": {"log_load": (_EACH_ROW, "log(p/E), reduced to nu = 0.5")},
    "constant_data": {
        "Q": (_EACH_ROW, "count"),
        "texture_index": (_EACH_ROW, "place of its texture, from 0"),
        "rel_se": (_EACH_ROW, "known relative standard error"),
        "log_lower": (_EACH_ROW, "log of `p_over_E_lower`, reduced; NaN without one"),
        "is_count": (_EACH_ROW, "1 where the row is a count at a load"),
        "series_index": (_EACH_ROW, "place of its series, where there are several"),
        "a_over_R": (_EACH_TEXTURE, "ridge width over the radius"),
        "b_over_R": (_EACH_TEXTURE, "groove width over the radius"),
    },
}
# Attributes of a file, beside those that arviz has too.
ATTRIBUTES = {
    "ridgebayes_version": "version that wrote it",
    "form": "contact form",
    "noise": "error model",
    "priors": "JSON: the prior of each parameter; `K`: of the power law's slopes, if it was given",
    "summary": "JSON: the parameters' rows of `summary.csv`",
    "missing": "JSON: rules of convergence that were not met",
    "stopping_rule_missing": "JSON: those of them that the walk itself found",
    "cautions": "JSON: reasons to doubt the answer",
    "seed": "seed of the run",
    "sampler": "`emcee` or `importance`",
    "n_walker": "walkers of an ensemble: draws of one step stand side by side",
    "series": "JSON: labels of the series, where there are several",
    "nugget": "variance of a smooth offset that is its place's own, where it is not the default",
}
