"""List of commands, and conversion of errors to exit codes.

Exit code 0 means success, 1 a computation that failed or did not converge (finished results are
written), and 2 invalid input or usage (nothing is written).

The function `command` in the module of a command returns an `Answer`, which is printed here. The
module is imported when the command is called, so that help needs no heavy imports.
"""

import os
import signal
import sys
from collections.abc import Callable
from dataclasses import fields
from importlib import import_module
from inspect import Signature
from typing import Annotated, Any

# Small matrices are fastest with one BLAS thread. This must be set before numpy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from ridgebayes.commands import options, table_options
from ridgebayes.commands.shared_options import Output, help_of, parameters_of
from ridgebayes.errors import ComputationError, InputError, OutputError

_COMMANDS: dict[str, tuple[str, type[Any]]] = {  # module and options record by command name
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
# Imported by the workers of `run` while this process imports its own modules.
_RUN_MODULES = ("ridgebayes.commands.run", "h5netcdf", "scipy.stats", "xarray", "arviz_stats.base")
_FIGURE_MODULES = (
    *(f"ridgebayes.drawing.{name}" for name in ("coverage", "forms", "posterior", "predictions")),
    "corner",
)
# Click's class, from typer's own copy of Click or from the package, depending on the version.
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


def _command_function(name: str, module: str, options_of: type[Any]) -> Callable[..., None]:
    """Return the function of a command, with its options and the output options as parameters."""

    def call(**typed: Any) -> None:
        output = Output(**{record.name: typed.pop(record.name) for record in fields(Output)})
        code = _run_command(name, module, options_of(**typed), output)
        if code:
            raise typer.Exit(code)

    parameters = [p for record in (options_of, Output) for p in parameters_of(record)]
    call.__name__, call.__doc__ = name, help_of(options_of)[0]
    call.__annotations__ = {record.name: record.annotation for record in parameters}
    call.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return call


for _name, _definition in _COMMANDS.items():
    app.command(_name)(_command_function(_name, *_definition))


def _run_command(name: str, module: str, asked: Any, output: Output) -> int:
    """Run a command, print its answer or error, and return the exit code."""
    if name == "run" and asked.scheduler is None and asked.workers != 1:
        # Workers import at the same time as this process. Quick runs draw no figures in workers.
        figures = () if asked.accuracy == "quick" else _FIGURE_MODULES
        import_module("ridgebayes.runtime.pool").start_server(_RUN_MODULES + figures)
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
        code, error = 1, _error_text(failed)
    except (KeyboardInterrupt, _Interrupted):
        code, error = 130, "interrupted"
        if hasattr(asked, "resume"):
            error += f"; continue {name} with --resume"
    finally:
        progress.VERBOSITY.reset(level)
    try:
        terminal.tell(name, answer, code, error, output)
    except OSError as failed:
        # Python would fail again when it flushes standard output at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(failed, BrokenPipeError):  # the reader, such as `head`, has ended
            return code
        print(f"ridgebayes: {_error_text(failed)}", file=sys.stderr)
        return 1
    return code


def _error_text(failed: OSError) -> str:
    why = " ".join(str(failed.strerror or failed).split())
    return f"{failed.filename or 'output'}: {why}"


def main() -> None:
    """Run the command line; print errors on standard error and exit with a code."""
    # Typer exits without a message on KeyboardInterrupt, so another exception is raised.
    signal.signal(signal.SIGINT, _interrupt)
    words = sys.argv[1:]
    if "--json" not in words:
        app()
        return
    try:  # usage errors are also printed as a JSON object
        code = app(standalone_mode=False)
    except _UsageError as error:
        terminal = import_module("ridgebayes.commands.terminal")
        name, code = next((word for word in words if word in _COMMANDS), None), error.exit_code
        terminal.tell(name, terminal.Answer(), code, error.format_message(), Output(as_json=True))
    sys.exit(code if isinstance(code, int) else 0)


class _Interrupted(BaseException):
    """Interruption by Ctrl-C, which handlers of `Exception` do not catch."""


def _interrupt(signum: int, frame: object) -> None:
    raise _Interrupted
