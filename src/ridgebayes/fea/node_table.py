"""Reader for tables of node results of any program, with a row for each node at each step."""

from dataclasses import replace

import numpy as np
import pandas as pd

from ridgebayes.fea.binary_tables import TABLES
from ridgebayes.fea.convert import Converter
from ridgebayes.fea.deck import Run
from ridgebayes.fea.delimited import table_content
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.mapping import Columns, Use
from ridgebayes.fea.record import FileError
from ridgebayes.fea.transitions import half_digit
from ridgebayes.fea.words import OF_NODES, load_kind, named

_CONTACT = ("gap", "pressure", "status")
_REQUIRED = {"load": "the load of the step, the same in its rows", "x": "where the node is"}


def read_node_table(run: Run) -> ContactHistory:
    """Read a table with a row for each node at each step.

    Parameters
    ----------
    run : Run
        One file of a format of `ridgebayes.fea.read.read_columns`. Columns are ``load``, ``x``
        (across the ridges), one of ``gap`` (to the ridges' tops), ``pressure`` and ``status``, and
        ``step`` and ``node`` if loads and coordinates do not distinguish steps and nodes. All
        lengths, loads, R and E have units, or none has. Used facts are the format of the file,
        headers by key (`map`), R, E, the thickness, and codes of a status that mean contact
        (`closed_is`).

    Returns
    -------
    ContactHistory
        In units of the radius.

    Raises
    ------
    InputError
        If a column is missing or ambiguous, a cell is invalid, units are missing, or nodes differ
        between steps.
    """
    mapping, values = run.facts.columns_and_values()
    body = {key: text for key, text in values.items() if key in ("R", "E", "thickness")}
    problems = FileError(str(run.path), run.facts, body)
    source = TABLES[run.path.suffix.lower()](table_content(run.path, problems), problems)
    columns = Columns(source.headers, problems, OF_NODES)
    for name, text in mapping.items():
        columns.map(name, text)
    columns.guess(lambda words: named(words, OF_NODES))
    columns.settle()
    uses = {use.key: use for use in columns.uses}
    kind = next((key for key in _CONTACT if key in uses), "")
    if not kind:
        problems.need("no column gap, pressure or status: name it with --map 'gap=HEADER'")
    for key, what in _REQUIRED.items():
        if key not in uses:
            problems.need(f"no column {key} ({what}): name it with --map '{key}=HEADER'")
    problems.raise_all()
    numeric = {use.header for key, use in uses.items() if key not in ("status", "node", "step")}
    cells = source.read(numeric, problems)
    for header in numeric:
        problems.cells(cells.index[cells[header].isna()], header, "expected a number in each row")
    load_unit = uses["load"].own_unit
    load = Use(load_kind(load_unit) or "force", uses["load"].header, uses["load"].unit)
    if load.key == "force" and not load_unit:
        body.setdefault("thickness", "1")  # a slice of unit thickness, as in other runs
    converter = Converter(
        cells, [load, *(uses[key] for key in ("x", "gap") if key in uses)], problems
    )
    p_over_E, x = converter.load(), converter.over_R("x")
    if kind == "status":
        value = -converter.status(uses[kind], may_be_empty=False)
    else:
        gap = converter.over_R("gap")
        value = cells[uses[kind].header].to_numpy(dtype=float) if gap is None else gap
    converter.summarize()
    problems.raise_all(source)
    half = load.key == "force" and run.symmetry == "half"
    parts = {key: cells[use.header].to_numpy() for key, use in uses.items()}
    frame = pd.DataFrame(
        {
            "step": pd.factorize(parts.get("step", parts["load"]))[0],
            "node": parts.get("node", parts["x"]),
            "x": x,
            "load": p_over_E,
            "value": value,
        }
    )
    loads = frame.groupby("step")["load"]
    if (loads.min() != loads.max()).any():
        raise problems.error("a step has several loads: expected one load in all rows of a step")
    if frame.duplicated(["step", "node"]).any():
        raise problems.error("a node stands twice in a step: name the column of steps")
    wide = frame.pivot_table(index="step", columns="node", values=["x", "value"])
    if wide.isna().to_numpy().any():
        raise problems.error("the steps have different nodes: expected the same nodes in all steps")
    at, values_at = (wide[name].to_numpy() for name in ("x", "value"))
    how = f"{len(at)} steps of {at[0].size} nodes, by {kind}{', load times 2' if half else ''}"
    load_at, said = (2.0 if half else 1.0) * loads.first().to_numpy(), [*problems.messages, how]
    history = ContactHistory(load_at, R=1.0, load_is="p_over_E", messages=said)
    if kind != "gap":
        return replace(history, at=at[..., None], closed=values_at > 0)
    printed = parts["gap"]
    digits = half_digit(printed, near_0=True) * np.ptp(value) / max(np.ptp(printed), 1e-300)
    return replace(history, at=np.stack([at, values_at], axis=-1), digits=float(digits))
