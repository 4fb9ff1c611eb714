"""Which error model does the evidence support: every form under each, and what that says.

An error model is weighed by its mean evidence over the forms, so that none is chosen for suiting
one form alone; forms are weighed against each other under the chosen one, and with the error models
summed out, every one as probable as the next.
"""

import itertools
import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from ridgebayes.errors import ComputationError
from ridgebayes.evidence import (
    LogEvidence,
    laplace_evidence,
    power_law_evidence,
    quadrature_evidence,
)
from ridgebayes.evidence.tables import EVIDENCE_COLUMNS, used_evidence
from ridgebayes.inference.chains import ProgressCallback
from ridgebayes.inference.importance_sampling import importance_posterior
from ridgebayes.inference.laplace import Laplace, fit_laplace, several_modes
from ridgebayes.model.forms import Form, PowerLaw
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import stream
from ridgebayes.table.table import ContactTable

# Error models differ by whole units, and the chosen one is then walked: Laplace's approximation
# screens for those worth refining, which importance sampling does.
_CLOSE = 4.0
_EFFORT = {"n_draw": 1_024, "n_round": 4, "n_per_round": 1_000}


def weigh_error_models(
    table: ContactTable,
    forms: Sequence[Form],
    noises: Sequence[Noise] = Noise.every(),
    *,
    seed: int = 0,
    executor: Executor | None = None,
    progress: ProgressCallback | None = None,
    laplace_only: bool = False,
) -> pd.DataFrame:
    """Return the log evidence of every form under every error model.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are fitted.
    forms : sequence of Form
        Contact forms.
    noises : sequence of Noise, optional
        Error models; all ten if not given.
    seed : int, optional
        Each evidence draws from a stream of its own.
    executor : concurrent.futures.Executor, optional
        Runs the evidences; one after the other in this process if not given.
    progress : callable, optional
        Called with a line of text now and then.
    laplace_only : bool, optional
        Take Laplace's approximation, which is low by 0.1 to 0.3 under normal errors and by up to 2
        under Student errors, where importance sampling would be asked.

    Returns
    -------
    pandas.DataFrame
        Columns of `evidence.csv`, one row each: by quadrature where rows are exact and independent,
        by importance sampling where an error model's mean evidence comes within four units of the
        highest, by Laplace's approximation otherwise. A pair without a usable evidence says why in
        its status.

    Raises
    ------
    InputError
        If no row can be fitted, or a form may not be fitted to these rows.
    ComputationError
        If workers die, so that an evidence cannot be found; it is named.
    """
    for form in forms:
        refuse_circular(table, form)
    data = Observations.from_table(table)
    pairs = list(itertools.product(forms, noises))
    seeds = [int(stream(seed, f.name, n.name).integers(2**63)) for f, n in pairs]

    def evaluated(tasks: Sequence["_Weighing"]) -> list["_Weighed"]:
        if tasks and progress is not None:
            progress(f"{len(tasks)} evidences")
        return list(map_ordered(_evaluate, tasks, executor, name=lambda task: task.name))

    tasks = [_Weighing(data, *pair, one) for pair, one in zip(pairs, seeds, strict=True)]
    screened = evaluated(tasks)
    found = [one.evidence for one in screened]
    means = mean_evidence(_frame(forms, pairs, found)).set_index("noise")["log_mean_evidence"]
    close = (
        []
        if laplace_only
        else [
            i
            for i, (_, noise) in enumerate(pairs)
            if found[i].method == "laplace"
            and means.get(noise.name, -math.inf) > means.max() - _CLOSE
        ]
    )
    refined = evaluated([replace(tasks[i], laplace=screened[i].laplace) for i in close])
    for i, one in zip(close, refined, strict=True):
        found[i] = one.evidence if one.evidence.ok else found[i]
    frame = _frame(forms, pairs, found)
    for noise in frame["noise"].unique():
        here = (frame["noise"] == noise) & frame["used"]
        values = frame.loc[here, "log_evidence"]
        frame.loc[here, "model_probability"] = np.exp(values - logsumexp(values))
    return frame


def _frame(
    forms: Sequence[Form], pairs: Sequence[tuple[Form, Noise]], found: Sequence[LogEvidence]
) -> pd.DataFrame:
    rows = [
        (form.name, noise.name, e.method, e.value, e.se, e.ok, 1 / len(forms), math.nan, e.status)
        for (form, noise), e in zip(pairs, found, strict=True)
    ]
    return pd.DataFrame(rows, columns=EVIDENCE_COLUMNS)


@dataclass(frozen=True, eq=False)
class _Weighing:
    """One evidence to be found; holds all that a process of its own needs.

    With the approximation that its screening found, the evidence is refined.
    """

    data: Observations
    form: Form
    noise: Noise
    seed: int
    laplace: Laplace | None = None

    @property
    def name(self) -> str:
        return f"evidence of {self.form.name}, {self.noise.name}"


@dataclass(frozen=True, eq=False)
class _Weighed:
    """An evidence, and the normal approximation that was found on the way."""

    evidence: LogEvidence
    laplace: Laplace | None = None


def _evaluate(task: _Weighing) -> _Weighed:
    """Screen an evidence, or refine it where the approximation is known."""
    if task.laplace is not None:
        return _refined(task, task.laplace)
    try:
        return _screened(Model(task.data, task.form, task.noise))
    except ComputationError as error:
        return _Weighed(LogEvidence("laplace", math.nan, math.nan, str(error)))


def _screened(model: Model) -> _Weighed:
    if model.is_iid_gaussian and isinstance(model.form, PowerLaw):
        return _Weighed(power_law_evidence(model))
    laplace = fit_laplace(model)
    if model.is_iid_gaussian:
        found = quadrature_evidence(model.log_density, laplace)
        if found.ok:
            return _Weighed(found)
    return _Weighed(laplace_evidence(laplace), laplace)


def _refined(task: _Weighing, laplace: Laplace) -> _Weighed:
    model = Model(task.data, task.form, task.noise)
    laplace = replace(laplace, other_modes=several_modes(model, laplace))
    return _Weighed(importance_posterior(model, laplace, seed=task.seed, **_EFFORT)[1])


def mean_evidence(evidence: pd.DataFrame) -> pd.DataFrame:
    """Return the log of the mean evidence over the forms, by error model, highest first.

    Parameters
    ----------
    evidence : pandas.DataFrame
        As `weigh_error_models` returns it, or `evidence.csv` of a run.

    Returns
    -------
    pandas.DataFrame
        Columns noise, log_mean_evidence, probability (at equal prior), n_form. A form without an
        evidence under an error model counts there as evidence zero.

    Examples
    --------
    >>> rows = pd.DataFrame({"form": ["a", "b"] * 2, "noise": ["iid", "iid", "step", "step"],
    ...     "method": "quadrature", "log_evidence": [0.0, 0.0, 1.0, 1.0], "used": True})
    >>> mean_evidence(rows)["noise"].tolist()
    ['step', 'iid']
    """
    one = used_evidence(evidence)
    n_form = one["form"].nunique()
    rows = [
        (noise, float(logsumexp(part["log_evidence"])) - math.log(n_form), len(part))
        for noise, part in one.groupby("noise", sort=False)
    ]
    frame = pd.DataFrame(rows, columns=["noise", "log_mean_evidence", "n_form"])
    share = np.exp(frame["log_mean_evidence"] - logsumexp(frame["log_mean_evidence"]))
    frame.insert(2, "probability", share)
    return frame.sort_values("log_mean_evidence", ascending=False, kind="stable", ignore_index=True)


def chosen_error_model(evidence: pd.DataFrame) -> str:
    """Return the name of the error model with the highest mean evidence over the forms.

    Raises
    ------
    ComputationError
        If no form has an evidence under any.
    """
    if used_evidence(evidence).empty:
        raise ComputationError("no form has an evidence under any error model")
    return str(mean_evidence(evidence)["noise"].iloc[0])
