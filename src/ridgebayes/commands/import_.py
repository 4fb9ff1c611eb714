"""`ridgebayes import`: output of the user's own finite elements or tests as a contact table."""

from pathlib import Path
from typing import Any

from ridgebayes.commands.parsing import parse_numbers, parse_texture, refuse_existing
from ridgebayes.errors import InputError
from ridgebayes.fea.read import Given, import_files


def command(
    *,
    file: list[Path],
    out: Path | None,
    program: str | None,
    mapping: list[str] | None,
    texture: str | None,
    loads: str,
    brackets: bool,
    role: str | None,
    dry_run: bool,
    force: bool,
    **known: Any,
) -> None:
    """Do what the command line asks for; `known` are further fields of `Given`."""
    if out is None and not dry_run:
        raise InputError("-o: missing; expected the table to write, or --dry-run")
    if out is not None and not dry_run:
        refuse_existing(out, force)
    given = Given(
        map=tuple(mapping or ()),
        texture=None if texture is None else parse_texture(texture),
        loads=parse_numbers(loads, "--loads"),
        **known,
    )
    found = import_files(file, given, program=program, brackets=brackets, role=role)
    for line in found.messages:
        print(line)
    if out is not None and not dry_run:
        found.table.write(out)
        print(f"{out}: {len(found.table)} rows, {len(found.table.textures)} textures")
