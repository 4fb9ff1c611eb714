"""The options of every command: a record each.

Nothing heavy is loaded here, so that help is quick.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from ridgebayes.commands.shared_options import (
    DEFAULT_OUT,
    NOISE_NAMES,
    TEXTURES,
    Accuracy,
    Force,
    Forms,
    NoiseName,
    OutFile,
    OutFolder,
    Priors,
    Resume,
    RunFolder,
    Scheduler,
    Seed,
    Table,
    TimeLimit,
    Workers,
)


@dataclass(frozen=True)
class Run:
    """Calibrate all forms, compare them, predict, and write a report."""

    table: Annotated[
        Path | None, typer.Option(help="Contact table. The embedded sweep if not given.")
    ] = None
    forms: Forms = ""
    noise: NoiseName = "auto"
    out: OutFolder = DEFAULT_OUT
    force: Force = False
    seed: Seed = 0
    resume: Resume = False
    accuracy: Accuracy = "standard"
    priors: Priors = None
    time_limit: TimeLimit = None
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Worker processes. One for each processor if not given."),
    ] = None
    scheduler: Scheduler = None


@dataclass(frozen=True)
class Generate:
    """Compute transition loads of textures and write them as a contact table."""

    out: OutFile
    scene: Annotated[
        Path | None, typer.Argument(help="Scene file. The paper's sweep if not given.")
    ] = None
    texture: Annotated[list[str] | None, TEXTURES] = None
    p_max: Annotated[float, typer.Option(help="Highest load p/E, with --texture.")] = 0.02
    nu: Annotated[float, typer.Option(help="Poisson's ratio, with --texture.")] = 0.5
    solver: Annotated[
        str,
        typer.Option(help="auto, hertz, half-plane, two-scale, cylinder-linear or cylinder-fe."),
    ] = "auto"
    tol: Annotated[
        float | None,
        typer.Option(help="Relative tolerance of each load. Set by --accuracy if not given."),
    ] = None
    accuracy: Accuracy = "standard"
    fields: Annotated[
        Path | None,
        typer.Option(help="Folder to create for finite-element fields: XDMF, CSV, figures."),
    ] = None
    workers: Workers = None
    scheduler: Scheduler = None
    force: Force = False
    resume: Resume = False


@dataclass(frozen=True)
class Fit:
    """Sample the posterior of one form."""

    table: Table
    form: Annotated[str, typer.Option(help="Form to fit, such as hybrid.")]
    noise: NoiseName = "auto"
    out: OutFolder = DEFAULT_OUT
    force: Force = False
    seed: Seed = 0
    resume: Resume = False
    accuracy: Accuracy = "standard"
    priors: Priors = None
    time_limit: TimeLimit = None


@dataclass(frozen=True)
class Compare:
    """Compare forms: evidences, Bayes factors, model probabilities, leave-one-out, stacking."""

    table: Table
    forms: Forms = ""
    noise: NoiseName = "auto"
    out: OutFolder = DEFAULT_OUT
    force: Force = False
    seed: Seed = 0
    accuracy: Accuracy = "standard"
    priors: Priors = None
    time_limit: TimeLimit = None


@dataclass(frozen=True)
class Predict:
    """Predict Q with uncertainty bands at given textures and loads, from a finished run."""

    folder: RunFolder
    out: Annotated[Path, typer.Option("-o", "--out", help="Bands to write, .csv or .parquet.")]
    texture: Annotated[
        list[str] | None,
        typer.Option(
            help="A,B: ridge and groove width over the radius, or with units where --R or --scene "
            "gives it. May be repeated. Those of --scene if not given."
        ),
    ] = None
    p_over_E: Annotated[
        str | None,
        typer.Option(
            "--p-over-E",
            help="Loads p/E: one such as 0.01, LO:HI:N evenly spaced, or log:LO:HI:N log-spaced.",
        ),
    ] = None
    load: Annotated[
        str | None,
        typer.Option(
            help="Loads with units instead: '1.2 kPa' over the projected area, '20 N/m' over the "
            "length, '5 N', or LO:HI:N of them."
        ),
    ] = None
    scene: Annotated[
        Path | None,
        typer.Option(help="Scene file: textures, Poisson's ratio, radius, modulus, highest load."),
    ] = None
    R: Annotated[str | None, typer.Option("--R", help="Radius, such as '8 mm'.")] = None
    E: Annotated[str | None, typer.Option("--E", help="Young's modulus, such as '60 kPa'.")] = None
    nu: Annotated[float | None, typer.Option(help="Poisson's ratio. 0.5 if nothing gives it.")] = (
        None
    )
    kind: Annotated[
        str,
        typer.Option(
            help="simulation: the band of a further simulation or measurement, errors included; "
            "curve: of the form itself; both."
        ),
    ] = "simulation"
    form: Annotated[str, typer.Option(help="Form of the run, or average.")] = "average"
    prob: Annotated[float, typer.Option(help="Probability inside the band.")] = 0.9
    plot: Annotated[Path | None, typer.Option(help="Figure to draw, .png or .svg.")] = None
    force: Force = False


@dataclass(frozen=True)
class Friction:
    """Draw counts and the contacts that go with them, for friction models, from a finished run."""

    folder: RunFolder
    scene: Annotated[Path, typer.Argument(help="Scene file of one texture.")]
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write: .nc, .parquet or .csv.")]
    p_over_E: Annotated[
        str | None,
        typer.Option(
            "--p-over-E", help="Loads p/E as LO:HI:N, evenly spaced, or log:LO:HI:N, log-spaced."
        ),
    ] = None
    loads: Annotated[
        int | None,
        typer.Option(min=1, help="Equal steps to the scene's largest load. 20 if not given."),
    ] = None
    n: Annotated[int, typer.Option("--n", min=1, help="Draws.")] = 4000
    edges: Annotated[bool, typer.Option("--edges", help="Add the forces on edges.")] = False
    model: Annotated[
        bool,
        typer.Option(
            "--model", help="Add bands on the coefficient of friction: FILE-mu.csv, -mu-shares.csv."
        ),
    ] = False
    seed: Seed = 0
    force: Force = False


@dataclass(frozen=True)
class Coverage:
    """Leave each texture out in turn and count how often the bands contain its loads."""

    table: Annotated[
        Path | None, typer.Argument(help="Contact table. The embedded sweep if not given.")
    ] = None
    out: OutFolder = Path("ridgebayes-coverage")
    forms: Forms = ""
    noise: Annotated[
        str,
        typer.Option(
            help=f"Comma-separated error models: {NOISE_NAMES} All ten without series if not given."
        ),
    ] = ""
    seed: Seed = 0
    force: Force = False
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Worker processes, 2 if not given. Results do not depend on it."),
    ] = None
    scheduler: Scheduler = None


@dataclass(frozen=True)
class Plan:
    """Say what a scene is: load, Q to expect, contact width, and which effects matter."""

    scene: Annotated[Path | None, typer.Argument(help="Scene file.")] = None
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help=".csv or .parquet to write. With --verify, a folder."),
    ] = None
    new: Annotated[
        Path | None,
        typer.Option(help="Write a commented scene file to start from, such as my.toml."),
    ] = None
    figures: Annotated[Path | None, typer.Option(help="Folder for figures of the scene.")] = None
    verify: Annotated[
        bool,
        typer.Option("--verify", help="Test the estimates on scenes spread over the whole range."),
    ] = False
    scenes: Annotated[int, typer.Option(min=1, help="Number of scenes, with --verify.")] = 32
    seed: Seed = 0
    force: Force = False


@dataclass(frozen=True)
class Cost:
    """Measure accuracy against run time: loads, posteriors, evidences, bands."""

    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="[TABLE|SCENE]",
            help="Contact table or scene file. The embedded sweep if not given.",
        ),
    ] = None
    out: OutFolder = Path("ridgebayes-cost")
    elements: Annotated[
        bool, typer.Option("--elements/--no-elements", help="Run finite elements too.")
    ] = True
    repeats: Annotated[int, typer.Option(min=1, help="Timed runs of each fast setting.")] = 3
    seed: Seed = 0
    force: Force = False
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Worker processes. Parallel runs distort timings."),
    ] = None
    scheduler: Scheduler = None


@dataclass(frozen=True)
class Import:
    r"""Read the output of your own finite elements or tests into a contact table.

    Headers such as 'Stegbreite \[mm]' or 'Line load (N/mm)', title lines,
    wide tables and increments are recognised. What is missing is asked for,
    with the whole command.

    \b
    ridgebayes import loads.csv --R '8 mm' --E '60 kPa' -o table.csv
    ridgebayes import t.xlsx --sheet 2 --map 'a=w1 \[mm]' --map 'line=F;N/mm'
    ridgebayes import run.dat --texture 0.06,0.03 --deck run.inp -o table.csv

    Keys of --map: a, b, pitch, R, D, offset (lengths), E, p (pressures),
    line (line loads), force, load (any, by its unit), p_lower, line_lower,
    force_lower, Q, nu, rel_se, a_over_R, b_over_R, offset_over_R, p_over_E,
    p_over_E_lower, kind, role, series, texture, solver, status, source.
    'p=Load at * \[kPa]' is one column for each Q. Histories of increments:
    'gap Q=4', 'gap_over_R Q=4', 'pressure Q=4', 'status Q=4'.
    """

    file: Annotated[list[Path], typer.Argument(help="File to read, or all files of a VTU series.")]
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Table to write.")] = None
    program: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="table, calculix, calculix-contact, abaqus-dat, abaqus-rpt or series. Detected "
            "if not given.",
        ),
    ] = None
    mapping: Annotated[
        list[str] | None,
        typer.Option(
            "--map",
            help="KEY=HEADER, such as 'a=Ridge width \\[mm]', KEY=HEADER;UNIT, or a TOML file; "
            "beside what is recognised.",
        ),
    ] = None
    write_map: Annotated[
        Path | None, typer.Option(help="TOML file for --map to write, with what is recognised.")
    ] = None
    sheet: Annotated[str | None, typer.Option(help="Sheet of a workbook, name or number.")] = None
    skip_rows: Annotated[int | None, typer.Option(min=0, help="Lines to pass over at the top.")] = (
        None
    )
    header_row: Annotated[
        int | None, typer.Option(min=0, help="Line of the header; 0 for no header.")
    ] = None
    decimal: Annotated[str | None, typer.Option(help="Decimal mark: point or comma.")] = None
    empty: Annotated[
        list[str] | None, typer.Option(help="Text of cells that are empty. May be repeated.")
    ] = None
    count_is: Annotated[
        str | None,
        typer.Option(help="What is counted: edges (proximal), ridges, segments or per-side."),
    ] = None
    texture: Annotated[
        str | None, typer.Option(help="A,B: ridge and groove width over the radius.")
    ] = None
    nu: Annotated[str | None, typer.Option(help="Poisson's ratio.")] = None
    R: Annotated[str | None, typer.Option("--R", help="Radius, such as '8 mm'.")] = None
    E: Annotated[str | None, typer.Option("--E", help="Young's modulus, such as '60 kPa'.")] = None
    thickness: Annotated[
        str | None,
        typer.Option(help="Length along the ridges, such as '20 mm', that forces belong to."),
    ] = None
    deck: Annotated[
        Path | None, typer.Option(help="Input deck of the run. The .inp beside it if not given.")
    ] = None
    surface: Annotated[
        str | None, typer.Option(help="Node set of the body's rim. The deck's *NODE PRINT of U.")
    ] = None
    reaction: Annotated[
        str | None,
        typer.Option(help="Node set whose reaction is the load. The deck's *NODE PRINT of RF."),
    ] = None
    symmetry: Annotated[
        str | None, typer.Option(help="half or full: which part of the body is meshed.")
    ] = None
    top: Annotated[float | None, typer.Option(help="Height of the ridge tops.")] = None
    corner: Annotated[
        float | None, typer.Option(help="Corner radius of the ridges over the radius.")
    ] = None
    field: Annotated[
        str | None, typer.Option(help="Point data of a series. displacement if not given.")
    ] = None
    time: Annotated[
        str | None, typer.Option(help="Meaning of a series' time: p_over_E or line.")
    ] = None
    loads: Annotated[
        str, typer.Option(help="Comma-separated p/E or line loads of several .vtu files.")
    ] = ""
    brackets: Annotated[
        bool,
        typer.Option(
            "--brackets", help="Write each load as an interval, also where gaps are known."
        ),
    ] = False
    interpolate: Annotated[
        bool,
        typer.Option("--interpolate", help="Write loads of counts in the middle of increments."),
    ] = False
    role: Annotated[str | None, typer.Option(help="calibration or held-out.")] = None
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Show how the input is read. Write nothing.")
    ] = False
    force: Force = False


@dataclass(frozen=True)
class ExportDeck:
    """Write a scene as an input deck for your own finite elements."""

    scene: Annotated[Path, typer.Argument(help="Scene file of one texture.")]
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write, such as run.inp.")]
    program: Annotated[
        str, typer.Option("--format", help="Program to write for: calculix or abaqus.")
    ] = "calculix"
    edges: Annotated[float, typer.Option(help="Element edges across a ridge.")] = 12.0
    force: Force = False


@dataclass(frozen=True)
class Report:
    """Write the report of a finished run again."""

    folder: RunFolder
    checklist: Annotated[
        bool,
        typer.Option(
            "--checklist", help="Write nothing. Show where the report meets BARG and WAMBS."
        ),
    ] = False
