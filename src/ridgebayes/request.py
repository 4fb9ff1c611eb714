"""The request for a calibration or comparison, checked and in one record."""

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import TypeAlias

import pandas as pd

from ridgebayes._types import Rng
from ridgebayes.errors import InputError
from ridgebayes.evidence.pairs import WeighedPairs, weigh_pairs
from ridgebayes.inference.chains import ProgressCallback, SampleSettings
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.forms import Classic, Form, Hybrid, Modified, PowerLaw, as_form
from ridgebayes.model.noise import AUTO, Noise, error_models_for
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.model.prior_files import Priors, ResolvedPriors, resolve_priors
from ridgebayes.runtime.progress import untimed
from ridgebayes.runtime.randomness import seed_of
from ridgebayes.table.table import ContactTable, read_table

DEFAULT_FORMS: tuple[Form, ...] = (Classic(), PowerLaw(), Modified(), Hybrid())
StageTimer = Callable[[str], AbstractContextManager[Callable[[float], None]]]
TableLike: TypeAlias = ContactTable | pd.DataFrame | str | os.PathLike[str]
FormsLike: TypeAlias = Sequence[Form | str] | Form | str
PriorsLike: TypeAlias = Priors | str | os.PathLike[str]


@dataclass(frozen=True, eq=False, kw_only=True)
class Request:
    """Rows and forms to fit, how accurately, where it is computed, and what is kept.

    Parameters
    ----------
    table : ContactTable
        Rows of role calibration and status ok are fitted.
    data : Observations
        These rows.
    forms : sequence of Form
        Forms to fit.
    noises : sequence of Noise
        Error models to weigh.
    priors : mapping of str to mapping of str to Distribution
        Replacements for default priors, by form or ``noise``, and parameter.
    prior_odds : mapping of str to float
        Prior odds by form; forms that are not named have 1.
    accuracy : Preset
        Target errors of draws and evidences.
    seed : int
        Seed of all draws.
    settings : SampleSettings, optional
        Lengths and thresholds of walks, in place of those of `accuracy`.
    executor : concurrent.futures.Executor, optional
        Runs the fits; one after the other in this process if not given.
    progress : callable, optional
        Called with a line of text now and then.
    stage : callable, optional
        Called with a stage's name, returns a context manager around it.
    checkpoints : Path, optional
        Folder in which the chains are kept as they grow.
    scores : bool, optional
        Whether leave-one-out scores and prior sensitivity are computed, which take far longer than
        the rest where textures are very many.
    """

    table: ContactTable
    data: Observations
    forms: Sequence[Form]
    noises: Sequence[Noise]
    priors: ResolvedPriors
    prior_odds: Mapping[str, float]
    accuracy: Preset
    seed: int
    settings: SampleSettings | None = None
    executor: Executor | None = None
    progress: ProgressCallback | None = None
    stage: StageTimer = untimed
    checkpoints: Path | None = None
    scores: bool = True

    @classmethod
    def of(
        cls,
        table: TableLike,
        forms: FormsLike = DEFAULT_FORMS,
        *,
        noise: str | Noise = AUTO,
        priors: PriorsLike | None = None,
        prior_odds: Mapping[str, float] | None = None,
        accuracy: Preset | str = STANDARD,
        rng: Rng = 0,
        settings: SampleSettings | None = None,
    ) -> "Request":
        """Read and check what a caller gives; parameters are those of `compare`.

        Raises
        ------
        InputError
            As `compare`.
        """
        rows = read_table(table)
        if isinstance(forms, Form | str) or not isinstance(forms, Iterable):
            forms = [forms]
        chosen = [as_form(form) for form in forms]
        names = [form.name for form in chosen]
        if not names or len(set(names)) < len(names):
            raise InputError(
                f"forms: expected one or more, without repeats, got {', '.join(names) or 'none'}"
            )
        for form in chosen:
            refuse_circular(rows, form)
        preset = Preset.named(accuracy) if isinstance(accuracy, str) else accuracy
        data = Observations.from_table(rows)  # refuses rows that cannot be fitted
        noises = error_models_for(noise, data.n_series)
        if not preset.extras and len(noises) > 1:  # a quick run
            noises = [candidate for candidate in noises if candidate.tail == "normal"]
        return cls(
            table=rows,
            data=data,
            forms=chosen,
            noises=noises,
            priors=resolve_priors(priors, chosen, noises, data),
            prior_odds=_checked_odds(prior_odds or {}, names),
            accuracy=preset,
            seed=seed_of(rng),
            settings=settings,
        )

    @property
    def walked(self) -> Sequence[Form]:
        """Forms that are walked unless they are negligible."""
        return self.forms if self.settings or self.accuracy.walks else ()

    def weigh(self) -> WeighedPairs:
        """Return the posterior and evidence of every form under every error model."""
        return weigh_pairs(
            self.data,
            self.forms,
            self.noises,
            priors=self.priors,
            seed=self.seed,
            executor=self.executor,
            progress=self.progress,
            accuracy=self.accuracy,
        )


def _checked_odds(prior_odds: Mapping[str, float], forms: Sequence[str]) -> dict[str, float]:
    """Return prior odds of forms, or raise InputError that names the form, the value, the rule."""
    for name, odds in prior_odds.items():
        if name not in forms:
            raise InputError(
                f"prior odds: expected forms that are compared ({', '.join(forms)}), got {name!r}"
            )
        if isinstance(odds, bool) or not isinstance(odds, Real) or not 0 < odds < math.inf:
            raise InputError(f"prior odds: {name}: expected a finite number > 0, got {odds!r}")
    return {name: float(odds) for name, odds in prior_odds.items()}
