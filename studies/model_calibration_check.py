"""Simulation-based calibration of model probabilities: of forms given 30 %, 30 % have to be true.

A form is drawn from the prior over forms, parameters from its prior, rows under them; the evidences
of those rows give every form its posterior probability. Averaged over simulations it has to be the
prior's, and among simulations in which it is about p, the form has to be the true one in a share p.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import pandas as pd
from scipy import stats
from scipy.special import softmax

from ridgebayes._types import Rng
from ridgebayes.distributions.distribution import Distribution
from ridgebayes.errors import ComputationError, InputError
from ridgebayes.inference.log_evidence import LogEvidence
from ridgebayes.model.forms import Form
from ridgebayes.model.model import Model
from ridgebayes.model.noise import Noise, as_noise
from ridgebayes.model.observations import Observations
from ridgebayes.model.replicated import is_possible, simulate_log_loads
from ridgebayes.runtime.pool import map_ordered
from ridgebayes.runtime.randomness import seed_of, stream
from studies.calibration_check import FAILURE_COLUMNS, exact_places
from tests.drawn import drawn_posterior
from tests.simulated import simulated

PROBABILITY_COLUMNS = ["replicate", "form", "true", "probability"]
AVERAGE_COLUMNS = ["form", "prior", "average", "se", "share_true", "z"]
BIN_COLUMNS = ["form", "low", "high", "n", "mean_probability", "share_true", "p_value"]


class Weigh(Protocol):
    """What estimates an evidence."""

    def __call__(self, model: Model, *, seed: int) -> LogEvidence:
        """Return the log evidence."""


@dataclass(frozen=True, eq=False)
class ModelSBC:
    """Posterior probabilities of forms over many simulated sets of rows.

    Parameters
    ----------
    forms : tuple of str
        Names of the forms, equally probable beforehand.
    noise : str
        Name of the error model, the same for all.
    n_replicate : int
        Simulated sets of rows.
    probabilities : pandas.DataFrame
        Columns replicate, form, true (whether that form made the rows), probability.
    failures : pandas.DataFrame
        Columns replicate, reason: rows for which a form had no usable evidence. They are counted,
        and take no part in the averages; given its rows an evidence fails or not whatever form
        was true.
    """

    forms: tuple[str, ...]
    noise: str
    n_replicate: int
    probabilities: pd.DataFrame
    failures: pd.DataFrame

    @property
    def n_failed(self) -> int:
        """Sets of rows for which a form had no usable evidence."""
        return self.failures["replicate"].nunique()

    def averages(self) -> pd.DataFrame:
        """Return each form's average probability beside the prior's.

        Returns
        -------
        pandas.DataFrame
            Columns form, prior, average, se (Monte Carlo standard error of the average),
            share_true (how often that form was drawn), z (share_true less average in standard
            errors of the difference, standard normal if probabilities are calibrated: sharper than
            the average alone, whose scatter it does not have).
        """
        rows = []
        for form, own in self._by_form():
            p, true = own["probability"].to_numpy(), own["true"].to_numpy(float)
            spread = np.sqrt((p * (1 - p)).sum())
            rows.append(
                {
                    "form": form,
                    "prior": 1 / len(self.forms),
                    "average": p.mean(),
                    "se": p.std(ddof=1) / np.sqrt(len(p)),
                    "share_true": true.mean(),
                    "z": (true - p).sum() / spread if spread > 0 else 0.0,
                }
            )
        return pd.DataFrame(rows, columns=AVERAGE_COLUMNS)

    def calibration(self, n_bin: int = 5) -> pd.DataFrame:
        """Return how often a form was the true one, by what probability it was given.

        Parameters
        ----------
        n_bin : int, optional
            Equal parts of 0 to 1.

        Returns
        -------
        pandas.DataFrame
            A row for each form and bin that holds any: columns form, low, high, n,
            mean_probability, share_true, p_value (of so many true ones or a less probable number,
            each being true with the bin's mean probability).
        """
        if n_bin < 1:
            raise InputError(f"n_bin: expected at least 1, got {n_bin}")
        rows = []
        for form, own in self._by_form():
            place = np.minimum((own["probability"] * n_bin).astype(int), n_bin - 1)
            for i in range(n_bin):
                part = own[place == i]
                if part.empty:
                    continue
                k, n, p = int(part["true"].sum()), len(part), float(part["probability"].mean())
                rows.append(
                    {
                        "form": form,
                        "low": i / n_bin,
                        "high": (i + 1) / n_bin,
                        "n": n,
                        "mean_probability": p,
                        "share_true": k / n,
                        "p_value": stats.binomtest(k, n, min(p, 1.0)).pvalue,
                    }
                )
        return pd.DataFrame(rows, columns=BIN_COLUMNS)

    def _by_form(self) -> list[tuple[str, pd.DataFrame]]:
        if len(self.probabilities) < 2 * len(self.forms):
            raise ComputationError(
                f"{self.noise}: fewer than 2 of {self.n_replicate} could be used"
            )
        grouped = self.probabilities.groupby("form", sort=False)
        return [(str(form), own) for form, own in grouped]


@dataclass(frozen=True, eq=False)
class _Replication:
    """One simulated set of rows, weighed under every form."""

    places: Observations
    forms: tuple[Form, ...]
    noise: Noise
    priors: Mapping[str, Distribution]
    weigh: Weigh
    seed: int

    def __call__(self, replicate: int) -> tuple[list[dict[str, object]], str]:
        seed = int(stream(self.seed, f"replicate {replicate}").integers(2**63))
        rows, true = self._drawn(stream(seed, "simulate"))
        found: dict[str, LogEvidence] = {}
        for form in self.forms:
            try:
                own_seed = int(stream(seed, form.name).integers(2**63))
                evidence = self.weigh(self._model(rows, form), seed=own_seed)
            except ComputationError as error:
                return [], f"{form.name}: {error}"
            if not evidence.ok:
                return [], f"{form.name}: {evidence.status}"
            found[form.name] = evidence
        shares = softmax([evidence.value for evidence in found.values()])
        return [
            {"replicate": replicate, "form": name, "true": name == true, "probability": float(p)}
            for name, p in zip(found, shares, strict=True)
        ], ""

    def _drawn(self, rng: np.random.Generator) -> tuple[Observations, str]:
        """Draw form and parameters together until rows follow from them.

        Drawing parameters alone anew would favour forms that often have none.
        """
        for _ in range(10_000):
            form = self.forms[rng.integers(len(self.forms))]
            model = self._model(self.places, form)
            theta = np.array([prior.rvs(rng, 1)[0] for prior in model.priors.values()])
            if is_possible(model, theta):
                return simulated(self.places, simulate_log_loads(model, theta, rng)[0]), form.name
        raise ComputationError("no form has rows under its prior; expected positive rates")

    def _model(self, rows: Observations, form: Form) -> Model:
        names = Model(rows, form, self.noise).priors
        own = {name: prior for name, prior in self.priors.items() if name in names}
        return Model(rows, form, self.noise, own)


def _by_importance(model: Model, *, seed: int) -> LogEvidence:
    return drawn_posterior(model, seed=seed).evidence


def model_sbc(
    data: Observations,
    forms: Sequence[Form],
    noise: str | Noise = "iid",
    *,
    n_replicate: int = 200,
    rng: Rng = 0,
    priors: Mapping[str, Distribution] | None = None,
    weigh: Weigh = _by_importance,
    executor: Executor | None = None,
) -> ModelSBC:
    """Weigh forms on rows that one of them made, over many simulated sets of rows.

    Parameters
    ----------
    data : Observations
        Rows that give textures, counts and known errors; all are simulated as exact loads.
    forms : sequence of Form
        Forms, of equal prior probability.
    noise : str or Noise, optional
        Error model of all.
    n_replicate : int, optional
        Simulated sets of rows.
    rng : int or numpy.random.Generator, optional
        Seed; each replicate has a stream of its own.
    priors : mapping of str to Distribution, optional
        Replacements for default priors, for the forms that have such a parameter.
    weigh : callable, optional
        What makes a LogEvidence of a Model and a ``seed``: importance sampling if not given.
    executor : concurrent.futures.Executor, optional
        What replicates are computed on; one after another if not given. The result is the same.

    Returns
    -------
    ModelSBC
        Probabilities, and which rows could not be weighed.

    Raises
    ------
    InputError
        If fewer than two forms are given, one is given twice, or `n_replicate` is under 2.

    References
    ----------
    Schad et al. (2023), doi:10.1037/met0000472.
    """
    names = tuple(form.name for form in forms)
    if len(names) < 2 or len(set(names)) < len(names):
        raise InputError(
            f"forms: expected two or more, each once, got {', '.join(names) or 'none'}"
        )
    if n_replicate < 2:
        raise InputError(f"n_replicate: expected at least 2, got {n_replicate}")
    error_model = as_noise(noise)
    places = exact_places(data)
    run = _Replication(places, tuple(forms), error_model, priors or {}, weigh, seed_of(rng))
    rows: list[dict[str, object]] = []
    failures: list[dict[str, object]] = []
    found = map_ordered(run, range(n_replicate), executor, name=lambda i: f"replicate {i}")
    for i, (own, reason) in enumerate(found):
        rows += own
        if reason:
            failures.append({"replicate": i, "reason": reason})
    return ModelSBC(
        names,
        error_model.name,
        n_replicate,
        pd.DataFrame(rows, columns=PROBABILITY_COLUMNS),
        pd.DataFrame(failures, columns=FAILURE_COLUMNS),
    )
