"""Requests to `run`, `compare` and `fit`, as typed and as objects."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, fields, replace
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

from ridgebayes.commands import options
from ridgebayes.commands.parsing import parse_odds
from ridgebayes.comparison.compare import DEFAULT_FORMS, Execution, check_odds, compare_with
from ridgebayes.comparison.comparison import Comparison
from ridgebayes.errors import InputError
from ridgebayes.inference.chains import SampleSettings
from ridgebayes.inference.presets import STANDARD, Preset
from ridgebayes.model.forms import Form, form_named
from ridgebayes.model.noise import AUTO, Noise, error_models_for
from ridgebayes.model.observations import Observations, refuse_circular
from ridgebayes.model.prior_files import ResolvedPriors, resolve_priors
from ridgebayes.runtime.progress import Progress
from ridgebayes.runtime.reading import read_toml
from ridgebayes.table.datafiles import paper_sweep
from ridgebayes.table.table import ContactTable, read_table

EMBEDDED = "embedded sweep"


@dataclass(frozen=True)
class FitRequest:
    """Table and forms to fit, with their options, as typed.

    Parameters
    ----------
    table : Path, optional
        Contact table; the embedded sweep if not given.
    forms : sequence of str, optional
        Form names; the four printed ones if not given.
    noise : str, optional
        Error model; ``auto`` weighs all that suit the table.
    seed : int, optional
        Seed of all draws.
    accuracy : str, optional
        Name of one of `ridgebayes.inference.presets`.
    priors : Path, optional
        File of priors that replace default ones, see `ridgebayes.model.prior_files`.
    prior_odds : mapping of str to float, optional
        Prior odds of forms; forms that are not named have 1.
    time_limit : float, optional
        Seconds after which a walk ends with what is there.
    settings : SampleSettings, optional
        Lengths and thresholds of sampling, instead of those of `accuracy`.
    """

    table: Path | None = None
    forms: Sequence[str] = ()
    noise: str = AUTO
    seed: int = 0
    accuracy: str = STANDARD.name
    priors: Path | None = None
    prior_odds: Mapping[str, float] = field(default_factory=dict)
    time_limit: float | None = None
    settings: SampleSettings | None = None

    @classmethod
    def of(
        cls, asked: options.Run | options.Fit | options.Compare, forms: Sequence[str]
    ) -> "FitRequest":
        """Return what a command line asks for."""
        known: dict[str, Any] = {one.name: getattr(asked, one.name, None) for one in fields(cls)}
        odds = parse_odds(getattr(asked, "prior_odds", ""))
        return cls(**known | {"forms": forms, "prior_odds": odds})

    @property
    def options(self) -> dict[str, Any]:
        """Options as run.json lists them."""
        return {
            "table": str(self.table) if self.table else None,
            "forms": list(self.forms),
            "noise": self.noise,
            "accuracy": self.accuracy,
            "priors": str(self.priors) if self.priors else None,
            "prior_odds": dict(self.prior_odds) or None,
            "time_limit": self.time_limit,
        }

    def resolve(self) -> "Inputs":
        """Read the table and find forms, error model and preset by their names.

        Raises
        ------
        InputError
            If a name is unknown or given twice, or a form may not be fitted to the table.
        """
        if len(set(self.forms)) < len(self.forms):
            raise InputError(f"forms: expected each once, got {', '.join(self.forms)}")
        forms = tuple(form_named(name) for name in self.forms) or DEFAULT_FORMS
        if self.table is None:
            table = replace(paper_sweep(), where=EMBEDDED)
        else:
            table = read_table(self.table)
        return self.on(table, forms)

    def on(self, table: ContactTable, forms: Sequence[Form]) -> "Inputs":
        """Return what is asked for, of another table and other forms.

        Raises
        ------
        InputError
            If a form may not be fitted to the table, or a prior is of none of them.
        """
        for form in forms:
            refuse_circular(table, form)
        odds = check_odds(self.prior_odds, [form.name for form in forms], "--prior-odds")
        data = Observations.from_table(table)  # refuses rows that cannot be fitted
        noise = AUTO if self.noise == AUTO else Noise.named(self.noise)
        priors = {}
        if self.priors:
            content, where = read_toml(self.priors), str(self.priors)
            noises, folder = error_models_for(noise, data.n_series), self.priors.parent
            priors = resolve_priors(content, forms, noises, data, where=where, folder=folder)
        accuracy, settings = Preset.named(self.accuracy), self.settings
        if self.time_limit is not None and (settings or accuracy.walks):
            settings = replace(settings or accuracy.settings, time_limit=self.time_limit)
        return Inputs(table, forms, noise, accuracy, self.seed, settings, priors, odds)


@dataclass(frozen=True, eq=False)
class Inputs:
    """Table and forms to fit, with their options, as objects: see `FitRequest`."""

    table: ContactTable
    forms: Sequence[Form]
    noise: str | Noise
    accuracy: Preset
    seed: int
    settings: SampleSettings | None
    priors: ResolvedPriors = field(default_factory=dict)
    prior_odds: Mapping[str, float] = field(default_factory=dict)

    @property
    def walked(self) -> Sequence[Form]:
        """Forms that are walked unless they are negligible."""
        return self.forms if self.settings or self.accuracy.walks else ()

    def compare(
        self,
        progress: Progress,
        folder: Path,
        executor: Executor | None = None,
        *,
        scores: bool = True,
    ) -> Comparison:
        """Compare the forms; chains are kept in a folder as they grow."""
        # No daemon: an import that is cut off when the interpreter ends crashes it.
        drawing = Thread(target=import_module, args=("ridgebayes.drawing.predictions",))

        def stage(name: str) -> AbstractContextManager[Callable[[float], None]]:
            # From here on this process often waits for workers: time for what figures import.
            if executor is not None and drawing.ident is None:
                drawing.start()
            return progress.stage(name)

        execution = Execution(
            self.accuracy, self.settings, executor, progress.detail, stage, folder, scores
        )
        return compare_with(
            execution,
            self.table,
            self.forms,
            noise=self.noise,
            priors=self.priors,
            prior_odds=self.prior_odds,
            rng=self.seed,
        )
