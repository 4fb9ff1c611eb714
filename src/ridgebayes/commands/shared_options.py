"""Options that several commands share, defined once, and those of every command."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

DEFAULT_OUT = Path("ridgebayes-out")
NOISE_NAMES = (
    "STRUCTURE or STRUCTURE:student, where STRUCTURE is one of iid, texture, step, "
    "texture+step, step-smooth, each also with +series where a table has several series "
    "or sources."
)
Accuracy = Annotated[
    str,
    typer.Option(
        "--accuracy",
        help="Preset that trades accuracy for run time: quick, standard or reference.",
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace an existing output.")]
Forms = Annotated[
    str,
    typer.Option(
        help="Comma-separated forms: classic, power-law, modified, hybrid, half-plane. "
        "The first four if not given."
    ),
]
NoiseName = Annotated[
    str,
    typer.Option(
        help=f"Error model: auto, {NOISE_NAMES} auto weighs all that suit the table and averages "
        "over them."
    ),
]
OutFile = Annotated[Path, typer.Option("-o", "--out", help="File to write.")]
OutFolder = Annotated[Path, typer.Option("-o", "--out", help="Folder to create.")]
Priors = Annotated[
    Path | None,
    typer.Option(help="TOML file of priors: \\[hybrid] c1 = 'lognormal(1.382, 0.1)'."),
]
Resume = Annotated[
    bool, typer.Option("--resume", help="Continue an interrupted run. The results are the same.")
]
RunFolder = Annotated[Path, typer.Argument(help="Folder of a finished run.")]
Scheduler = Annotated[
    str | None, typer.Option(help="Dask scheduler tcp://HOST:PORT whose workers compute.")
]
Seed = Annotated[
    int, typer.Option(min=0, help="Random seed. The same seed gives the same numbers.")
]
TEXTURES = typer.Option(help="A,B: ridge and groove width over the radius. May be repeated.")
Table = Annotated[Path, typer.Argument(help="Contact table, .csv or .parquet.")]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        help="Seconds that each walk by emcee may take, one a form. One that is stopped is "
        "written as it is, with exit code 1. Weighing error models and importance sampling are "
        "not stopped. No limit if not given."
    ),
]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Worker processes. Results do not depend on them.")
]


@dataclass(frozen=True)
class Output:
    """What every command may be told of its output."""

    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print errors alone.")] = False
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Print more, and how far the work is.")
    ] = False
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of text.")
    ] = False

    @property
    def verbosity(self) -> int:
        """As `ridgebayes.runtime.progress.VERBOSITY`."""
        return -1 if self.quiet else int(self.verbose)
