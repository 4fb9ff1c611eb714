"""The options of `ridgebayes design`. Nothing heavy is loaded here, so that help is quick."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from ridgebayes.commands.shared_options import Force, OutFolder, RunFolder, Seed


@dataclass(frozen=True)
class DesignOptions:
    """Find textures that meet a goal under all uncertainties, from a finished run."""

    folder: RunFolder
    scene: Annotated[Path, typer.Option(help="Scene file: body and load, also as distributions.")]
    goal: Annotated[
        list[str],
        typer.Option(
            help="Such as 'P(Q >= 8) >= 0.95', 'P(6 <= Q <= 10 at p/E = 0.01) >= 90 %', "
            "'P(Q(0.2 N) < 8 <= Q(0.8 N)) >= 0.9' or 'sd(Q) <= 1'. May be repeated."
        ),
    ]
    a: Annotated[
        str | None,
        typer.Option(help="Ridge widths LO:HI over the radius, or with units. Those calibrated."),
    ] = None
    b: Annotated[str | None, typer.Option(help="Groove widths LO:HI, in the same way.")] = None
    step: Annotated[
        str | None,
        typer.Option(help="Widths that can be made are its multiples, such as '10 um'."),
    ] = None
    tolerance: Annotated[
        str | None,
        typer.Option(
            help="Standard deviation of both widths as made, '5 %' or '10 um', or bounds, "
            "'worst 5 %'."
        ),
    ] = None
    p_over_E: Annotated[
        str | None,
        typer.Option(
            "--p-over-E",
            help="Loads of goals that name none, p/E or with units, LO:HI:N or log:LO:HI:N: the "
            "worst counts, or of min-load the smallest that will do. The scene's largest.",
        ),
    ] = None
    objective: Annotated[
        str,
        typer.Option(
            help="margin, max-pitch, min-pitch, max-ridge, min-ridge, max-groove, min-groove or "
            "min-load: which feasible texture is recommended."
        ),
    ] = "margin"
    seed: Seed = 0
    out: OutFolder = Path("ridgebayes-design")
    force: Force = False
