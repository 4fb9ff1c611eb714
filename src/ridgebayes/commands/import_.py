"""`ridgebayes import`: output of the user's own finite elements or tests as a contact table."""

from dataclasses import fields

from ridgebayes.commands import options
from ridgebayes.commands.parsing import parse_numbers, parse_texture, refuse_existing
from ridgebayes.commands.terminal import Answer
from ridgebayes.errors import InputError
from ridgebayes.fea.read import Given, import_files


def command(asked: options.Import) -> Answer:
    """Do what the command line asks for."""
    if asked.out is None and not asked.dry_run:
        raise InputError("-o: missing; expected the table to write, or --dry-run")
    if asked.out is not None and not asked.dry_run:
        refuse_existing(asked.out, asked.force)
    known = {
        one.name: getattr(asked, one.name) for one in fields(Given) if hasattr(asked, one.name)
    }
    known["map"] = tuple(asked.mapping or ())
    known["texture"] = None if asked.texture is None else parse_texture(asked.texture)
    known["loads"] = parse_numbers(asked.loads, "--loads")
    given = Given(**known)
    found = import_files(
        asked.file, given, program=asked.program, brackets=asked.brackets, role=asked.role
    )
    size = {"rows": len(found.table), "textures": len(found.table.textures)}
    if asked.out is None or asked.dry_run:
        return Answer(found.messages, size)
    found.table.write(asked.out)
    told = f"{asked.out}: {size['rows']} rows, {size['textures']} textures"
    return Answer((*found.messages, told), size, [asked.out])
