"""The command line: which commands there are, and errors turned into exit codes.

Exit code 0 is done, 1 a computation that failed or did not converge (what was finished is written),
2 bad input or usage (nothing written).

A command is the function `command` of the module of its name: it returns an `Answer`, which is
printed here. The module is loaded when the command is called: until then nothing heavy is loaded,
so that help is quick.
"""

import os
import signal
import sys
from collections.abc import Callable
from dataclasses import fields
from importlib import import_module
from inspect import Signature
from typing import Annotated, Any

# One BLAS thread: the matrices are small, and threads only fight. Before numpy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from ridgebayes.commands import options, table_options
from ridgebayes.commands.shared_options import Output, help_of, parameters_of
from ridgebayes.errors import ComputationError, InputError, OutputError

_COMMANDS: dict[str, tuple[str, type[Any]]] = {  # by name: module, and options
    "run": ("run", options.Run),
    "generate": ("generate", table_options.Generate),
    "fit": ("run", options.FitOne),
    "compare": ("run", options.Compare),
    "predict": ("predict", options.Predict),
    "friction": ("friction", options.Friction),
    "design": ("design", options.DesignOptions),
    "coverage": ("coverage", options.Coverage),
    "plan": ("plan", table_options.PlanOptions),
    "cost": ("cost", table_options.Cost),
    "import": ("import_", table_options.Import),
    "export-deck": ("export_deck", table_options.ExportDeck),
    "report": ("run", options.Report),
}
# Modules that workers of a run import while this process does; in a quick run they do not draw.
_OF_A_RUN = ("ridgebayes.commands.run", "h5netcdf", "scipy.stats", "xarray", "arviz_stats.base")
_OF_FIGURES = (
    *(f"ridgebayes.drawing.{name}" for name in ("coverage", "forms", "posterior", "predictions")),
    "corner",
)
# Click's, which newer versions of typer bring along and older ones import.
_UsageError: Any = typer.BadParameter.__base__
app = typer.Typer(
    help="How many ridges does a soft body touch, how certain is that, and which contact model "
    "does the evidence support?",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _show_version(asked: bool) -> None:
    if asked:
        print(f"ridgebayes {import_module('ridgebayes._types').__version__}")  # which loads numpy
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version."),
    ] = False,
) -> None: ...


def _caller(name: str, module: str, options_of: type[Any]) -> Callable[..., None]:
    """Return the function of a command, whose parameters are its options and those of all."""

    def call(**typed: Any) -> None:
        output = Output(**{record.name: typed.pop(record.name) for record in fields(Output)})
        code = _done(name, module, options_of(**typed), output)
        if code:
            raise typer.Exit(code)

    parameters = [p for record in (options_of, Output) for p in parameters_of(record)]
    call.__name__, call.__doc__ = name, help_of(options_of)[0]
    call.__annotations__ = {record.name: record.annotation for record in parameters}
    call.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return call


for _name, _what in _COMMANDS.items():
    app.command(_name)(_caller(_name, *_what))


def _done(name: str, module: str, asked: Any, output: Output) -> int:
    """Do a command, tell what it found or what went wrong, and return the exit code."""
    if name == "run" and asked.scheduler is None and asked.workers != 1:
        # Workers import at the same time as this process, so their server starts first.
        drawn = () if asked.accuracy == "quick" else _OF_FIGURES
        import_module("ridgebayes.runtime.pool").start_server(_OF_A_RUN + drawn)
    terminal = import_module("ridgebayes.commands.terminal")
    progress = import_module("ridgebayes.runtime.progress")
    answer, code, error = terminal.Answer(), 0, ""
    level = progress.VERBOSITY.set(output.verbosity)
    try:
        answer = import_module(f"ridgebayes.commands.{module}").command(asked)
        code, error = (1 if answer.problem else 0), answer.problem
    except InputError as bad:
        code, error = 2, str(bad)
    except (ComputationError, OutputError) as failed:
        code, error = 1, str(failed)
    except OSError as failed:
        code, error = 1, _words(failed)
    except (KeyboardInterrupt, _Interrupted):
        code, error = 130, "interrupted"
        if hasattr(asked, "resume"):
            error += f"; continue {name} with --resume"
    finally:
        progress.VERBOSITY.reset(level)
    try:
        terminal.tell(name, answer, code, error, output)
    except OSError as failed:
        # The output has no reader: nothing is left to be written when Python ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(failed, BrokenPipeError):  # `| head` has seen what it wants
            return code
        print(f"ridgebayes: {_words(failed)}", file=sys.stderr)
        return 1
    return code


def _words(failed: OSError) -> str:
    why = " ".join(str(failed.strerror or failed).split())
    return f"{failed.filename or 'output'}: {why}"


def main() -> None:
    """Run the command line, with errors as one message on standard error and an exit code."""
    # Typer ends silently on its own KeyboardInterrupt; this one reaches the message above.
    signal.signal(signal.SIGINT, _interrupt)
    words = sys.argv[1:]
    if "--json" not in words:
        app()
        return
    try:  # wrong usage, too, is reported as an object
        code = app(standalone_mode=False)
    except _UsageError as error:
        terminal = import_module("ridgebayes.commands.terminal")
        name, code = next((word for word in words if word in _COMMANDS), None), error.exit_code
        output = Output(as_json=True)
        terminal.tell(name, terminal.Answer(), code, error.format_message(), output)
    sys.exit(code if isinstance(code, int) else 0)


class _Interrupted(BaseException):
    """Ctrl-C, past whatever catches exceptions."""


def _interrupt(signum: int, frame: object) -> None:
    raise _Interrupted
