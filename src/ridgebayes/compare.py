"""Which form does the evidence support: Bayes factors, model probabilities, predictive scores."""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from ridgebayes._types import FloatArray, Rng
from ridgebayes.diagnostics import leave_one_out, stacking_weights
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import (
    LogEvidence,
    bridge_evidence,
    laplace_evidence,
    power_law_evidence,
    quadrature_evidence,
    savage_dickey,
)
from ridgebayes.fit import Fit, as_noise, calibrate, drawn_exactly, refuse_circular
from ridgebayes.forms import Classic, Form, Hybrid, Modified, PowerLaw
from ridgebayes.labelled import groups_of
from ridgebayes.laplace import fit_laplace
from ridgebayes.likelihood import Model
from ridgebayes.loads import LoadDistribution, mix_loads
from ridgebayes.noise import Noise
from ridgebayes.predict import mix_q, predict_load, predict_q
from ridgebayes.qdistribution import QDistribution
from ridgebayes.randomness import seed_of, stream
from ridgebayes.sample import SampleSettings, Tell
from ridgebayes.table import ContactTable

DEFAULT_FORMS: tuple[Form, ...] = (Classic(), PowerLaw(), Modified(), Hybrid())
# A prior's scale by the name a reader knows it under, and the parameters it belongs to.
PRIOR_SCALES = {"c": ("c", "c1"), "c2": ("c2",), "K": ("K[",), "sigma": ("sigma",)}
SCALE_FACTORS = tuple(10.0 ** (k / 4) for k in range(-4, 5))
BAYES_FACTOR_COLUMNS = [
    "form_a",
    "form_b",
    "noise",
    "method",
    "ln_bf",
    "ln_bf_se",
    "log10_bf",
    "reading",
]
LOO_COLUMNS = ["form", "noise", "elpd", "se", "p", "n_bad_k", "stacking_weight"]

Stage = Callable[[str], AbstractContextManager[None]]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Fits of several forms to one table and what they say against each other.

    Parameters
    ----------
    table : ContactTable
        The table as used.
    noise : Noise
        Error model.
    fits : dict of str to Fit
        By form name.
    evidence : pandas.DataFrame
        Columns form, noise, method, log_evidence, log_evidence_se, used, prior_probability,
        model_probability, status.
    bayes_factors : pandas.DataFrame
        Columns form_a, form_b, noise, method, ln_bf, ln_bf_se, log10_bf, reading.
    loo : pandas.DataFrame
        Columns form, noise, elpd, se, p, n_bad_k, stacking_weight.
    prior_sensitivity : pandas.DataFrame
        Columns prior, factor, form, log_evidence: each prior scale over a factor of 100.
    failures : dict of str to str
        Forms that could not be fitted, and why.
    """

    table: ContactTable
    noise: Noise
    fits: dict[str, Fit]
    evidence: pd.DataFrame
    bayes_factors: pd.DataFrame
    loo: pd.DataFrame
    prior_sensitivity: pd.DataFrame
    failures: dict[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        parts = [f"{name} {share:.3g}" for name, share in self.probabilities.items()]
        return f"Comparison({self.table.where}: {', '.join(parts)})"

    @property
    def probabilities(self) -> dict[str, float]:
        """Posterior model probabilities at equal prior, by form."""
        used = self.evidence[self.evidence["used"]]
        return dict(zip(used["form"], used["model_probability"].astype(float), strict=True))

    @property
    def best(self) -> str:
        """The form of highest probability."""
        return max(self.probabilities, key=lambda name: self.probabilities[name])

    @property
    def complete(self) -> bool:
        """Whether every form was fitted, converged and got an evidence."""
        return not self.failures and all(fit.converged for fit in self.fits.values())

    def predict(
        self,
        a_over_R: float | FloatArray,
        b_over_R: float | FloatArray,
        p_over_E: float | FloatArray,
        *,
        nu: float = 0.5,
        kind: str = "simulation",
    ) -> QDistribution:
        """Return the distribution of Q averaged over the forms by their probability."""
        fits, weights = self._weighted()
        parts = [predict_q(fit, a_over_R, b_over_R, p_over_E, nu=nu, kind=kind) for fit in fits]
        return mix_q(parts, weights)

    def predict_load(
        self,
        a_over_R: float | FloatArray,
        b_over_R: float | FloatArray,
        Q: int | FloatArray,
        *,
        nu: float = 0.5,
        kind: str = "simulation",
    ) -> LoadDistribution:
        """Return the distribution of the load averaged over the forms by their probability."""
        fits, weights = self._weighted()
        parts = [predict_load(fit, a_over_R, b_over_R, Q, nu=nu, kind=kind) for fit in fits]
        return mix_loads(parts, weights)

    def _weighted(self) -> tuple[list[Fit], list[float]]:
        chosen = {name: share for name, share in self.probabilities.items() if share > 1e-9}
        return [self.fits[name] for name in chosen], list(chosen.values())


@contextmanager
def untimed(name: str) -> Iterator[None]:
    """Do nothing around a stage; the jobs behind the commands pass a stopwatch instead."""
    yield


def compare(
    table: ContactTable,
    forms: Sequence[Form] = DEFAULT_FORMS,
    *,
    noise: str | Noise = "iid",
    rng: Rng = 0,
    settings: SampleSettings | None = None,
    progress: Tell | None = None,
    stage: Stage = untimed,
    checkpoints: Path | None = None,
) -> Comparison:
    """Fit several forms to one table and compare them.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are fitted.
    forms : sequence of Form, optional
        Classic, power law, Modified and Hybrid if not given.
    noise : str or Noise, optional
        Error model of all forms.
    rng : int or numpy.random.Generator, optional
        Seed. Each form draws from a stream of its own name.
    settings : SampleSettings, optional
        Lengths and thresholds of sampling.
    progress : callable, optional
        Called with a line of text now and then.
    stage : callable, optional
        Called with a stage's name, returns a context manager around it.
    checkpoints : Path, optional
        Folder in which the chains are kept as they grow, see `calibrate`.

    Returns
    -------
    Comparison
        Fits, evidences, Bayes factors, probabilities, scores. A form whose fit failed is in
        `failures` and in no table.

    Raises
    ------
    InputError
        If no form is named, one is named twice, or one may not be fitted to these rows.
    ComputationError
        If no form could be fitted.

    Examples
    --------
    >>> import ridgebayes as rb
    >>> cmp = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], rng=1)
    >>> cmp.best
    'hybrid'
    >>> [round(float(ln_bf), 1) for ln_bf in cmp.bayes_factors["ln_bf"]]
    [-4.5, -4.5]
    """
    names = [form.name for form in forms]
    if not names or len(set(names)) < len(names):
        raise InputError(
            f"forms: {', '.join(names) or 'none'} given; rule: at least one, each once"
        )
    for form in forms:
        refuse_circular(table, form)
    seed, error_model = seed_of(rng), as_noise(noise)
    fits: dict[str, Fit] = {}
    failures: dict[str, str] = {}
    found: dict[str, list[LogEvidence]] = {}
    for form in forms:
        with stage(f"calibrate {form.name}"):
            own_seed = int(stream(seed, form.name).integers(2**63))
            say = None if progress is None else _labelled(progress, form.name)
            try:
                fit = calibrate(
                    table,
                    form,
                    noise=error_model,
                    rng=own_seed,
                    settings=settings,
                    progress=say,
                    checkpoint=checkpoints and checkpoints / chain_file(form.name),
                )
            except ComputationError as error:
                failures[form.name] = str(error)
                continue
            fits[form.name] = fit
        with stage(f"evidence {form.name}"):
            found[form.name] = evidences(fit)
    if not fits:
        raise ComputationError("no form could be fitted: " + "; ".join(failures.values()))
    evidence = _evidence_table(found, error_model)
    with stage("savage-dickey and Bayes factors"):
        factors = _bayes_factors(evidence, fits, error_model)
    with stage("leave-one-out"):
        loo = _loo_table(fits)
    with stage("prior sensitivity"):
        sensitivity = prior_sensitivity(fits)
    return Comparison(table, error_model, fits, evidence, factors, loo, sensitivity, failures)


def chain_file(form: str) -> str:
    """Return the name of the file that a form's growing chains are kept in."""
    return f"chains-{form}.h5"


def _labelled(progress: Tell, name: str) -> Tell:
    return lambda text: progress(f"{name}: {text}")


def evidences(fit: Fit) -> list[LogEvidence]:
    """Return the log evidence of a fit by every method that applies, bridge first.

    Parameters
    ----------
    fit : Fit
        Posterior with its full chains.

    Returns
    -------
    list of LogEvidence
        bridge, quadrature where there are at most four parameters or the form is the power law,
        laplace. A power law of very many textures has its exact evidence alone.
    """
    if drawn_exactly(fit.model):
        return [power_law_evidence(fit.model)]
    model, laplace = fit.model, fit_laplace(fit.model)
    found = [
        bridge_evidence(model.log_density, fit.chains, laplace, rng=stream(fit.seed, "bridge"))
    ]
    if isinstance(model.form, PowerLaw):
        found.append(power_law_evidence(model))
    elif model.n_parameter <= 4:
        found.append(quadrature_evidence(model.log_density, laplace))
    return [*found, laplace_evidence(laplace)]


def _evidence_table(found: Mapping[str, list[LogEvidence]], noise: Noise) -> pd.DataFrame:
    used = {name: next((e for e in methods if e.ok), methods[0]) for name, methods in found.items()}
    usable = {name: e.value for name, e in used.items() if e.ok}
    top = max(usable.values(), default=0.0)
    total = sum(math.exp(value - top) for value in usable.values())
    rows = []
    for name, methods in found.items():
        for e in methods:
            chosen = e is used[name] and e.ok
            rows.append(
                {
                    "form": name,
                    "noise": noise.name,
                    "method": e.method,
                    "log_evidence": e.value,
                    "log_evidence_se": e.se,
                    "used": chosen,
                    "prior_probability": 1 / len(found),
                    "model_probability": math.exp(e.value - top) / total if chosen else np.nan,
                    "status": e.status,
                }
            )
    return pd.DataFrame(rows)


def reading(ln_bf: float, ln_bf_se: float, form_a: str, form_b: str, caution: str | None) -> str:
    """Put a log Bayes factor in words, on the scale of Kass and Raftery.

    Parameters
    ----------
    ln_bf, ln_bf_se : float
        ln Z_a - ln Z_b and its standard error.
    form_a, form_b : str
        Names.
    caution : str or None
        What is added of the error model.

    Returns
    -------
    str
        ``undecided`` where abs(ln BF) is under 1 or under two standard errors.

    References
    ----------
    Kass & Raftery (1995), doi:10.1080/01621459.1995.10476572, section 3.2: 2 ln BF of 2, 6, 10.

    Examples
    --------
    >>> reading(-4.5, 0.001, "modified", "hybrid", None)
    'strong for hybrid (Kass & Raftery)'
    """
    size = abs(ln_bf)
    if not size >= 1 or size < 2 * ln_bf_se:
        words = "undecided"
    else:
        word = "positive" if size < 3 else "strong" if size < 5 else "very strong"
        words = f"{word} for {form_a if ln_bf > 0 else form_b} (Kass & Raftery)"
    return f"{words}; {caution}" if caution else words


def _bayes_factors(evidence: pd.DataFrame, fits: Mapping[str, Fit], noise: Noise) -> pd.DataFrame:
    used = {row["form"]: row for row in evidence[evidence["used"]].to_dict("records")}
    rows = []

    def add(a: str, b: str, method: str, ln_bf: float, se: float) -> None:
        words = reading(ln_bf, se, a, b, noise.caution)
        rows.append(
            {
                "form_a": a,
                "form_b": b,
                "noise": noise.name,
                "method": method,
                "ln_bf": ln_bf,
                "ln_bf_se": se,
                "log10_bf": ln_bf / math.log(10),
                "reading": words,
            }
        )

    for a, b in itertools.combinations(fits, 2):
        if a in used and b in used:
            methods = dict.fromkeys([used[a]["method"], used[b]["method"]])
            # A method without a Monte Carlo error has none to add.
            errors = [np.nan_to_num(used[form]["log_evidence_se"]) for form in (a, b)]
            ln_bf = used[a]["log_evidence"] - used[b]["log_evidence"]
            add(a, b, "/".join(methods), ln_bf, math.hypot(*errors))
    if {"modified", "hybrid"} <= set(fits):
        ratio = savage_dickey(fits["hybrid"])
        add("modified", "hybrid", ratio.method, -ratio.value, ratio.se)
    return pd.DataFrame(rows, columns=BAYES_FACTOR_COLUMNS)


def _loo_table(fits: Mapping[str, Fit]) -> pd.DataFrame:
    scores = {}
    for name, fit in fits.items():
        groups = groups_of(fit)
        if "log_likelihood" in groups:
            # The kept draws are thinned beyond the autocorrelation time where chains are long.
            reff = float(fit.summary["ess_bulk"].min()) / fit.kept_chains.log_density.size
            scores[name] = leave_one_out(groups, min(max(reff, 1e-3), 1.0))
    if not scores:
        return pd.DataFrame(columns=LOO_COLUMNS)
    weights = stacking_weights(np.stack([score.pointwise for score in scores.values()]))
    return pd.DataFrame(
        [
            {
                "form": name,
                "noise": fits[name].noise.name,
                "elpd": score.elpd,
                "se": score.se,
                "p": score.p,
                "n_bad_k": score.n_bad_k,
                "stacking_weight": weight,
            }
            for (name, score), weight in zip(scores.items(), weights, strict=True)
        ]
    )


def prior_sensitivity(
    fits: Mapping[str, Fit], factors: Sequence[float] = SCALE_FACTORS
) -> pd.DataFrame:
    """Return log evidences as each prior scale is stretched and shrunk.

    Parameters
    ----------
    fits : mapping of str to Fit
        By form name.
    factors : sequence of float, optional
        Multiples of the default scale; a factor of 100 in all if not given.

    Returns
    -------
    pandas.DataFrame
        Columns prior (c, c2, K, sigma), factor, form, log_evidence; deterministic methods only.
    """
    rows = []
    unchanged = {name: _deterministic_evidence(fit.model) for name, fit in fits.items()}
    for scale, starts in PRIOR_SCALES.items():
        for name, fit in fits.items():
            mine = {
                p: prior
                for p, prior in fit.model.priors.items()
                if p in starts or (scale == "K" and p.startswith("K["))
            }
            for factor in factors:
                value = unchanged[name]
                if mine and factor != 1:
                    stretched = {p: prior.stretched(factor) for p, prior in mine.items()}
                    value = _deterministic_evidence(fit.model.with_priors(stretched))
                rows.append({"prior": scale, "factor": factor, "form": name, "log_evidence": value})
    return pd.DataFrame(rows)


def _deterministic_evidence(model: Model) -> float:
    if isinstance(model.form, PowerLaw):
        return power_law_evidence(model).value
    try:
        laplace = fit_laplace(model)
    except ComputationError:
        return math.nan
    return quadrature_evidence(model.log_density, laplace, tol=1e-4).value
