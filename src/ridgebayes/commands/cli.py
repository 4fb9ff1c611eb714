"""The commands: each parses its words, calls one job, and turns errors into exit codes.

Exit code 0 is done, 1 a computation that failed or did not converge (what was finished is written),
2 bad input or usage (nothing written).
"""

import os
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

# One BLAS thread: the matrices are small, and threads only fight. Before numpy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from ridgebayes.errors import ComputationError, InputError

if TYPE_CHECKING:
    from ridgebayes._types import FloatArray
    from ridgebayes.comparison.comparison import Comparison

app = typer.Typer(
    help="How many ridges does a soft body touch, how sure is that, and which contact model "
    "does the evidence support?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Out = Annotated[Path, typer.Option("-o", "--out", help="Folder to make.")]
OutTable = Annotated[Path, typer.Option("-o", "--out", help="File to write.")]
Forms = Annotated[
    str,
    typer.Option(help="Comma-separated: classic, power-law, modified, hybrid, half-plane."),
]
NOISE_RULE = "STRUCTURE or STRUCTURE:student; iid, texture, step, texture+step, step-smooth."
NoiseName = Annotated[str, typer.Option(help=f"Error model: {NOISE_RULE}")]
Force = Annotated[bool, typer.Option("--force", help="Replace an existing output.")]
Resume = Annotated[
    bool, typer.Option("--resume", help="Go on with what a killed run left; the end is the same.")
]
AccuracyName = Annotated[
    str, typer.Option("--accuracy", help="quick, standard or reference: errors against time.")
]
Scheduler = Annotated[
    str | None,
    typer.Option(help="tcp://HOST:PORT of a running Dask cluster, whose workers compute."),
]
Seed = Annotated[int, typer.Option(min=0, help="The same seed gives the same numbers.")]
Table = Annotated[Path, typer.Argument(help="Contact table, .csv or .parquet.")]
DEFAULT_OUT = Path("ridgebayes-out")


@app.command()
def run(
    table: Annotated[
        Path | None, typer.Option(help="Contact table; the embedded sweep if not given.")
    ] = None,
    forms: Forms = "",
    noise: Annotated[
        str | None,
        typer.Option(help=f"Error model: {NOISE_RULE} Without it the best by mean evidence."),
    ] = None,
    out: Out = DEFAULT_OUT,
    force: Force = False,
    seed: Seed = 0,
    resume: Resume = False,
    accuracy: AccuracyName = "standard",
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Processes for error models and folds; all processors if none."),
    ] = None,
    scheduler: Scheduler = None,
) -> None:
    """Do the main job: calibrate, weigh the evidence, predict, report."""
    from ridgebayes.runtime.pool import start_server

    if scheduler is None and workers != 1:
        # Modules that workers need, in time to be imported while this process imports them too.
        start_server(("ridgebayes.commands.jobs", "ridgebayes.report.figures", "arviz", "corner"))
    from ridgebayes.commands.jobs import run_job

    done = run_job(
        out,
        table=table,
        forms=_names(forms),
        noise=noise,
        seed=seed,
        force=force,
        resume=resume,
        accuracy=accuracy,
        workers=workers,
        scheduler=scheduler,
    )
    _finish(done, out, f"read {out / 'report.html'}")


@app.command()
def generate(
    out: OutTable,
    scene: Annotated[
        Path | None, typer.Argument(help="Scene file; the paper's sweep if none.")
    ] = None,
    texture: Annotated[
        list[str] | None, typer.Option(help="A,B: ridge and groove width over radius; repeatable.")
    ] = None,
    p_max: Annotated[float, typer.Option(help="Highest load p/E, with --texture.")] = 0.02,
    nu: Annotated[float, typer.Option(help="Poisson's ratio, with --texture.")] = 0.5,
    solver: Annotated[str, typer.Option(help="auto, hertz, half-plane or cylinder-fe.")] = "auto",
    tol: Annotated[
        float | None, typer.Option(help="Relative tolerance of each load; of the accuracy if none.")
    ] = None,
    accuracy: AccuracyName = "standard",
    fields: Annotated[
        Path | None,
        typer.Option(help="Folder to make, for what finite elements find: XDMF, CSV, figures."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; the table does not depend on it.")
    ] = None,
    scheduler: Scheduler = None,
    force: Force = False,
    resume: Resume = False,
) -> None:
    """Compute transition loads of textures and write them as a table."""
    from ridgebayes.commands.sweep_jobs import sweep_job
    from ridgebayes.scene.scene import Scene

    _refuse_existing(out, force)
    if scene is not None and texture:
        raise InputError("SCENE and --texture: expected one of them, got both")
    if scene is not None:
        wanted = Scene.from_toml(scene)
    elif texture:
        wanted = Scene.of([_texture(text) for text in texture], p_over_E=p_max, nu=nu)
    else:
        wanted = Scene.paper()
    if fields is None:
        table, left_out = sweep_job(
            out,
            wanted,
            solver=solver,
            rel_tol=tol,
            accuracy=accuracy,
            workers=workers,
            scheduler=scheduler,
            resume=resume,
            force=force,
        )
    else:
        from ridgebayes.commands.sweep_jobs import fields_job

        if workers is not None or scheduler is not None or resume:
            raise InputError("--fields: with --workers, --scheduler or --resume; expected without")
        table, left_out = fields_job(
            out, wanted, fields, solver=solver, rel_tol=tol, accuracy=accuracy, force=force
        )
    failed = len(table.left_out)
    print(f"{out}: {len(table)} rows, {len(table.textures)} textures, {failed} not ok")
    for line in left_out:
        print(line)
    if failed:
        raise ComputationError(f"{failed} rows are not ok, see column status of {out}")


@app.command()
def fit(
    table: Table,
    form: Annotated[str, typer.Option(help="Form to fit, such as hybrid.")],
    noise: NoiseName = "iid",
    out: Out = DEFAULT_OUT,
    force: Force = False,
    seed: Seed = 0,
    resume: Resume = False,
    accuracy: AccuracyName = "standard",
) -> None:
    """Sample the posterior of one form."""
    from ridgebayes.commands.jobs import fit_job

    done = fit_job(
        out,
        table,
        form,
        noise=noise,
        seed=seed,
        force=force,
        resume=resume,
        accuracy=accuracy,
    )
    for result in done.fits.values():
        print(result)
    _finish(done, out)


@app.command()
def compare(
    table: Table,
    forms: Forms = "",
    noise: NoiseName = "iid",
    out: Out = DEFAULT_OUT,
    force: Force = False,
    seed: Seed = 0,
    accuracy: AccuracyName = "standard",
) -> None:
    """Compare forms: evidences, Bayes factors, model probabilities, leave-one-out, stacking."""
    from ridgebayes.commands.jobs import compare_job

    done = compare_job(
        out,
        table,
        forms=_names(forms),
        noise=noise,
        seed=seed,
        force=force,
        accuracy=accuracy,
    )
    print(done.bayes_factors.to_string(index=False))
    _finish(done, out)


@app.command()
def predict(
    folder: Annotated[Path, typer.Argument(help="A run folder.")],
    texture: Annotated[list[str], typer.Option(help="A,B; repeatable.")],
    p_over_e: Annotated[
        str, typer.Option("--p-over-E", help="Loads LO:HI:N, linear; log:LO:HI:N, logarithmic.")
    ],
    out: OutTable,
    nu: Annotated[float, typer.Option(help="Poisson's ratio.")] = 0.5,
    form: Annotated[str, typer.Option(help="A form of the run, or average.")] = "average",
    prob: Annotated[float, typer.Option(help="Probability inside the band.")] = 0.9,
    force: Force = False,
) -> None:
    """Write bands on Q at textures and loads, from a finished run."""
    from ridgebayes.commands.run_folder import read_run, write_csv
    from ridgebayes.comparison.bands import bands_table

    _refuse_existing(out, force)
    textures, loads = [_texture(text) for text in texture], _loads(p_over_e)
    bands = bands_table(
        read_run(folder),
        textures=textures,
        loads=loads,
        nu=nu,
        forms=[form],
        prob=prob,
        compressed=True,
    )
    write_csv(bands, out)
    error = bands.attrs["error"]
    known = "under 0.005 (draws)" if error != error else f"up to {error:.1g}"
    print(
        f"{out}: {len(bands)} rows, {int(bands['extrapolation'].sum())} of them extrapolation; "
        f"errors of probabilities {known}"
    )


@app.command()
def coverage(
    table: Annotated[
        Path | None, typer.Argument(help="Contact table; the embedded sweep if not given.")
    ] = None,
    out: Out = Path("ridgebayes-coverage"),
    forms: Forms = "",
    noise: Annotated[
        str, typer.Option(help=f"Error models, comma-separated, all if not given: {NOISE_RULE}")
    ] = "",
    seed: Seed = 0,
    force: Force = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, help="Processes, 2 if not given; numbers do not depend on it."),
    ] = None,
    scheduler: Scheduler = None,
) -> None:
    """Leave each texture out in turn and count how often bands contain its loads."""
    from ridgebayes.commands.jobs import coverage_job

    found = coverage_job(
        out,
        table=table,
        forms=_names(forms),
        noises=_names(noise, "--noise"),
        seed=seed,
        force=force,
        workers=2 if workers is None and scheduler is None else workers,
        scheduler=scheduler,
    )
    shown = found[found["prob"] == 0.9]
    columns = ["form", "noise", "n", "covered", "share", "share_se", "mean_width"]
    print("Bands of 90 %:")
    print(shown[columns].to_string(index=False, float_format="{:.3f}".format))
    print(f"{out}: {len(found)} rows; look at {out / 'coverage.png'}")
    failed = shown[shown["n_failed"] > 0]
    if len(failed):
        rows = zip(failed["form"], failed["noise"], failed["failed"], strict=True)
        raise ComputationError("\n".join(f"{form}, {name}: {why}" for form, name, why in rows))


@app.command()
def plan(
    scene: Annotated[Path | None, typer.Argument(help="Scene file.")] = None,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="CSV to write; with --verify the folder to make."),
    ] = None,
    figures: Annotated[Path | None, typer.Option(help="Folder to draw the scene into.")] = None,
    verify: Annotated[
        bool, typer.Option("--verify", help="Check the estimates on scenes all over the space.")
    ] = False,
    scenes: Annotated[int, typer.Option(min=1, help="How many scenes, with --verify.")] = 32,
    seed: Seed = 0,
    force: Force = False,
) -> None:
    """Say which effects a scene calls for, how large each is, and what is simulated."""
    from ridgebayes.commands.plan_jobs import plan_check_job, plan_job
    from ridgebayes.scene.effects import plan_table
    from ridgebayes.scene.scene import Scene

    if verify:
        if scene is not None or out is None:
            raise InputError("--verify: needs -o, a folder to make, and takes no scene")
        found = plan_check_job(out, n=scenes, seed=seed, force=force)
        print(f"{out}: {int(found['honest'].sum())} of {len(found)} estimates are honest")
        if not found["honest"].all():
            raise ComputationError(f"{int((~found['honest']).sum())} are not, see {out}/report.md")
        return
    if scene is None:
        raise InputError("SCENE: missing; expected a scene file, or --verify")
    if out is not None:
        _refuse_existing(out, force)
    plans = plan_job(Scene.from_toml(scene), out=out, figures=figures)
    for one in plans:
        print(f"a/R = {one.texture.a_over_R:g}, b/R = {one.texture.b_over_R:g}")
        for row in plan_table([one]).to_dict("records"):
            size = row["estimated_rel_change"]
            known = "size not known" if size != size else f"changes loads by {size:.1e}"
            word = "simulated" if row["simulated"] else "left out"
            cost = "" if row["cost_s"] != row["cost_s"] else f", {row['cost_s']:.2g} s"
            print(f"  {row['effect']}: {word}; {known}{cost}; {row['reason']}")


@app.command()
def cost(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="[TABLE|SCENE]",
            help="Contact table, or scene file; the embedded sweep if none.",
        ),
    ] = None,
    out: Out = Path("ridgebayes-cost"),
    elements: Annotated[
        bool, typer.Option("--elements/--no-elements", help="Run finite elements too.")
    ] = True,
    repeats: Annotated[int, typer.Option(min=1, help="Timed runs of what is quick.")] = 3,
    seed: Seed = 0,
    force: Force = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes, which disturb each other's seconds.")
    ] = None,
    scheduler: Scheduler = None,
) -> None:
    """Measure what each accuracy costs in time: loads, posteriors, evidences, bands."""
    from ridgebayes.checks.cost.measured import cheapest
    from ridgebayes.commands.cost_jobs import cost_job
    from ridgebayes.scene.scene import Scene
    from ridgebayes.simulate.generation import generate as generate_table
    from ridgebayes.table.datafiles import paper_sweep
    from ridgebayes.table.table import read_table

    texture, p_max = None, 0.02
    if source is None:
        table = paper_sweep()
    elif source.suffix == ".toml":
        wanted = Scene.from_toml(source)
        first = wanted.textures[0]
        texture, p_max = (first.a_over_R, first.b_over_R), wanted.highest_load(first)
        table = generate_table(wanted, solver="half-plane")
    else:
        table = read_table(source)
    found = cost_job(
        out,
        table,
        texture=texture,
        p_max=p_max,
        elements=elements,
        repeats=repeats,
        seed=seed,
        force=force,
        workers=workers,
        scheduler=scheduler,
    )
    for line in cheapest(found):
        print(line)
    print(f"{out}: {len(found)} rows; look at {out / 'cost.html'}")


@app.command("import")
def import_(
    file: Annotated[list[Path], typer.Argument(help="File to read; of a VTU series all of them.")],
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Table to write.")] = None,
    program: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="table, calculix, calculix-contact, abaqus-dat, abaqus-rpt or series; looked at "
            "if not given.",
        ),
    ] = None,
    mapping: Annotated[
        list[str] | None,
        typer.Option("--map", help="KEY=HEADER, such as 'a=Ridge width [mm]', or a TOML file."),
    ] = None,
    sheet: Annotated[str | None, typer.Option(help="Sheet of a workbook.")] = None,
    texture: Annotated[str | None, typer.Option(help="A,B of a run, over R.")] = None,
    nu: Annotated[str | None, typer.Option(help="Poisson's ratio.")] = None,
    R: Annotated[str | None, typer.Option("--R", help="Radius, such as '8 mm'.")] = None,
    E: Annotated[str | None, typer.Option("--E", help="Young's modulus, such as '60 kPa'.")] = None,
    deck: Annotated[Path | None, typer.Option(help="Deck of a run.")] = None,
    surface: Annotated[str | None, typer.Option(help="Node set of the body's rim.")] = None,
    reaction: Annotated[str | None, typer.Option(help="Node set that is driven.")] = None,
    symmetry: Annotated[
        str | None, typer.Option(help="half or full: what of the body is meshed.")
    ] = None,
    top: Annotated[float | None, typer.Option(help="Height of the ridges' tops.")] = None,
    corner: Annotated[float | None, typer.Option(help="Radius of ridges' corners, over R.")] = None,
    thickness: Annotated[
        float | None, typer.Option(help="Of the slice that forces belong to.")
    ] = None,
    field: Annotated[
        str | None, typer.Option(help="Point data of a series: displacement if not given.")
    ] = None,
    time: Annotated[
        str | None, typer.Option(help="What a series' time is: p_over_E or line.")
    ] = None,
    loads: Annotated[
        str, typer.Option(help="Of several .vtu, with commas: their p/E or line loads.")
    ] = "",
    brackets: Annotated[
        bool, typer.Option("--brackets", help="The increment of each transition, not a load in it.")
    ] = False,
    role: Annotated[str | None, typer.Option(help="calibration or held-out.")] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Say what is understood, write nothing.")
    ] = False,
    force: Force = False,
) -> None:
    """Read the output of your own finite elements or tests into a table."""
    from ridgebayes.fea.read import Given, import_files

    if out is None and not dry_run:
        raise InputError("-o: missing; expected the table to write, or --dry-run")
    if out is not None and not dry_run:
        _refuse_existing(out, force)
    given = Given(
        map=tuple(mapping or ()),
        sheet=sheet,
        texture=_texture(texture) if texture is not None else None,
        nu=nu,
        R=R,
        E=E,
        symmetry=symmetry,
        top=top,
        thickness=thickness,
        corner=corner,
        deck=deck,
        surface=surface,
        reaction=reaction,
        field=field,
        time=time,
        loads=_numbers("--loads", loads),
    )
    found = import_files(file, given, program=program, brackets=brackets, role=role)
    for line in found.messages:
        print(line)
    if out is not None and not dry_run:
        found.table.write(out)
        print(f"{out}: {len(found.table)} rows, {len(found.table.textures)} textures")


@app.command("export-deck")
def export_deck(
    scene: Annotated[Path, typer.Argument(help="Scene file of one texture.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="File to write, such as run.inp.")],
    program: Annotated[
        str, typer.Option("--format", help="calculix or abaqus: which reads it.")
    ] = "calculix",
    edges: Annotated[float, typer.Option(help="Element edges over a ridge's width.")] = 12.0,
    force: Force = False,
) -> None:
    """Write a scene as a deck for your own finite elements."""
    from ridgebayes.commands.run_folder import write_text
    from ridgebayes.fea.deck_text import REACTION, SURFACE, deck_text
    from ridgebayes.fea.pressed_disk import pressed_disk
    from ridgebayes.scene.scene import Scene

    _refuse_existing(out, force)
    wanted = Scene.from_toml(scene)
    try:
        disk = pressed_disk(wanted, edges=edges)
        text = deck_text(disk, program)
    except InputError as error:
        raise InputError(f"{scene}: {error}") from None
    write_text(text, out)
    (texture,) = wanted.textures
    corner = texture.corner_radius_over_R
    print(f"{out}: {len(disk.cells)} elements, {len(disk.displacements)} levels, R = 1, E = 1")
    print(
        f"import the run with: ridgebayes import {out.with_suffix('.dat')} --deck {out} "
        f"--surface {SURFACE} --reaction {REACTION} --texture {texture.a_over_R:g},"
        f"{texture.b_over_R:g} --nu {wanted.nu:g}{f' --corner {corner:g}' if corner else ''} "
        "-o TABLE.csv"
    )


@app.command()
def report(folder: Annotated[Path, typer.Argument(help="A run folder.")]) -> None:
    """Write the report of a finished run again."""
    from ridgebayes.commands.jobs import report_job

    report_job(folder)
    print(f"read {folder / 'report.html'}")


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
        _stop("interrupted; run, fit and generate go on with --resume", 130)


class _Interrupted(BaseException):
    """Ctrl-C, past whatever catches exceptions."""


def _interrupt(signum: int, frame: object) -> None:
    raise _Interrupted


def _stop(why: object, code: int) -> None:
    print(f"ridgebayes: {why}", file=sys.stderr)
    sys.exit(code)


def _finish(done: "Comparison", out: Path, then: str = "") -> None:
    """Say what was left out and what did not converge; exit 1 if anything did not."""
    table = done.table
    if len(table.left_out):
        print(f"{table.where}: {len(table.left_out)} rows are not ok and were not fitted")
    print(f"{out}: {len(table.calibration)} rows fitted, {len(table.held_out)} held out. {then}")
    unfinished = [
        f"{name} did not converge: {'; '.join(fit.convergence_failures)}"
        for name, fit in done.fits.items()
        if not fit.converged
    ]
    unfinished += [f"{name} failed: {why}" for name, why in done.failures.items()]
    if unfinished:
        raise ComputationError("\n".join(unfinished))


def _refuse_existing(path: Path, force: bool) -> None:
    if path.is_dir():
        raise InputError(f"{path}: a folder; -o names a file")
    if not path.absolute().parent.is_dir():
        raise InputError(
            f"{path}: folder {path.parent} does not exist; expected an existing folder"
        )
    if path.exists() and not force:
        raise InputError(f"{path}: exists; use another -o, or --force to replace it")
    if not os.access(path.absolute().parent, os.W_OK):  # told before the work, not after it
        raise InputError(
            f"{path}: folder {path.parent} cannot be written to; expected one that can be"
        )


def _names(text: str, option: str = "--forms") -> list[str]:
    names = [name.strip() for name in text.split(",")] if text else []
    if not all(names):
        raise InputError(
            f"{option} {text!r}: an empty name; expected names with commas between them"
        )
    return names


def _texture(text: str) -> tuple[float, float]:
    try:
        a, b = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"--texture {text!r}: expected A,B, two numbers with one comma, such as 0.022,0.02"
        ) from None
    if not (0 < a < float("inf") and 0 < b < float("inf")):
        raise InputError(f"--texture {text!r}: expected both widths finite and > 0")
    return a, b


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(one) for one in text.split(",")) if text else ()
    except ValueError:
        raise InputError(f"{option} {text!r}: expected numbers with commas between them") from None


def _loads(text: str) -> "FloatArray":
    import numpy as np

    rule = "LO:HI:N or log:LO:HI:N with 0 < LO <= HI and N >= 1, such as 0.001:0.02:50"
    parts = text.removeprefix("log:").split(":")
    try:
        low, high, n = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        raise InputError(f"--p-over-E {text!r}: expected {rule}") from None
    if len(parts) != 3 or not 0 < low <= high < float("inf") or n < 1:
        raise InputError(f"--p-over-E {text!r}: expected {rule}")
    return np.geomspace(low, high, n) if text.startswith("log:") else np.linspace(low, high, n)
