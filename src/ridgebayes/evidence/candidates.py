"""The evidence of one form under one error model: a first look, then draws where they count."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import ComputationError
from ridgebayes.evidence import (
    LogEvidence,
    laplace_evidence,
    power_law_evidence,
    quadrature_evidence,
)
from ridgebayes.evidence.student_gain import student_gain
from ridgebayes.inference.funnel_mode import no_mode
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import Laplace, fit_laplace, several_modes
from ridgebayes.inference.moves import Independence
from ridgebayes.inference.posterior import Posterior, drawn_exactly
from ridgebayes.inference.power_law_exact import is_conjugate
from ridgebayes.inference.sampling import sample_posterior
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations
from ridgebayes.runtime.randomness import stream

GAIN = 1.0  # under which a Student tail with shared offsets is left to its normal twin
_NO_GAIN = 0.5  # the same of an estimate along two parameters alone

_ROUGH = 0.5  # standard error up to which draws tell an evidence better than Laplace's method

Effort = Mapping[str, int]


@dataclass(frozen=True, eq=False)
class Candidate:
    """A form under an error model: what its weight in an average follows from.

    Parameters
    ----------
    form, noise : str
        Names.
    evidence : LogEvidence
        Its log evidence; the status tells if there is none.
    laplace : Laplace, optional
        The normal approximation of its posterior.
    posterior : Posterior, optional
        Draws by importance sampling, where the pair carries weight.
    left_to : str
        Error model of normal tail whose draws stand for those of a Student tail; else empty.
    is_latent : bool
        Whether its densities are estimates, about offsets that are drawn.
    """

    form: str
    noise: str
    evidence: LogEvidence
    laplace: Laplace | None = None
    posterior: Posterior | None = None
    left_to: str = ""
    is_latent: bool = False

    @property
    def key(self) -> tuple[str, str]:
        """Form and error model."""
        return self.form, self.noise


@dataclass(frozen=True, eq=False)
class Weighing:
    """One evidence to be found; holds all that a process of its own needs.

    With what its screening found, the posterior is drawn if it is asked for.
    """

    data: Observations
    form: Form
    noise: Noise
    priors: Mapping[str, Distribution]
    seed: int
    screened: Candidate | None = None
    efforts: tuple[Effort, ...] = ()  # of drawing, one after the other until weights are even
    se_most: float = math.inf  # and, where offsets are drawn, the evidence is as sure
    seeks_modes: bool = True  # before drawing, beside the one that is known
    twin: Candidate | None = None
    is_tame: bool = False

    @property
    def key(self) -> tuple[str, str]:
        return self.form.name, self.noise.name

    @property
    def twin_name(self) -> str | None:
        """Error model of normal tail that a Student tail with shared offsets may be left to."""
        if self.noise.tail == "normal" or not self.noise.factors:
            return None
        return replace(self.noise, tail="normal").name

    @property
    def name(self) -> str:
        return f"evidence of {self.form.name}, {self.noise.name}"

    @property
    def own_seed(self) -> int:
        return int(stream(self.seed, self.form.name, self.noise.name).integers(2**63))


def evaluate(task: Weighing) -> Candidate:
    """Screen a pair, or draw from its posterior."""
    names = task.form.name, task.noise.name
    try:
        model = Model(task.data, task.form, task.noise, task.priors)
        if task.screened is not None and task.screened.laplace is not None:
            return _drawn(task, model, task.screened.evidence, task.screened.laplace)
        if drawn_exactly(model):
            return _exact(task, model)
        if task.twin is not None and task.is_tame:
            gain = _gain_along_tail(task, model)
            if gain < _NO_GAIN:
                value = task.twin.evidence.value + gain
                look = LogEvidence("laplace", value, math.nan)
                return Candidate(*names, look, left_to=task.twin.noise)
        laplace = fit_laplace(model)
        screened = _screened(model, laplace)
        if task.twin is not None and screened.value - task.twin.evidence.value < GAIN:
            return Candidate(*names, screened, left_to=task.twin.noise)
        return Candidate(*names, screened, laplace, is_latent=model.is_latent)
    except ComputationError as error:
        return Candidate(*names, LogEvidence("laplace", math.nan, math.nan, str(error)))


def _gain_along_tail(task: Weighing, model: Model) -> float:
    assert task.twin is not None
    if task.twin.laplace is None or not task.twin.evidence.ok:
        return math.nan
    noise = Noise.named(task.twin.noise)
    of_normal = {name: p for name, p in task.priors.items() if name != "df"}
    twin = Model(task.data, task.form, noise, of_normal)
    return student_gain(model, twin, task.twin.laplace.bound_to(twin))


def _exact(task: Weighing, model: Model) -> Candidate:
    evidence = power_law_evidence(model)
    if not evidence.ok:
        raise no_mode(model)
    posterior = sample_posterior(model, seed=task.own_seed) if task.efforts else None
    return Candidate(model.form.name, model.noise.name, evidence, posterior=posterior)


def _screened(model: Model, laplace: Laplace) -> LogEvidence:
    if is_conjugate(model):
        return power_law_evidence(model)
    if model.is_iid_gaussian:
        found = quadrature_evidence(model.log_density, laplace)
        if found.ok:
            return found
    return laplace_evidence(laplace)


def _drawn(task: Weighing, model: Model, screened: LogEvidence, laplace: Laplace) -> Candidate:
    if task.seeks_modes:
        laplace = replace(laplace, other_modes=several_modes(model, laplace))
    tried: list[tuple[Posterior, LogEvidence]] = []
    # Estimated densities are dear: a proposal fitted to all draws comes before more draws.
    again = model.is_latent and len(task.efforts) > 1
    efforts = (*task.efforts[: int(again)], *task.efforts)
    for i, effort in enumerate(efforts):
        frame, proposal = laplace, None
        if tried and model.is_latent:
            frame = laplace.bound_to(model)
            draws = frame.whiten(tried[-1][0].coordinates[:, : model.n_parameter])[0]
            rng = stream(task.own_seed, f"proposal {i}")
            proposal = Independence.fitted(draws, frame.n_curved, rng)
        tried.append(importance_posterior(model, frame, proposal, seed=task.own_seed, **effort))
        evidence = tried[-1][1]
        if evidence.ok and (evidence.se <= task.se_most or not model.is_latent):
            break
    # The last that can be trusted: what more draws found counts, also where it is less sure.
    posterior, evidence = next((one for one in reversed(tried) if one[1].ok), tried[-1])
    if screened.method == "quadrature":
        evidence = screened
    elif not evidence.ok:
        # Weights too uneven to vouch for draws still give an evidence nearer than Laplace's, which
        # may be off by ten where rows bound coefficients on one side only.
        evidence = replace(evidence, status="ok") if evidence.se <= _ROUGH else screened
    return Candidate(model.form.name, model.noise.name, evidence, laplace, posterior)
