"""Options of several commands and of all commands, and their conversion to typer parameters."""

import re
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from inspect import Parameter, cleandoc, signature
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin

import typer
from typer.models import OptionInfo

DEFAULT_OUT = Path("ridgebayes-out")
_T = TypeVar("_T")
Argument = Annotated[_T, typer.Argument()]  # positional; all other fields are options
Positive = Annotated[_T, typer.Option(min=1)]
Natural = Annotated[_T, typer.Option(min=0)]
# Options whose names differ from those of their fields.
FLAGS = {
    "out": ("-o", "--out"),
    "quiet": ("--quiet", "-q"),
    "verbose": ("--verbose", "-v"),
    "as_json": ("--json",),
    "program": ("--format",),
    "mapping": ("--map",),
    "elements": ("--elements/--no-elements",),
}


class Shared:
    r"""Fields that several records of options have.

    Parameters
    ----------
    accuracy : str
        Preset that trades accuracy for run time: quick, standard or reference.
    folder : Path
        Folder of a finished run.
    force : bool
        Replace an existing output.
    forms : str, optional
        Comma-separated forms: classic, power-law, modified, hybrid, half-plane. The first
        four if not given.
    noise : str
        Error model: auto, STRUCTURE or STRUCTURE:student, where STRUCTURE is one of iid,
        texture, step, texture+step, step-smooth, each also with +series where a table has
        several series or sources. auto weighs all that suit the table by their evidence, and
        averages over them.
    out : Path
        Folder to create.
    priors : Path, optional
        TOML file of priors: \[hybrid] c1 = 'lognormal(1.382, 0.1)'.
    prior_odds : str
        Prior odds of forms, such as hybrid=2,classic=0.5; forms that are not named have 1.
        Bayes factors do not depend on them.
    resume : bool
        Continue an interrupted run. Results are the same as without interruption.
    scheduler : str, optional
        Dask scheduler tcp://HOST:PORT whose workers compute.
    seed : int
        Random seed. The same seed gives the same numbers.
    time_limit : float, optional
        Seconds that emcee's walk of each form may take. When time is up, the walk counts as
        not converged and the exit code is 1. Importance sampling has no limit.
    workers : int, optional
        Worker processes. Results do not depend on their number.
    """


@dataclass(frozen=True)
class Output:
    """Output options of all commands.

    Parameters
    ----------
    quiet : bool, optional
        Print only errors.
    verbose : bool, optional
        Print more, with progress.
    as_json : bool, optional
        Print one JSON object instead of text.
    """

    quiet: bool = False
    verbose: bool = False
    as_json: bool = False

    @property
    def verbosity(self) -> int:
        """Verbosity -1, 0 or 1, as in `ridgebayes.runtime.progress.VERBOSITY`."""
        return -1 if self.quiet else int(self.verbose)


def help_of(record: type[Any]) -> tuple[str, dict[str, str]]:
    """Return the help text of a record and of each field, from its docstring."""
    words, _, rest = cleandoc(record.__doc__ or "").partition("Parameters\n----------\n")
    parts = re.split(r"^(\w+) : .*\n", rest, flags=re.MULTILINE)
    texts = (" ".join(text.split()) for text in parts[2::2])
    return words.strip(), dict(zip(parts[1::2], texts, strict=True))


def parameters_of(record: type[Any]) -> Iterator[Parameter]:
    """Yield the fields of a record as parameters that typer converts to arguments and options."""
    texts = help_of(Shared)[1] | help_of(record)[1]
    for parameter in signature(record).parameters.values():
        kind, mark = parameter.annotation, typer.Option()
        if get_origin(kind) is Annotated:
            kind, mark = get_args(kind)[0], copy(get_args(kind)[1])
        mark.help = texts.get(parameter.name, "")
        if isinstance(mark, OptionInfo):
            mark.metavar = "" if kind is bool else None  # a flag takes no value
            mark.param_decls = FLAGS.get(parameter.name, (f"--{parameter.name.replace('_', '-')}",))
        yield parameter.replace(annotation=Annotated[kind, mark], kind=Parameter.KEYWORD_ONLY)
