"""The command line: which commands there are, their options, and errors turned into exit codes.

Exit code 0 is done, 1 a computation that failed or did not converge (what was finished is written),
2 bad input or usage (nothing written).

Functions here declare options and load nothing, so that help is quick. What a command does is the
function `command` of the module of its name, loaded when the command is called.
"""

import functools
import os
import signal
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

# One BLAS thread: the matrices are small, and threads only fight. Before numpy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from ridgebayes.commands import options
from ridgebayes.errors import ComputationError, InputError

DEFAULT_OUT = Path("ridgebayes-out")
app = typer.Typer(
    help="How many ridges does a soft body touch, how certain is that, and which contact model "
    "does the evidence support?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def load(name: str) -> ModuleType:
    """Import a module of the package when a command needs it; every other import is light."""
    return import_module(f"ridgebayes.{name}")


def command(name: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Register a command: a function declares its options, the module of its name does the work.

    What is in the function's body is done before that module is loaded.
    """

    def register(declared: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(declared)
        def call(**given: Any) -> None:
            declared(**given)
            load(f"commands.{declared.__name__}").command(**given)

        return app.command(name)(call)

    return register


@command("run")
def run(
    table: Annotated[
        Path | None, typer.Option(help="Contact table. The embedded sweep if not given.")
    ] = None,
    forms: options.Forms = "",
    noise: Annotated[
        str | None,
        typer.Option(
            help=f"Error model: {options.NOISE_NAMES} The one with the highest mean evidence if "
            "not given."
        ),
    ] = None,
    out: options.OutFolder = DEFAULT_OUT,
    force: options.Force = False,
    seed: options.Seed = 0,
    resume: options.Resume = False,
    accuracy: options.Accuracy = "standard",
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Worker processes. One for each processor if not given."),
    ] = None,
    scheduler: options.Scheduler = None,
) -> None:
    """Calibrate all forms, compare them, predict, and write a report."""
    if scheduler is None and workers != 1:
        # Workers import these at the same time as this process, so their server starts first.
        preloaded = (
            "ridgebayes.commands.run",
            "ridgebayes.report.figures.gallery",
            "arviz",
            "corner",
        )
        load("runtime.pool").start_server(preloaded)


@command("generate")
def generate(
    out: options.OutFile,
    scene: Annotated[
        Path | None, typer.Argument(help="Scene file. The paper's sweep if not given.")
    ] = None,
    texture: Annotated[
        list[str] | None,
        typer.Option(help="A,B: ridge and groove width over the radius. May be repeated."),
    ] = None,
    p_max: Annotated[float, typer.Option(help="Highest load p/E, with --texture.")] = 0.02,
    nu: Annotated[float, typer.Option(help="Poisson's ratio, with --texture.")] = 0.5,
    solver: Annotated[
        str, typer.Option(help="auto, hertz, half-plane, cylinder-linear or cylinder-fe.")
    ] = "auto",
    tol: Annotated[
        float | None,
        typer.Option(help="Relative tolerance of each load. Set by --accuracy if not given."),
    ] = None,
    accuracy: options.Accuracy = "standard",
    fields: Annotated[
        Path | None,
        typer.Option(help="Folder to create for finite-element fields: XDMF, CSV, figures."),
    ] = None,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    force: options.Force = False,
    resume: options.Resume = False,
) -> None:
    """Compute transition loads of textures and write them as a contact table."""


@command("fit")
def fit(
    table: options.Table,
    form: Annotated[str, typer.Option(help="Form to fit, such as hybrid.")],
    noise: options.NoiseName = "iid",
    out: options.OutFolder = DEFAULT_OUT,
    force: options.Force = False,
    seed: options.Seed = 0,
    resume: options.Resume = False,
    accuracy: options.Accuracy = "standard",
) -> None:
    """Sample the posterior of one form."""


@command("compare")
def compare(
    table: options.Table,
    forms: options.Forms = "",
    noise: options.NoiseName = "iid",
    out: options.OutFolder = DEFAULT_OUT,
    force: options.Force = False,
    seed: options.Seed = 0,
    accuracy: options.Accuracy = "standard",
) -> None:
    """Compare forms: evidences, Bayes factors, model probabilities, leave-one-out, stacking."""


@command("predict")
def predict(
    folder: options.RunFolder,
    texture: Annotated[
        list[str],
        typer.Option(help="A,B: ridge and groove width over the radius. May be repeated."),
    ],
    p_over_E: Annotated[
        str,
        typer.Option(
            "--p-over-E", help="Loads p/E as LO:HI:N, evenly spaced, or log:LO:HI:N, log-spaced."
        ),
    ],
    out: options.OutFile,
    nu: options.Nu = 0.5,
    form: Annotated[str, typer.Option(help="Form of the run, or average.")] = "average",
    prob: Annotated[float, typer.Option(help="Probability inside the band.")] = 0.9,
    force: options.Force = False,
) -> None:
    """Predict Q with uncertainty bands at given textures and loads, from a finished run."""


@command("coverage")
def coverage(
    table: Annotated[
        Path | None, typer.Argument(help="Contact table. The embedded sweep if not given.")
    ] = None,
    out: options.OutFolder = Path("ridgebayes-coverage"),
    forms: options.Forms = "",
    noise: Annotated[
        str,
        typer.Option(help=f"Comma-separated error models: {options.NOISE_NAMES} All if not given."),
    ] = "",
    seed: options.Seed = 0,
    force: options.Force = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Worker processes, 2 if not given. Results do not depend on it."),
    ] = None,
    scheduler: options.Scheduler = None,
) -> None:
    """Leave each texture out in turn and count how often the bands contain its loads."""


@command("plan")
def plan(
    scene: Annotated[Path | None, typer.Argument(help="Scene file.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="CSV to write. With --verify, the folder to create."),
    ] = None,
    figures: Annotated[Path | None, typer.Option(help="Folder for figures of the scene.")] = None,
    verify: Annotated[
        bool,
        typer.Option("--verify", help="Test the estimates on scenes spread over the whole range."),
    ] = False,
    scenes: Annotated[int, typer.Option(min=1, help="Number of scenes, with --verify.")] = 32,
    seed: options.Seed = 0,
    force: options.Force = False,
) -> None:
    """Estimate each effect in a scene and show which ones will be simulated."""


@command("cost")
def cost(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="[TABLE|SCENE]",
            help="Contact table or scene file. The embedded sweep if not given.",
        ),
    ] = None,
    out: options.OutFolder = Path("ridgebayes-cost"),
    elements: Annotated[
        bool, typer.Option("--elements/--no-elements", help="Run finite elements too.")
    ] = True,
    repeats: Annotated[int, typer.Option(min=1, help="Timed runs of each fast setting.")] = 3,
    seed: options.Seed = 0,
    force: options.Force = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Worker processes. Parallel runs distort timings."),
    ] = None,
    scheduler: options.Scheduler = None,
) -> None:
    """Measure accuracy against run time: loads, posteriors, evidences, bands."""


@command("import")
def import_(
    file: Annotated[list[Path], typer.Argument(help="File to read, or all files of a VTU series.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Table to write.")] = None,
    program: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="table, calculix, calculix-contact, abaqus-dat, abaqus-rpt or series. Detected "
            "if not given.",
        ),
    ] = None,
    mapping: Annotated[
        list[str] | None,
        typer.Option("--map", help="KEY=HEADER, such as 'a=Ridge width \\[mm]', or a TOML file."),
    ] = None,
    sheet: Annotated[str | None, typer.Option(help="Sheet of a workbook.")] = None,
    texture: Annotated[
        str | None, typer.Option(help="A,B: ridge and groove width over the radius.")
    ] = None,
    nu: Annotated[str | None, typer.Option(help="Poisson's ratio.")] = None,
    R: Annotated[str | None, typer.Option("--R", help="Radius, such as '8 mm'.")] = None,
    E: Annotated[str | None, typer.Option("--E", help="Young's modulus, such as '60 kPa'.")] = None,
    deck: Annotated[Path | None, typer.Option(help="Input deck of the run.")] = None,
    surface: Annotated[str | None, typer.Option(help="Node set of the body's rim.")] = None,
    reaction: Annotated[
        str | None, typer.Option(help="Node set whose reaction force is the load.")
    ] = None,
    symmetry: Annotated[
        str | None, typer.Option(help="half or full: which part of the body is meshed.")
    ] = None,
    top: Annotated[float | None, typer.Option(help="Height of the ridge tops.")] = None,
    corner: Annotated[
        float | None, typer.Option(help="Corner radius of the ridges over the radius.")
    ] = None,
    thickness: Annotated[
        float | None, typer.Option(help="Thickness of the slice that the forces belong to.")
    ] = None,
    field: Annotated[
        str | None, typer.Option(help="Point data of a series. displacement if not given.")
    ] = None,
    time: Annotated[
        str | None, typer.Option(help="Meaning of a series' time: p_over_E or line.")
    ] = None,
    loads: Annotated[
        str, typer.Option(help="Comma-separated p/E or line loads of several .vtu files.")
    ] = "",
    brackets: Annotated[
        bool,
        typer.Option("--brackets", help="Write each load as an interval instead of interpolating."),
    ] = False,
    role: Annotated[str | None, typer.Option(help="calibration or held-out.")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show how the input is read. Write nothing.")
    ] = False,
    force: options.Force = False,
) -> None:
    """Read the output of your own finite elements or tests into a contact table."""


@command("export-deck")
def export_deck(
    scene: Annotated[Path, typer.Argument(help="Scene file of one texture.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write, such as run.inp.")],
    program: Annotated[
        str, typer.Option("--format", help="Program to write for: calculix or abaqus.")
    ] = "calculix",
    edges: Annotated[float, typer.Option(help="Element edges across a ridge.")] = 12.0,
    force: options.Force = False,
) -> None:
    """Write a scene as an input deck for your own finite elements."""


@command("report")
def report(folder: options.RunFolder) -> None:
    """Write the report of a finished run again."""


def main() -> None:
    """Run the command line, with errors as one message on standard error and an exit code."""
    # Typer ends silently on its own KeyboardInterrupt; this one reaches the message below.
    signal.signal(signal.SIGINT, _interrupt)
    try:
        app()
    except InputError as error:
        _stop(error, 2)
    except ComputationError as error:
        _stop(error, 1)
    except OSError as error:
        why = " ".join(str(error.strerror or error).split())
        _stop(f"{error.filename or 'output'}: {why}", 1)
    except _Interrupted:
        _stop("interrupted; continue run, fit or generate with --resume", 130)


class _Interrupted(BaseException):
    """Ctrl-C, past whatever catches exceptions."""


def _interrupt(signum: int, frame: object) -> None:
    raise _Interrupted


def _stop(why: object, code: int) -> None:
    print(f"ridgebayes: {why}", file=sys.stderr)
    sys.exit(code)
