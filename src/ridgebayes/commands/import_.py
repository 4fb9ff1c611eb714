"""`ridgebayes import`: convert results of a finite-element program or a test to a contact table."""

import json
import re
import shlex
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path

from ridgebayes.commands import table_options as options
from ridgebayes.commands.parsing import parse_numbers, refuse_output
from ridgebayes.commands.shared_options import FLAGS
from ridgebayes.commands.terminal import Answer
from ridgebayes.errors import InputError
from ridgebayes.fea.read import import_files
from ridgebayes.fea.record import FileError, Given
from ridgebayes.runtime.atomic import write_text
from ridgebayes.runtime.text import count
from ridgebayes.scene.typed import parse_texture


def command(asked: options.Import) -> Answer:
    """Import files and write a contact table; suggest a command line if facts are missing."""
    for path in (asked.write_map, None if asked.dry_run else asked.out):
        if path is not None:
            refuse_output(path, asked.force)
    facts = vars(asked) | {
        "map": tuple(asked.mapping or ()),
        "empty": tuple(asked.empty or ()),
        "skip_rows": asked.skip_rows or 0,
        "texture": None if asked.texture is None else parse_texture(asked.texture, asked.R),
        "loads": parse_numbers(asked.loads, "--loads"),
        "closed_is": _codes(asked.closed_is),
    }
    facts_typed = Given(**{fact.name: facts[fact.name] for fact in fields(Given)})
    try:
        imported = import_files(asked.file, facts_typed, program=asked.program, role=asked.role)
    except FileError as error:
        wrote = ""
        if asked.write_map is not None:
            _write_map(asked.write_map, {**error.known, **error.mapping}, error.options, asked)
            wrote = f"\n{asked.write_map}: a map to start from, for --map {asked.write_map}"
        if not (error.options or error.mapping):
            raise InputError(f"{error}{wrote}") from None
        first = "correct the file, then run" if error.is_broken else "run"
        again = _command_line(asked, error.options, error.mapping)
        marks = ", with your values in place of ?" if "?" in again else ""
        check = ", if that is what you mean" if not marks else ""
        raise InputError(f"{error}{wrote}\n{first}{marks}{check}:\n  {again}") from None
    files = []
    if asked.write_map is not None:
        _write_map(asked.write_map, imported.known, {}, asked)
        files.append(asked.write_map)
    size = {"rows": len(imported.table), "textures": len(imported.table.textures)}
    if asked.dry_run:
        return Answer(imported.messages, size, files, warnings=imported.cautions)
    if asked.out is None:
        lines = "\n".join(imported.messages)
        raise InputError(
            f"-o: missing; expected the table to write, or --dry-run\n{lines}\nrun:\n"
            f"  {_command_line(asked)}"
        )
    imported.table.write(asked.out)
    summary = f"{asked.out}: {count(size['rows'], 'row')}, {count(size['textures'], 'texture')}."
    if len(imported.table.calibration):  # held-out rows alone cannot be fitted
        summary += f" next: ridgebayes run --table {shlex.quote(str(asked.out))}"
    return Answer(
        (*imported.messages, summary), size, [*files, asked.out], warnings=imported.cautions
    )


def _codes(text: str) -> tuple[int, ...]:
    """Return comma-separated whole numbers."""
    if not re.fullmatch(r"\s*|\s*\d{1,6}(\s*,\s*\d{1,6})*\s*", text):
        raise InputError(
            f"--closed-is {text}: expected whole numbers separated by commas, such as 2,3"
        )
    return tuple(map(int, re.findall(r"\d+", text)))


def _command_line(
    asked: options.Import, more: Mapping[str, str] | None = None, mapping: Mapping[str, str] = {}
) -> str:
    """Return the typed command line with additional options, quoted for a shell."""
    values = vars(asked) | dict(more or {})
    files = [str(path) for path in values.pop("file")]
    values["out"] = values["out"] or f"{Path(files[0]).stem}-table.csv"
    typed = [word for word in asked.mapping or () if word.partition("=")[0].strip() not in mapping]
    values["mapping"], values["skip_empty"] = None, bool(values["skip_empty"])
    values["map"] = [*typed, *(f"{key}={header}" for key, header in mapping.items())]
    if isinstance(values["empty"], str):
        values["empty"] = [*(asked.empty or ()), *values["empty"].split("\n")]
    words = ["ridgebayes", "import", *files]
    for name, value in values.items():
        option = FLAGS.get(name, (f"--{name.replace('_', '-')}",))[0]
        if value is True:
            words.append(option)
        elif value is not False and value not in (None, "", []):
            parts = value if isinstance(value, list) else [value]
            words += [word for part in parts for word in (option, str(part))]
    return shlex.join(words)


def _write_map(
    path: Path, columns: Mapping[str, str], needed: Mapping[str, str], asked: options.Import
) -> None:
    """Write a TOML file of columns and values, with marks for those to fill in."""
    constants = {key: getattr(asked, key) for key in ("R", "E", "nu", "thickness")}
    constants |= {key: text for key, text in needed.items() if key in constants}

    def lines(entries: Mapping[str, str | None]) -> list[str]:
        return [
            f"{key if re.fullmatch('[A-Za-z_]+', key) else json.dumps(key)} = {json.dumps(text)}"
            + ("  # fill in" if "?" in text else "")
            for key, text in entries.items()
            if text is not None
        ]

    text = ["[columns]", *lines(columns), "", "[values]", *lines(constants)]
    write_text("\n".join(text) + "\n", path)
