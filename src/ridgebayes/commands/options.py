"""Options that several commands share, each defined once."""

from pathlib import Path
from typing import Annotated

import typer

NOISE_NAMES = (
    "STRUCTURE or STRUCTURE:student, where STRUCTURE is one of iid, texture, step, texture+step, "
    "step-smooth."
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
NoiseName = Annotated[str, typer.Option(help=f"Error model: {NOISE_NAMES}")]
Nu = Annotated[float, typer.Option(help="Poisson's ratio.")]
OutFile = Annotated[Path, typer.Option("-o", "--out", help="File to write.")]
OutFolder = Annotated[Path, typer.Option("-o", "--out", help="Folder to create.")]
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
Table = Annotated[Path, typer.Argument(help="Contact table, .csv or .parquet.")]
Workers = Annotated[
    int | None, typer.Option(min=1, help="Worker processes. Results do not depend on them.")
]
