"""Reader for tables of node results of any program, with a row for each node at each step."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from ridgebayes.fea.binary_tables import TABLES
from ridgebayes.fea.deck import Run
from ridgebayes.fea.delimited import table_content
from ridgebayes.fea.history import ContactHistory
from ridgebayes.fea.record import FileError, parse_map
from ridgebayes.fea.transitions import last_digit
from ridgebayes.fea.words import OF_NODES, STATUS_RULE, plain, split_header, touching
from ridgebayes.runtime.text import some_of
from ridgebayes.table.columns import SHOWN as MOST_SHOWN
from ridgebayes.table.rules import as_text

_CONTACT = ("gap", "pressure", "status")
_REQUIRED = {"load": "the load of the step, the same in its rows", "x": "where the node is"}


def read_node_table(run: Run) -> ContactHistory:
    """Read a table with a row for each node at each step.

    Parameters
    ----------
    run : Run
        One file of a format of `ridgebayes.fea.read.read_columns`, in a consistent system of
        units. Columns are ``load``, ``x`` (across the ridges), one of ``gap`` (to the ridges'
        tops), ``pressure`` and ``status``, and ``step`` and ``node`` if loads and coordinates do
        not distinguish steps and nodes. Used facts are the format of the file, headers by key
        (`map`), and codes of a status that mean contact (`closed_is`).

    Returns
    -------
    ContactHistory

    Raises
    ------
    InputError
        If a column is missing or ambiguous, a cell is invalid, or nodes differ between steps.
    """
    facts, problems = run.facts, FileError(run.where, run.facts)
    content = table_content(run.path, problems)
    source = TABLES[run.path.suffix.lower()](content, problems)
    columns = _columns(source.headers, parse_map(facts.map), problems)
    kind = next((key for key in _CONTACT if key in columns), "")
    if not kind:
        problems.need("no column gap, pressure or status: name it with --map 'gap=HEADER'")
    for key, what in _REQUIRED.items():
        if key not in columns:
            problems.need(f"no column {key} ({what}): name it with --map '{key}=HEADER'")
    problems.raise_all()
    numeric = {columns[key] for key in columns if key not in ("status", "node", "step")}
    cells = source.read(numeric, problems)
    for header in numeric:
        problems.cells(cells.index[cells[header].isna()], header, "expected a number in each row")
    if kind == "status":
        gap, bad = touching(as_text(cells[columns[kind]]), facts.closed_is)
        problems.cells(cells.index[bad | np.isnan(gap)], columns[kind], STATUS_RULE)
        if bad.any():
            problems.options["closed_is"] = "?"
        values = -gap
    else:
        values = cells[columns[kind]].to_numpy(dtype=float)
    problems.raise_all(source)
    step = cells[columns.get("step", columns["load"])]
    frame = pd.DataFrame(
        {
            "step": pd.factorize(step)[0],
            "node": cells[columns.get("node", columns["x"])].to_numpy(),
            "x": cells[columns["x"]].to_numpy(),
            "load": cells[columns["load"]].to_numpy(),
            "value": values,
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
    load, x, values = (np.asarray(part) for part in (loads.first(), wide["x"], wide["value"]))
    messages = [*problems.messages, f"{len(load)} steps of {x.shape[1]} nodes, by {kind}"]
    if kind == "gap":
        at, digits = np.stack([x, values], axis=-1), last_digit(values) / 2
        return ContactHistory(load, at, digits=digits, messages=messages)
    return ContactHistory(load, x[..., None], closed=values > 0, messages=messages)


def _columns(
    headers: tuple[str, ...], mapping: Mapping[str, str], problems: FileError
) -> dict[str, str]:
    """Return the header of each key, by mapping or by words."""
    columns = dict(mapping)
    for key, header in mapping.items():
        if key not in OF_NODES or header not in headers:
            names = some_of(map(repr, headers), MOST_SHOWN)
            raise problems.error(
                f"--map {key}={header}: expected one of {', '.join(OF_NODES)}, and one of the "
                f"columns {names}"
            )
    for key, words in OF_NODES.items():
        likely = [header for header in headers if plain(split_header(header)[0]) in words]
        if len(likely) > 1 and key not in mapping:
            shown = ", ".join(map(repr, likely))
            problems.need(
                f"columns {shown} could all be {key}: name one with --map", {key: likely[0]}
            )
        if likely:
            columns.setdefault(key, likely[0])
    return columns
