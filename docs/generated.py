"""Pages of the site that follow from the code: options of commands, public names, contracts."""

import inspect
import shutil
from collections.abc import Iterable
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any, get_args

import typer
from netcdf_content import ATTRIBUTES, CONTENT
from pydantic import PlainValidator

import ridgebayes as rb
from ridgebayes.checks.cost import COST_COLUMNS
from ridgebayes.checks.coverage import COVERAGE_COLUMNS
from ridgebayes.checks.left_out import LEFT_OUT_COLUMNS
from ridgebayes.commands.cli import app
from ridgebayes.comparison.bayes_factors import BAYES_FACTOR_COLUMNS
from ridgebayes.comparison.scores import LOO_COLUMNS
from ridgebayes.distributions.grammar import CLOSED, USAGE
from ridgebayes.evidence.components import COMPONENT_COLUMNS
from ridgebayes.evidence.prior_sensitivity import SENSITIVITY_COLUMNS
from ridgebayes.evidence.tables import EVIDENCE_COLUMNS
from ridgebayes.fea.mapping import CONSTANTS, KEYS, PER_Q
from ridgebayes.fea.words import DIMENSIONS
from ridgebayes.friction.table import COLUMNS as FRICTION_COLUMNS
from ridgebayes.inference.diagnostics import SUMMARY_COLUMNS
from ridgebayes.inference.presets import QUICK
from ridgebayes.model.default_priors import NOISE_PRIORS, REASONS, coefficient_priors
from ridgebayes.model.forms import FORMS, form_named
from ridgebayes.report.inputs import glossary
from ridgebayes.scene.toml import SECTIONS
from ridgebayes.scene.units import EXAMPLES
from ridgebayes.table.columns import COLUMNS, Column
from ridgebayes.texture_design.record import DESIGN_COLUMNS

HOLDS = {  # keys of `--map` that are no columns of the contract; `DIMENSIONS` has their units
    "a": "ridge width",
    "b": "groove width",
    "pitch": "ridge and groove width together, in place of one of them",
    "R": "radius of the body",
    "D": "its diameter, in place of R",
    "thickness": "length of the body along the ridges; needed for forces",
    "offset": "lateral offset of the body from the groove's centre",
    "E": "Young's modulus",
    "p": "load per projected area",
    "p_lower": "as `p`: the last load at which the count was not yet reached",
    "line": "load per length along the ridges, 2 R p",
    "line_lower": "as `p_lower`",
    "force": "load of the whole body",
    "force_lower": "as `p_lower`",
    "load": "a load whose unit tells which of these it is",
    "load_lower": "as `p_lower`",
    "load_sd": "standard deviation of loads whose mean is the load, in its unit or another one",
    "load_sem": "standard error of each load, such as that of a mean, in its unit or another one",
    "n_mean": "how many loads the mean is of",
    "load_se": "standard error of every load, in any unit of loads (`--load-se`)",
    "status": "state of a row, as in the table; for each Q, of the contact at its corner",
}


def write_pages(folder: Path) -> None:
    """Write them, and leave alone what has not changed, so that a second build is quick."""
    folder.mkdir(exist_ok=True)
    pages = {
        "commands.md": commands(),
        "api.md": names(),
        "columns.md": columns(COLUMNS),
        "friction-columns.md": columns(FRICTION_COLUMNS),
        "design-columns.md": table(
            ("column", "holds"), [(f"`{name}`", holds) for name, holds in DESIGN_COLUMNS.items()]
        ),
        "glossary.md": table(("word", "means"), glossary()),
        "run-columns.md": run_columns(),
        "netcdf.md": netcdf(),
        "scene-keys.md": scene_keys(),
        "map-keys.md": map_keys(),
        "default-priors.md": default_priors(),
        "distributions.md": table(("distribution",), [(f"`{one}`",) for one in USAGE.values()]),
    }
    for name, lines in pages.items():
        text = "\n".join(lines) + "\n"
        path = folder / name
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def write_report(folder: Path) -> None:
    """Write the report of a quick run on the embedded sweep, unless it is there: half a minute."""
    folder.mkdir(exist_ok=True)
    path = folder / "sweep-report.html"
    if not path.is_file():
        rb.write_report(rb.compare(rb.paper_sweep(), accuracy=QUICK), path)


def copy_notebooks(source: Path, folder: Path) -> None:
    """Copy the notebooks to where Sphinx reads them."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for path in sorted(source.glob("*.ipynb")):
        shutil.copy2(path, folder / path.name)


def table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> list[str]:
    """Return a Markdown table."""
    cells = [head, ("---",) * len(head), *rows]
    return ["| " + " | ".join(cell.replace("|", r"\|") for cell in row) + " |" for row in cells]


def commands() -> list[str]:
    """Return a section for each command with its arguments and options."""
    lines = []
    for name, command in typer.main.get_command(app).commands.items():
        words = (command.help or "").replace("\\[", "[")  # on a terminal a bracket begins a style
        lines += [f"### `ridgebayes {name}`", "", words, ""]
        rows = [option(one) for one in command.params if one.name != "help"]
        lines += [*table(("option", "means", "default"), rows), ""]
    return lines


def option(one: Any) -> tuple[str, str, str]:
    """Return how an option is written, what it means, and what holds without it."""
    names = ", ".join(f"`{name}`" for name in sorted(one.opts, key=len, reverse=True))
    if one.param_type_name == "argument":
        names = f"`{one.name.upper()}`"
    default = (
        "" if callable(one.default) or one.default in (None, False, (), "") else f"`{one.default}`"
    )
    return names, one.help or "", "required" if one.required else default


def kinds_of_names() -> dict[str, list[str]]:
    """Return the public names by kind."""
    kinds: dict[str, list[str]] = {"Functions": [], "Classes": [], "Errors": []}
    for name in rb.__all__:
        value = getattr(rb, name)
        if inspect.isclass(value):
            kinds["Errors" if issubclass(value, Exception) else "Classes"].append(name)
        elif callable(value):
            kinds["Functions"].append(name)
    return kinds


def names() -> list[str]:
    """Return a table for each kind of public name: a line for each, which leads to its page."""
    lines = []
    for kind, found in kinds_of_names().items():
        role = "func" if kind == "Functions" else "class"
        rows = [
            (f"{{py:{role}}}`~ridgebayes.{name}`", (getattr(rb, name).__doc__ or "").split("\n")[0])
            for name in found
        ]
        lines += [f"## {kind}", "", *table(("name", "does" if role == "func" else "is"), rows), ""]
    return lines


def write_names(folder: Path) -> None:
    """Write a page for each public name."""
    shutil.rmtree(folder, ignore_errors=True)
    for kind, found in kinds_of_names().items():
        # Apart, as some file systems do not tell Design from design.
        below = folder / kind.lower()
        below.mkdir(parents=True)
        for name in found:
            lines = [f"# {name}", "", "```{eval-rst}"]
            if kind == "Functions":
                lines += [f".. autofunction:: ridgebayes.{name}"]
            else:
                lines += [f".. autoclass:: ridgebayes.{name}", "   :members:"]
                lines += ["   :inherited-members: BaseModel, Exception, object"]
            (below / f"{name}.md").write_text("\n".join([*lines, "```", ""]), encoding="utf-8")


def columns(contract: Iterable[Column]) -> list[str]:
    """Return the contract of a table."""
    rows = []
    for one in contract:
        default = "required" if one.default is None else f"`{one.default}`"
        if one.default in ("",) or one.default != one.default:
            default = ""
        rows.append((f"`{one.name}`", one.means, one.rule.removeprefix("must be "), default))
    return table(("column", "holds", "rule", "if absent"), rows)


def run_columns() -> list[str]:
    """Return the columns of the tables that a run leaves."""
    files = {
        "summary.csv": ["form", "noise", *SUMMARY_COLUMNS],
        "evidence.csv": EVIDENCE_COLUMNS,
        "bayes_factors.csv": BAYES_FACTOR_COLUMNS,
        "components.csv": COMPONENT_COLUMNS,
        "prior_sensitivity.csv": SENSITIVITY_COLUMNS,
        "loo.csv": LOO_COLUMNS,
        "left_out.csv": LEFT_OUT_COLUMNS,
        "coverage.csv": COVERAGE_COLUMNS,
        "costs.csv": COST_COLUMNS,
    }
    rows = [(f"`{name}`", ", ".join(f"`{one}`" for one in held)) for name, held in files.items()]
    return table(("file", "columns"), rows)


def scene_keys() -> list[str]:
    """Return the keys of a scene file."""
    rows = []
    for section, model in SECTIONS.items():
        title = f"`[[{section}]]`" if section in ("texture", "joint") else f"`[{section}]`"
        for name, field in model.model_fields.items():
            dimension = dimension_of((field.annotation, *field.metadata))
            unit = f"`{EXAMPLES[dimension]}`" if dimension else ""
            default = "required" if field.is_required() else f"`{field.default}`"
            default = "" if field.default is None else default
            rows.append((title, f"`{name}`", field.description or "", unit, default))
    return table(("table", "key", "holds", "unit as in", "if absent"), rows)


def dimension_of(parts: Iterable[Any]) -> Any:
    """Return the dimension that the type of a key is read as, or None."""
    for part in parts:
        if isinstance(part, PlainValidator) and isinstance(part.func, partial):
            return part.func.args[0]
        if found := dimension_of((*get_args(part), *getattr(part, "__metadata__", ()))):
            return found
    return None


def netcdf() -> list[str]:
    """Return the groups, variables and attributes of a file of a posterior."""
    rows = [
        (f"`{group}`", f"`{name}`" if name != "PARAMETER" else name, ", ".join(dims), holds)
        for group, variables in CONTENT.items()
        for name, (dims, holds) in variables.items()
    ]
    attributes = [(f"`{name}`", holds) for name, holds in ATTRIBUTES.items()]
    return [
        *table(("group", "variable", "dimensions", "holds"), rows),
        "",
        *table(("attribute of the file", "holds"), attributes),
    ]


def map_keys() -> list[str]:
    """Return the keys of a map of columns."""
    rows = []
    for key in dict.fromkeys((*KEYS, *CONSTANTS)):
        column = "yes" if key in KEYS else ""
        if key in PER_Q:
            column += ", or one for each Q" if column else "one for each Q"
        unit = f"`{EXAMPLES[DIMENSIONS[key]]}`" if key in DIMENSIONS else ""
        holds = HOLDS.get(key) or next(one.means for one in COLUMNS if one.name == key)
        rows.append((f"`{key}`", holds, unit, column, "yes" if key in CONSTANTS else ""))
    return table(("key", "holds", "unit as in", "in `[columns]`", "in `[values]`"), rows)


def default_priors() -> list[str]:
    """Return the tables of a priors file with the parameters of each, and their defaults."""
    owned = [
        (form.name, name, prior)
        for form in map(form_named, FORMS)
        for name, prior in coefficient_priors(form).items()
    ]
    owned += [("noise", name, prior) for name, prior in NOISE_PRIORS.items()]
    rows = [
        (f"`[{owner}]`", f"`{name}`", f"`{as_text(prior)}`", REASONS[name])
        for owner, name, prior in owned
    ]
    rows.insert(1, ("`[power-law]`", "`K`", "`lognormal(auto, 0.3)`", REASONS["K"]))
    return table(("table", "parameter", "default", "why"), rows)


def as_text(prior: Any) -> str:
    """Return a distribution as a file of priors has it."""
    name = next(name for name, kind in CLOSED.items() if isinstance(prior, kind))
    return f"{name}({', '.join(f'{getattr(prior, one.name):g}' for one in fields(prior))})"
