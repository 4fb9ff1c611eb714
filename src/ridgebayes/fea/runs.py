"""Import of runs of finite element programs: collection of missing facts, and reading."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ridgebayes.errors import InputError
from ridgebayes.fea.abaqus import read_abaqus_dat
from ridgebayes.fea.calculix import read_calculix
from ridgebayes.fea.deck import Deck, Run, read_deck
from ridgebayes.fea.history import ContactHistory, table_of
from ridgebayes.fea.listings import read_ansys, read_febio
from ridgebayes.fea.meshes import read_series
from ridgebayes.fea.node_table import read_node_table
from ridgebayes.fea.record import FileError, Given, Imported, provenance

_WITH_DECK = ("calculix", "abaqus-dat")
_WITHOUT_PLACES = ("febio", "ansys")  # formats whose files may lack R
_READERS: dict[str, Callable[[Run], ContactHistory]] = {
    "calculix": read_calculix,
    "abaqus-dat": read_abaqus_dat,
    "febio": read_febio,
    "ansys": read_ansys,
    "nodes": read_node_table,
    "series": read_series,
}


def read_run(name: str, paths: Sequence[Path], facts: Given) -> Imported:
    """Read the files of a run.

    Parameters
    ----------
    name : str
        Format: one of `ridgebayes.fea.read.FORMATS` except ``table``.
    paths : sequence of Path
        Files of the run.
    facts : Given
        Facts that the files do not contain.

    Raises
    ------
    InputError
        If a file cannot be parsed, or a fact is missing.
    """
    path, problems = paths[0], FileError(str(paths[0]), facts)
    file, beside = facts.deck, path.with_suffix(".inp")
    if name in _WITH_DECK and file is None and beside.is_file():
        file = beside
    deck = Deck() if file is None else read_deck(file)
    facts = _completed(name, deck, problems)
    run = _run(name, paths, facts, deck)
    for key, value, typed in (("E", deck.E, run.E), ("nu", deck.nu, run.nu)):
        if value is not None and not math.isclose(value, typed, rel_tol=1e-3):
            has = f"the material has {key} = {value:.6g}, and {typed:g} was given"
            raise InputError(f"{file}: {has}; use --{key} as in the deck")
    history = _READERS[name](run)
    named = {"deck": file and file.name, "surface": facts.surface, "reaction": facts.reaction}
    details = [f"{key}={text}" for key, text in named.items() if text]
    files = history.files or [other.name for other in paths[1:]]
    source = provenance(path, name, *details, *files)
    history = replace(history, messages=(*problems.messages, *history.messages))
    return table_of(history, run, solver=name.partition("-")[0], source=source)


def _completed(name: str, deck: Deck, problems: FileError) -> Given:
    """Complete the facts with those of the deck, and ask for all missing facts in one error."""
    facts, file = problems.facts, deck.path
    more: dict[str, Any] = {"deck": file}
    if deck.nu is not None:
        more["nu"] = f"{deck.nu:.6g}"
    # Decks of export-deck have E = 1 up to printed digits; the default of E is exactly 1.
    if deck.E is not None and not math.isclose(deck.E, 1, rel_tol=1e-3):
        more["E"] = f"{deck.E:.10g}"
    sets = deck.result_sets if name in _WITH_DECK else {}
    more |= {key: names[0] for key, names in sets.items() if len(names) == 1}
    surface = facts.surface or more.get("surface")
    thickness = deck.thickness_of(surface) if surface and file is not None else deck.thickness
    if thickness is not None and thickness != 1:
        more["thickness"] = f"{thickness:.10g}"
    more = {key: value for key, value in more.items() if value and getattr(facts, key) is None}
    for key, what in _needed(name, facts, deck, problems.where).items():
        if getattr(facts, key) is None and key not in more:
            if key in sets:
                what += f": {', '.join(sets[key] or deck.nsets) or 'in the deck'}"
            text = f"--{key}: missing; expected {what}"
            problems.need(text, **{key: {"texture": "?,?", "deck": "?.inp"}.get(key, "?")})
    problems.raise_all()
    if more:
        shown = ", ".join(f"{key} = {value}" for key, value in more.items())
        problems.messages.append(f"{file}: {shown}")
    if name == "nodes" and facts.top is None:  # gaps are heights above the tops
        more["top"] = 0.0
    return replace(facts, **more)


def _needed(name: str, facts: Given, deck: Deck, where: str) -> dict[str, str]:
    """Return the facts that a run needs, from the user or its deck: option and description."""
    is_placed, has_deck = name not in _WITHOUT_PLACES, name in _WITH_DECK
    # A table of nodes may have R and E in columns, and units; it asks itself.
    is_load = name != "nodes" and (name != "series" or facts.time == "line")  # and not p/E
    has_E = deck.E is not None or (has_deck and deck.path is None)  # which is asked for
    needed = {
        "surface": (has_deck, "the node set of the body's surface"),
        "reaction": (has_deck, "the node set of the driven nodes"),
        "deck": (has_deck, "the run's input deck"),
        "texture": (True, "A,B, ridge and groove width over R"),
        "nu": (True, "Poisson's ratio of the run"),
        "E": (is_load and not has_E, "Young's modulus, in the units of the run"),
        "time": (where.lower().endswith(".pvd"), "line or p_over_E, what times or loads are"),
        "R": (not is_placed, "the body's radius, in the units of the run"),
        # Nodes at corners have no x that tells it.
        "symmetry": (name == "ansys" and bool(facts.map), "half or full, the body"),
    }
    return {key: what for key, (is_needed, what) in needed.items() if is_needed}


def _run(name: str, paths: Sequence[Path], facts: Given, deck: Deck) -> Run:
    assert facts.texture is not None
    numbers = {}
    for key, text in facts.numbers().items():
        if name == "nodes" and key != "nu":
            continue
        try:
            numbers[key] = float(text)
        except ValueError:
            raise InputError(
                f"--{key} {text!r}: expected a plain number, in the units of the run"
            ) from None
    return Run(
        *facts.texture,
        **numbers,
        symmetry=facts.symmetry or "half",
        top=facts.top,
        corner_over_R=facts.corner,
        paths=paths,
        facts=facts,
        deck=deck,
    )
