"""Import of runs of finite element programs: collection of missing facts, and reading."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ridgebayes.errors import InputError
from ridgebayes.fea.abaqus_dat import read_abaqus_dat
from ridgebayes.fea.abaqus_rpt import read_abaqus_rpt
from ridgebayes.fea.ansys import read_ansys
from ridgebayes.fea.calculix import read_calculix
from ridgebayes.fea.deck import Deck, read_deck
from ridgebayes.fea.febio import read_febio
from ridgebayes.fea.history import ContactHistory, RunBody, table_of
from ridgebayes.fea.mesh_series import read_series
from ridgebayes.fea.node_table import read_node_table
from ridgebayes.fea.record import FileError, Given, Imported

_WITH_DECK = ("calculix", "abaqus-dat")
_READERS: dict[str, Callable[[Sequence[Path], Given], ContactHistory]] = {
    "calculix": read_calculix,
    "abaqus-dat": read_abaqus_dat,
    "abaqus-rpt": read_abaqus_rpt,
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
    facts, deck, messages = _completed(paths[0], facts, name)
    body = _body(facts)
    if facts.deck is not None:
        deck.check_material(body.E, body.nu, facts.deck)
    history = _READERS[name](paths, facts)
    history = replace(history, messages=(*messages, *history.messages))
    return table_of(history, body, brackets=facts.brackets)


def _completed(path: Path, facts: Given, name: str) -> tuple[Given, Deck, list[str]]:
    """Complete the facts with those of the deck, and ask for all missing facts in one error.

    Return the facts, the deck, and messages.
    """
    problems = FileError(str(path))
    more: dict[str, Any] = {}
    has_deck = name in _WITH_DECK
    beside = path.with_suffix(".inp")
    if has_deck and facts.deck is None and beside.is_file():
        more["deck"] = beside
    file = facts.deck or more.get("deck")
    deck = Deck() if file is None else read_deck(file)
    if facts.nu is None and deck.nu is not None:
        more["nu"] = f"{deck.nu:.6g}"
    # Decks of export-deck have E = 1 up to printed digits; the default of E is exactly 1.
    if facts.E is None and deck.E is not None and not math.isclose(deck.E, 1, rel_tol=1e-3):
        more["E"] = f"{deck.E:.10g}"
    if deck.thickness is not None and deck.thickness != 1:
        more["thickness"] = f"{deck.thickness:.10g}"
    sets, needed = _sets(deck) if has_deck else ({}, {})
    more |= sets
    if has_deck and file is None:
        needed["deck"] = "the run's input deck"
    needed |= _required(path, name, facts, deck)
    for key, what in needed.items():
        if getattr(facts, key) is None:
            value = {"texture": "?,?", "deck": "?.inp"}.get(key, "?")
            problems.need(f"--{key}: missing; expected {what}", **{key: value})
    if name == "ansys" and facts.map and facts.symmetry is None:  # no x to infer it
        problems.need("--symmetry: missing; expected half or full, the body", symmetry="?")
    if name == "nodes" and facts.top is None:  # gaps are heights above the tops
        facts = replace(facts, top=0.0)
    problems.raise_all()
    more = {key: value for key, value in more.items() if getattr(facts, key) is None}
    if more:
        shown = ", ".join(f"{key} = {value}" for key, value in more.items())
        problems.messages.append(f"{file}: {shown}")
    return replace(facts, **more), deck, problems.messages


def _required(path: Path, name: str, facts: Given, deck: Deck) -> dict[str, str]:
    """Return the facts that neither the run's files nor its deck give: option and description."""
    without_deck = name in ("febio", "ansys", "nodes")
    needed = {"texture": "A,B, ridge and groove width over R"}
    if deck.nu is None:
        needed["nu"] = "Poisson's ratio of the run"
    if deck.E is None and (name != "series" or facts.time == "line"):
        needed["E"] = "Young's modulus, in the units of the run"
    if path.suffix.lower() == ".pvd":
        needed["time"] = "line or p_over_E, what times or loads are"
    if without_deck:
        needed["R"] = "the body's radius, in the units of the run"
    return needed


def _sets(deck: Deck) -> tuple[dict[str, str], dict[str, str]]:
    """Return the surface and reaction sets if the deck prints one of each, and questions if not."""
    names, needed = {}, {}
    for key, kind, what in (
        ("surface", "U", "the body's surface"),
        ("reaction", "RF", "the driven nodes"),
    ):
        sets = deck.printed.get(kind, [])
        others = [name for name in sets if name not in deck.printed.get("RF", [])]
        sets = others if kind == "U" and len(others) == 1 else sets
        there = ", ".join(sets or deck.nsets) or "in the deck"
        if len(sets) == 1:
            names[key] = sets[0]
        else:
            needed[key] = f"the node set of {what}: {there}"
    return names, needed


def _body(facts: Given) -> RunBody:
    assert facts.texture is not None
    numbers = {}
    for key, text in facts.numbers().items():
        try:
            numbers[key] = float(text)
        except ValueError:
            raise InputError(
                f"--{key} {text!r}: expected a plain number, in the units of the run"
            ) from None
    return RunBody(
        *facts.texture,
        **numbers,
        symmetry=facts.symmetry or "half",
        top=facts.top,
        corner_over_R=facts.corner,
    )
