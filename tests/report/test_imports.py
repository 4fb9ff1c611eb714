"""The report renders and computes nothing: it takes records and constants of what computes."""

import ast
from pathlib import Path

import pytest

import ridgebayes

ROOMS = ("predict", "inference", "evidence", "contact", "model", "checks", "comparison", "simulate")
ALLOWED = {
    # The public function has a comparison, and the one builder makes of it all that is shown.
    "__init__.py": {"report_data"},
    # A picture of a finite-element solution shows the solution, not a report.
    "figures/bodies.py": {"nodal_fields", "surface_table", "first_height", "shapes"},
}
REPORT = Path(ridgebayes.__file__).parent / "report"


def imported(path):
    """Return (module, name) of everything of this package that a file imports, anywhere in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            # A room as a whole: `from ridgebayes import drawing`.
            rooms = node.module == "ridgebayes"
            names = [alias.name for alias in node.names]
            found |= {(f"ridgebayes.{n}", "") if rooms else (node.module, n) for n in names}
        elif isinstance(node, ast.Import):
            found |= {(alias.name, "") for alias in node.names}
    return {(module, name) for module, name in found if module.split(".")[0] == "ridgebayes"}


@pytest.mark.parametrize("path", sorted(REPORT.rglob("*.py")), ids=lambda path: path.stem)
def test_report_imports_records_and_constants_of_what_computes(path):
    allowed = ALLOWED.get(path.relative_to(REPORT).as_posix(), set())
    functions = {
        name
        for module, name in imported(path)
        if module.split(".")[1] in ROOMS and not name[:1].isupper()
    }
    assert functions == allowed
