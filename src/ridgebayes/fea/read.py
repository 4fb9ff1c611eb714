"""The job behind `import`: files of any known format to a contact table."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import Any

from ridgebayes.errors import InputError
from ridgebayes.fea import ansys, febio
from ridgebayes.fea.abaqus_dat import read_abaqus_dat
from ridgebayes.fea.abaqus_rpt import read_abaqus_rpt
from ridgebayes.fea.ansys import read_ansys
from ridgebayes.fea.calculix import read_calculix
from ridgebayes.fea.columns import SUFFIXES, read_columns
from ridgebayes.fea.deck import Deck, RunDeck, read_deck
from ridgebayes.fea.febio import read_febio
from ridgebayes.fea.given import Given, parse_map
from ridgebayes.fea.history import ContactHistory, RunBody, table_of
from ridgebayes.fea.mesh_series import read_series
from ridgebayes.fea.node_table import read_node_table
from ridgebayes.fea.record import FileError, Imported
from ridgebayes.fea.words import COUNTS, NOT_READ
from ridgebayes.runtime.reading import read_bytes
from ridgebayes.table.table import ContactTable

_LOOKED_AT = 20_000  # bytes
_ABAQUS = (b"THE FOLLOWING TABLE IS PRINTED", b"A B A Q U S", b"Abaqus")
_CALCULIX = (b"displacements (", b"contact stress (", b") for set ")
_OF_TABLES = ("sheet", "skip_rows", "header_row", "decimal", "empty", "count_is", "interpolate")
_OF_DECKS = ("deck", "surface", "reaction")
_OF_BODIES = ("texture", "symmetry", "top", "thickness", "corner")
# Options that are not of every format.
_ALLOWED: dict[str, tuple[str, ...]] = {
    "table": ("map", "texture", "thickness", "closed_is", "skip_empty", "load_se", *_OF_TABLES),
    "calculix": (*_OF_BODIES, *_OF_DECKS),
    "abaqus-dat": (*_OF_BODIES, *_OF_DECKS),
    "abaqus-rpt": (*_OF_BODIES, *_OF_DECKS),
    "febio": _OF_BODIES,
    "ansys": (*_OF_BODIES, "closed_is", "map"),
    "nodes": (*_OF_BODIES, "closed_is", "map", *_OF_TABLES[:5]),
    "series": (*_OF_BODIES, "field", "time", "loads"),
}
FORMATS = tuple(_ALLOWED)
_WITH_DECK = ("calculix", "abaqus-dat")
_OF_SEVERAL = ("febio", "ansys", "series")
_CORNER = re.compile(r"(?:status|pressure)\W*Q\W*(\d{1,6})")


def import_files(
    paths: Sequence[Path],
    given: Given,
    *,
    program: str | None = None,
    role: str | None = None,
) -> Imported:
    """Read a file, or the files of a run.

    Parameters
    ----------
    paths : sequence of Path
        One, several ``.vtu`` in the order of their loads, or what FEBio or ANSYS printed of a run
        into several.
    given : Given
        Facts that the files lack.
    program : str or None
        One of `ridgebayes.fea.read.FORMATS`; None looks.
    role : str or None
        Role of every row, if not None.

    Returns
    -------
    Imported

    Raises
    ------
    InputError
        If a file cannot be understood, the format needs what is not given, or takes not what is.
    """
    path = paths[0]
    name = recognise(path) if program is None else program
    if name not in FORMATS:
        raise InputError(f"--format {name}: expected {', '.join(FORMATS)}")
    if len(paths) > 1 and name not in _OF_SEVERAL:
        raise InputError(
            f"{len(paths)} files of format {name}: expected one (several of "
            f"{', '.join(_OF_SEVERAL)})"
        )
    _check_given(name, given)
    found = _read(name, paths, given)
    if role is not None:
        frame = found.table.frame.assign(role=role)
        table = ContactTable.from_frame(frame, where=found.table.where)
        found = replace(found, table=table, messages=(*found.messages, f"role: {role}"))
    return replace(found, messages=(f"format: {name}", *found.messages))


def recognise(path: Path) -> str:
    """Return the format of a file.

    Parameters
    ----------
    path : pathlib.Path
        The file.

    Returns
    -------
    str
        One of `FORMATS`.

    Raises
    ------
    InputError
        If it cannot be read, is of a program whose files are not read, or is none that is known.
    """
    suffix, name = path.suffix.lower(), path.name.lower()
    content = read_bytes(path)
    head = content[:_LOOKED_AT]
    for one in NOT_READ.values():
        if suffix in one.get("suffixes", ()) or name in one.get("names", ()):
            raise InputError(f"{path}: {one['is']} is not read; {one['instead']}")
    if suffix in (".vtu", ".pvd", ".xdmf", ".xmf"):
        return "series"
    if suffix == ".frd":
        return "calculix"
    for program, mark in (("febio", febio.MARK), ("ansys", ansys.MARK)):
        if mark.search(head):
            return program
    if b"Field Output Report" in head:
        return "abaqus-rpt"
    if suffix == ".dat":
        if any(mark in head for mark in _ABAQUS):
            return "abaqus-dat"
        if any(mark in head for mark in _CALCULIX):
            return "calculix"
    if suffix in SUFFIXES:
        return "table"
    raise InputError(
        f"{path}: its format is not recognised; expected --format {', '.join(FORMATS)}, or a "
        f"suffix of {', '.join(SUFFIXES)}, .frd, .vtu, .pvd or .xdmf"
    )


def _check_given(name: str, given: Given) -> None:
    for option in dict.fromkeys(chain(*_ALLOWED.values())):
        if getattr(given, option) != getattr(Given, option) and option not in _ALLOWED[name]:
            typed = option.replace("_", "-")
            raise InputError(f"--{typed}: not used by format {name}; remove it")
    if given.decimal not in (None, "point", "comma"):
        raise InputError(f"--decimal {given.decimal}: expected point, comma")
    if given.count_is not in (None, *COUNTS):
        raise InputError(f"--count-is {given.count_is}: expected {', '.join(sorted(COUNTS))}")


def _read(name: str, paths: Sequence[Path], given: Given) -> Imported:
    if name == "table":
        return read_columns(paths[0], given)
    given, messages = _completed(paths[0], given, name)
    body = _body(given)
    if name == "nodes":  # gaps are from the tops
        body = replace(body, top=body.top or 0.0)
    history = _history(name, paths, given, body)
    history = replace(history, messages=(*messages, *history.messages))
    return table_of(history, body, brackets=given.brackets)


def _history(name: str, paths: Sequence[Path], given: Given, body: RunBody) -> ContactHistory:
    """Return what the files of a run print."""
    path = paths[0]
    if name == "series":
        how = {key: getattr(given, key) or None for key in ("field", "time", "loads")}
        return read_series(paths, R=body.R, **how)
    if name == "febio":
        return read_febio(paths)
    if name == "nodes":
        return read_node_table(path, parse_map(given.map), given)
    if name == "ansys":
        corners = {}
        for key, node in parse_map(given.map).items():
            match = _CORNER.fullmatch(key.strip())
            if match is None or not node.isdigit():
                raise InputError(f"--map {key}={node}: expected 'status Q=4=NODE' for a listing")
            corners[int(match[1])] = int(node)
        if corners and given.symmetry is None:
            raise FileError(
                str(path),
                needs=["--symmetry: missing; expected half or full, the body of the reactions"],
                options={"symmetry": "?"},
            )
        return read_ansys(paths, closed_is=given.closed_is, corners=corners)
    if name == "abaqus-rpt":
        if given.deck is not None:
            read_deck(given.deck).check_material(body.E, body.nu, given.deck)
        options = {option: getattr(given, option) for option in _OF_DECKS}
        return read_abaqus_rpt(path, **options)
    assert given.deck is not None
    assert given.surface is not None
    assert given.reaction is not None
    run = RunDeck.read(given.deck, given.surface, given.reaction, E=body.E, nu=body.nu)
    if name == "abaqus-dat":
        return read_abaqus_dat(path, deck=run)
    # CalculiX writes its status beside its results.
    sta = path.with_suffix(".sta")
    return read_calculix(path, deck=run, sta=sta if sta.is_file() else None)


def _completed(path: Path, given: Given, name: str) -> tuple[Given, list[str]]:
    """Return what is given and what the run's deck says; ask for all the rest at once."""
    problems = FileError(str(path))
    found: dict[str, Any] = {}
    is_run = name in _WITH_DECK
    beside = path.with_suffix(".inp")
    if is_run and given.deck is None and beside.is_file():
        found["deck"] = beside
    file = given.deck or found.get("deck")
    deck = Deck() if file is None else read_deck(file)
    if given.nu is None and deck.nu is not None:
        found["nu"] = f"{deck.nu:.6g}"
    # The unit modulus of export-deck is 1 but for printed digits.
    if given.E is None and deck.E is not None and not math.isclose(deck.E, 1, rel_tol=1e-3):
        found["E"] = f"{deck.E:.10g}"
    if is_run:
        found |= _sets(deck, given, problems)
    if is_run and file is None:
        problems.need("--deck: missing; expected the run's input deck", deck="?.inp")
    _ask(path, name, given, file, deck, problems)
    problems.raise_all()
    if given.E is None and deck.E is None and file is not None:
        problems.messages.append(f"{file}: no material, so E = 1; --E gives another")
    if found:
        shown = ", ".join(f"{key} = {value}" for key, value in found.items())
        problems.messages.append(f"{file}: {shown}")
    return replace(given, **found), problems.messages


def _ask(
    path: Path, name: str, given: Given, file: Path | None, deck: Deck, problems: FileError
) -> None:
    """Ask for what neither the files of a run nor the user say of the body."""
    if given.texture is None:
        text = "--texture: missing; expected A,B, ridge and groove width over R"
        problems.need(text, texture="?,?")
    if given.nu is None and deck.nu is None:
        problems.need("--nu: missing; expected Poisson's ratio of the run", nu="?")
    without_deck = name in ("febio", "ansys", "nodes")
    is_line = given.time == "line" or (name == "abaqus-rpt" and file is None)
    if given.E is None and (without_deck or is_line):
        problems.need("--E: missing; expected Young's modulus, in the units of the run", E="?")
    if path.suffix.lower() == ".pvd" and given.time is None:
        problems.need(
            "--time: missing; expected line or p_over_E, what times or loads are", time="?"
        )
    if given.R is None and without_deck:
        problems.need("--R: missing; expected the body's radius, in the units of the run", R="?")


def _sets(deck: Deck, given: Given, problems: FileError) -> dict[str, str]:
    """Return the node sets of surface and load that a deck prints; ask for those it leaves open."""
    found = {}
    for key, kind in (("surface", "U"), ("reaction", "RF")):
        if getattr(given, key) is not None:
            continue
        sets = deck.printed.get(kind, [])
        others = [one for one in sets if one not in deck.printed.get("RF", [])]
        sets = others if kind == "U" and len(others) == 1 else sets
        if len(sets) == 1:
            found[key] = sets[0]
            continue
        there = ", ".join(sets or deck.nsets) or "in the deck"
        what = "the body's surface" if kind == "U" else "the driven nodes"
        problems.need(f"--{key}: missing; expected the node set of {what}: {there}", **{key: "?"})
    return found


def _body(given: Given) -> RunBody:
    assert given.texture is not None
    numbers = {}
    for key, text in given.numbers().items():
        try:
            numbers[key] = float(text)
        except ValueError:
            raise InputError(
                f"--{key} {text!r}: expected a plain number, in the units of the run"
            ) from None
    return RunBody(
        *given.texture,
        **numbers,
        symmetry=given.symmetry or "half",
        top=given.top,
        corner_over_R=given.corner,
    )
