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
from importlib import import_module
from inspect import Signature
from types import SimpleNamespace
from typing import Annotated, Any

# Small matrices are fastest with one BLAS thread. This must be set before numpy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from ridgebayes.commands.options import COMMANDS, OUTPUT, parameters_of
from ridgebayes.errors import ComputationError, InputError, OutputError

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


def _command_function(name: str) -> Callable[..., None]:
    """Return the function of a command, with its options and the output options as parameters."""

    def call(**typed: Any) -> None:
        output = {option: typed.pop(option) for option in OUTPUT}
        code = _run_command(name, SimpleNamespace(command=name, **typed), output)
        if code:
            raise typer.Exit(code)

    parameters = parameters_of(name)
    call.__name__, call.__doc__ = name, COMMANDS[name]["help"]
    call.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    call.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    return call


for _name in COMMANDS:
    app.command(_name)(_command_function(_name))


def _run_command(name: str, asked: SimpleNamespace, typed_output: dict[str, bool]) -> int:
    """Run a command, print its answer or error, and return the exit code."""
    if name == "run" and asked.scheduler is None and asked.workers != 1:
        # Workers import at the same time as this process. Quick runs draw no figures in workers.
        figures = () if asked.accuracy == "quick" else _FIGURE_MODULES
        import_module("ridgebayes.runtime.pool").start_server(_RUN_MODULES + figures)
    terminal = import_module("ridgebayes.commands.terminal")
    progress = import_module("ridgebayes.runtime.progress")
    output = terminal.Output(**typed_output)
    answer, code, error = terminal.Answer(), 0, ""
    level = progress.VERBOSITY.set(output.verbosity)
    try:
        answer = import_module(f"ridgebayes.commands.{COMMANDS[name]['module']}").command(asked)
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
        name, code = next((word for word in words if word in COMMANDS), None), error.exit_code
        output = terminal.Output(as_json=True)
        terminal.tell(name, terminal.Answer(), code, error.format_message(), output)
    sys.exit(code if isinstance(code, int) else 0)


class _Interrupted(BaseException):
    """Interruption by Ctrl-C, which handlers of `Exception` do not catch."""


def _interrupt(signum: int, frame: object) -> None:
    raise _Interrupted
