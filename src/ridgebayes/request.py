"""Validated request for a calibration or comparison."""

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
from ridgebayes.errors import InputError, expect
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
    """Rows, forms and options of a calibration or comparison.

    Parameters
    ----------
    table : ContactTable
        Table whose rows of role calibration and status ok are fitted.
    data : Observations
        The fitted rows.
    forms : sequence of Form
        Forms to fit.
    noises : sequence of Noise
        Error models to weigh.
    priors : mapping of str to mapping of str to Distribution
        Replacements for default priors, by form or ``noise``, and parameter.
    prior_odds : mapping of str to float
        Prior odds by form; the default is 1.
    accuracy : Preset
        Target errors of draws and evidences.
    seed : int
        Seed of all draws.
    settings : SampleSettings, optional
        Lengths and thresholds of walks, instead of those of `accuracy`.
    executor : concurrent.futures.Executor, optional
        Executor of the fits, which run in turn in this process if not given.
    progress : callable, optional
        Called with a line of text from time to time.
    stage : callable, optional
        Called with the name of a stage; returns a context manager for it.
    checkpoints : Path, optional
        Folder in which growing chains are saved.
    scores : bool, optional
        Whether to compute leave-one-out scores and prior sensitivity, which dominate the run time
        with many textures.
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

    def __post_init__(self) -> None:
        expect(SampleSettings, None, settings=self.settings)
        expect(Callable, None, progress=self.progress)

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
        """Validate the arguments of a caller; see `compare` for the parameters.

        Raises
        ------
        InputError
            See `compare`.
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
        preset = accuracy if isinstance(accuracy, Preset) else Preset.named(accuracy)
        data = Observations.from_table(rows)  # refuses rows that cannot be fitted
        noises = error_models_for(noise, data.n_series)
        if not preset.extras and len(noises) > 1:  # quick runs use normal errors only
            noises = [candidate for candidate in noises if candidate.tail == "normal"]
        return cls(
            table=rows,
            data=data,
            forms=chosen,
            noises=noises,
            priors=resolve_priors(priors, chosen, noises, data),
            prior_odds=_checked_odds({} if prior_odds is None else prior_odds, names),
            accuracy=preset,
            seed=seed_of(rng),
            settings=settings,
        )

    @property
    def walked(self) -> Sequence[Form]:
        """Forms that are sampled by a walk unless they are negligible."""
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
    """Return the prior odds of forms; invalid odds raise InputError."""
    if not isinstance(prior_odds, Mapping):
        raise InputError(f"prior odds: expected a mapping of forms to numbers, got {prior_odds!r}")
    for name, odds in prior_odds.items():
        if name not in forms:
            raise InputError(
                f"prior odds: expected forms that are compared ({', '.join(forms)}), got {name!r}"
            )
        if isinstance(odds, bool) or not isinstance(odds, Real) or not 0 < odds < math.inf:
            raise InputError(f"prior odds: {name}: expected a finite number > 0, got {odds!r}")
    return {name: float(odds) for name, odds in prior_odds.items()}
