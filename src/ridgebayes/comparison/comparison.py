"""Which form does the evidence support: Bayes factors, model probabilities, predictive scores."""

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from ridgebayes._types import FloatArray, Rng
from ridgebayes.comparison.bayes_factors import bayes_factor_table, summed_bayes_factors
from ridgebayes.comparison.scores import LOO_COLUMNS, loo_table
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.evidence import LogEvidence
from ridgebayes.evidence.error_models import chosen_error_model, weigh_error_models
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS, prior_sensitivity
from ridgebayes.evidence.tables import EVIDENCE_COLUMNS, evidence_table, evidences
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.posterior import drawn_exactly
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.forms import Classic, Form, Hybrid, Modified, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.predict.load_distribution import LoadDistribution, mix_loads
from ridgebayes.predict.predict import mix_q, predict_load, predict_q
from ridgebayes.predict.q_distribution import QDistribution
from ridgebayes.results import Fit, calibrate
from ridgebayes.runtime.ordered import map_ordered, submit_or_defer
from ridgebayes.runtime.randomness import seed_of, stream
from ridgebayes.table.table import ContactTable

DEFAULT_FORMS: tuple[Form, ...] = (Classic(), PowerLaw(), Modified(), Hybrid())
Stage = Callable[[str], AbstractContextManager[Callable[[float], None]]]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Fits of several forms to one table and what they say against each other.

    Parameters
    ----------
    table : ContactTable
        The table as used.
    noise : Noise
        Error model of the fits.
    fits : dict of str to Fit
        By form name.
    evidence : pandas.DataFrame
        Columns form, noise, method, log_evidence, log_evidence_se, used, prior_probability,
        model_probability, status. Where the error model was chosen by evidence, also one row for
        each form under every other.
    bayes_factors : pandas.DataFrame
        Columns form_a, form_b, noise, method, ln_bf, ln_bf_se, log10_bf, reading. Where several
        error models were weighed, also with these summed out.
    loo : pandas.DataFrame
        Columns form, noise, elpd, se, p, n_bad_k, stacking_weight.
    prior_sensitivity : pandas.DataFrame
        Columns prior, factor, form, log_evidence: each prior scale over a factor of 100.
    failures : dict of str to str
        Forms that could not be fitted, and why.
    left_out : pandas.DataFrame
        Scores of each form on textures and steps left out, see `checks.left_out`; empty where
        they were not asked for.
    coverage : pandas.DataFrame
        How often the best form's bands hold textures left out, see `checks.coverage`; empty
        where it was not asked for.
    accuracy : str
        Name of the accuracy that was asked for, see `ridgebayes.inference.presets`.
    cost : pandas.DataFrame
        What a few ways to the best form cost, see `checks.cost.short`; empty where that was
        not measured.
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

    @property
    def own_evidence(self) -> pd.DataFrame:
        """The rows of `evidence` under the error model of the fits."""
        return self.evidence[self.evidence["noise"] == self.noise.name]

    @property
    def own_bayes_factors(self) -> pd.DataFrame:
        """The rows of `bayes_factors` under the error model of the fits."""
        return self.bayes_factors[self.bayes_factors["noise"] == self.noise.name]

    @property
    def probabilities(self) -> dict[str, float]:
        """Posterior model probabilities at equal prior, by form."""
        used = self.own_evidence[self.own_evidence["used"]]
        return dict(zip(used["form"], used["model_probability"].astype(float), strict=True))

    @property
    def best(self) -> str:
        """The form of highest probability."""
        if not self.probabilities:
            raise ComputationError("no form has an evidence that can be used")
        return max(self.probabilities, key=lambda name: self.probabilities[name])

    @property
    def complete(self) -> bool:
        """Whether every form was fitted, converged and got an evidence."""
        weighed = set(self.fits) == set(self.probabilities)
        return not self.failures and weighed and all(fit.converged for fit in self.fits.values())

    def predict(
        self,
        a_over_R: float | FloatArray,
        b_over_R: float | FloatArray,
        p_over_E: float | FloatArray,
        *,
        nu: float | FloatArray = 0.5,
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
def untimed(name: str) -> Iterator[Callable[[float], None]]:
    """Do nothing around a stage; the jobs behind the commands pass a stopwatch instead."""
    yield lambda seconds: None


def compare(
    table: ContactTable,
    forms: Sequence[Form] = DEFAULT_FORMS,
    *,
    noise: str | Noise | None = "iid",
    rng: Rng = 0,
    settings: SampleSettings | None = None,
    progress: ProgressCallback | None = None,
    stage: Stage = untimed,
    checkpoints: Path | None = None,
    executor: Executor | None = None,
    accuracy: Preset = STANDARD,
    scores: bool = True,
) -> Comparison:
    """Fit several forms to one table and compare them.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are fitted.
    forms : sequence of Form, optional
        Classic, power law, Modified and Hybrid if not given.
    noise : str or Noise, optional
        Error model of all forms; None for the one with the highest mean evidence over them.
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
    executor : concurrent.futures.Executor, optional
        Weighs the error models where `noise` is None; where `accuracy` takes no walks it draws from
        the posteriors instead.
    accuracy : Preset, optional
        How far errors of draws and evidences are pressed down; `settings` overrides its walks.
    scores : bool, optional
        Whether to add leave-one-out scores and prior sensitivity, which take far longer than the
        rest where textures are very many.

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
            f"forms: {', '.join(names) or 'none'} given; expected at least one, each once"
        )
    for form in forms:
        refuse_circular(table, form)
    seed, elsewhere = seed_of(rng), pd.DataFrame(columns=EVIDENCE_COLUMNS)
    if noise is None:
        with stage("error models"):
            weighed = [n for n in Noise.every() if accuracy.walks or n.tail == "normal"]
            elsewhere = weigh_error_models(
                table,
                forms,
                weighed,
                seed=seed,
                # First looks are done before workers have started.
                executor=executor if accuracy.walks else None,
                progress=progress,
                laplace_only=not accuracy.walks,
            )
            noise = chosen_error_model(elsewhere)
    error_model = as_noise(noise)
    fits: dict[str, Fit] = {}
    failures: dict[str, str] = {}
    found: dict[str, list[LogEvidence]] = {}
    seeds = {form.name: int(stream(seed, form.name).integers(2**63)) for form in forms}
    without_walk = map_ordered(
        _drawn,
        [(table, form, error_model, seeds[form.name], accuracy.n_draw) for form in forms],
        executor,
        name=lambda task: f"posterior of {task[1].name}",
    )
    for form in forms:
        with stage(f"calibrate {form.name}") as add_cpu:
            own_seed = seeds[form.name]
            say = None if progress is None else _labelled(progress, form.name)
            outcome = None
            if not accuracy.walks:
                outcome, seconds = next(without_walk)
                add_cpu(seconds if executor else 0.0)
            try:
                if isinstance(outcome, ComputationError):
                    raise outcome
                fit = (
                    outcome[0]
                    if outcome
                    else calibrate(
                        table,
                        form,
                        noise=error_model,
                        rng=own_seed,
                        settings=settings or accuracy.settings,
                        progress=say,
                        checkpoint=checkpoints and checkpoints / chain_file(form.name),
                    )
                )
            except ComputationError as error:
                failures[form.name] = str(error)
                continue
            fits[form.name] = fit
        with stage(f"evidence {form.name}"):
            if isinstance(outcome, tuple):
                found[form.name] = [outcome[1]]
            else:
                found[form.name] = evidences(fit, n_bridge=accuracy.n_bridge)
    if not fits:
        raise ComputationError("no form could be fitted: " + "; ".join(failures.values()))
    evidence = evidence_table(found, error_model)
    if len(elsewhere):
        evidence = _with_others(evidence, elsewhere, error_model)
    # Walks leave so much that sending it costs more than it gains.
    beside = None if accuracy.walks else executor
    own = evidence[evidence["used"] & (evidence["noise"] == error_model.name)]
    values = dict(zip(own["form"], own["log_evidence"].astype(float), strict=True))
    if scores:
        left_one_out = submit_or_defer(beside, loo_table, fits)
        sensitive = submit_or_defer(beside, prior_sensitivity, fits, log_evidence=values)
    with stage("savage-dickey and Bayes factors"):
        factors = submit_or_defer(beside, bayes_factor_table, evidence, fits, error_model)()
        summed = summed_bayes_factors(evidence)
        if len(summed):
            factors = pd.concat([factors, summed], ignore_index=True)
    loo = pd.DataFrame(columns=LOO_COLUMNS)
    sensitivity = pd.DataFrame(columns=SENSITIVITY_COLUMNS)
    if scores:
        with stage("leave-one-out"):
            loo = left_one_out()
        with stage("prior sensitivity"):
            sensitivity = sensitive()
    return Comparison(
        table,
        error_model,
        fits,
        evidence,
        factors,
        loo,
        sensitivity,
        failures,
        accuracy=accuracy.name,
    )


def _drawn(
    task: tuple[ContactTable, Form, Noise, int, int],
) -> tuple[tuple[Fit, LogEvidence] | ComputationError | None, float]:
    """Draw without a walk, and say how many CPU seconds it took.

    None where the draws' weights are not to be trusted; an error is one form's, not the others'.
    """
    table, form, noise, seed, n_draw = task
    began = time.process_time()
    found = None
    try:
        model = Model(Observations.from_table(table), form, noise)
        if not drawn_exactly(model):
            fit, evidence = importance_posterior(
                model, seed=seed, n_draw=n_draw, n_round=2, n_per_round=500
            )
            found = (Fit.of(fit), evidence) if fit.converged and evidence.ok else None
    except ComputationError as error:
        return error, time.process_time() - began
    return found, time.process_time() - began


def _with_others(evidence: pd.DataFrame, weighed: pd.DataFrame, noise: Noise) -> pd.DataFrame:
    """Add what weighing the error models gave; of the chosen one it is only a first look."""
    first_look = weighed["noise"] == noise.name
    weighed = weighed.assign(
        used=weighed["used"] & ~first_look,
        model_probability=weighed["model_probability"].mask(first_look),
    )
    return pd.concat([evidence, weighed], ignore_index=True)


def chain_file(form: str) -> str:
    """Return the name of the file that a form's growing chains are kept in."""
    return f"chains-{form}.h5"


def _labelled(progress: ProgressCallback, name: str) -> ProgressCallback:
    return lambda text: progress(f"{name}: {text}")
