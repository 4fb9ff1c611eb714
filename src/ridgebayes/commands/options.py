"""Options of the commands, which `options.toml` declares, as parameters for typer.

The module imports nothing heavy, so that help is fast.
"""

import tomllib
from inspect import Parameter
from pathlib import Path
from typing import Annotated, Any

import typer

_DECLARED = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
COMMANDS: dict[str, dict[str, Any]] = _DECLARED["commands"]  # by command name
OUTPUT: dict[str, dict[str, Any]] = _DECLARED["output"]  # options of all commands
_TYPES: dict[str, Any] = {
    "list[str]": list[str],
    "list[Path]": list[Path],
    **{kind.__name__: kind for kind in (str, int, float, bool, Path)},
}


def options_of(command: str) -> dict[str, dict[str, Any]]:
    """Return the declared options of a command by name, without those of all commands."""
    declared, shared = COMMANDS[command], _DECLARED["shared"]
    return {name: shared.get(name, {}) | declared.get(name, {}) for name in declared["options"]}


def flags_of(name: str, option: dict[str, Any]) -> list[str]:
    """Return how an option is typed."""
    flags: list[str] = option.get("flags", [f"--{name.replace('_', '-')}"])
    return flags


def parameters_of(command: str) -> list[Parameter]:
    """Return the options of a command as parameters that typer converts."""
    parameters = []
    for name, option in (options_of(command) | OUTPUT).items():
        kind = _TYPES[option["type"]]
        default = option.get("default", False if kind is bool else None)
        mark: Any
        if "argument" in option:
            mark = typer.Argument(metavar=option.get("metavar"))
        else:
            mark = typer.Option(*flags_of(name, option), min=option.get("min"))
        mark.help = " ".join(option["help"].split())
        if "required" in option:
            default = Parameter.empty
        elif default is None:
            kind = kind | None
        elif kind is Path:
            default = Path(default)
        how = {"default": default, "annotation": Annotated[kind, mark]}
        parameters.append(Parameter(name, Parameter.KEYWORD_ONLY, **how))
    return parameters
