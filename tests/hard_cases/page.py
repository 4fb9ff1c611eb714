"""Write docs/hard-cases.md: each case, its expected and its actual result.

``python -m tests.hard_cases.page`` from the repository's root runs every case, and stops at the
first that fails.
"""

import html
import platform
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from tests.hard_cases.case import HardCase
from tests.hard_cases.table import AREAS, cases_of

PAGE = Path(__file__).parents[2] / "docs" / "hard-cases.md"
HEAD = """# Edge cases

{n_case} inputs chosen to break a calibration package. Each input is answered correctly, or
refused with a message. The column *seen* has the results of {date}
(Python {python}, NumPy {numpy}). `make hard-cases` runs all cases of
`tests/hard_cases` and writes this page. "1.01 for 1.02" is a result and its exact value.
"""
COLUMNS = "| case | why it is hard | expected | seen |\n|---|---|---|---|"


def statement(case: HardCase) -> str:
    """Return the cells of a case's row that do not depend on a run."""
    cells = (case.name, case.why, case.expected)
    return "| " + " | ".join(cell.replace("|", "&#124;") for cell in cells) + " |"


def row(case: HardCase, seen: str) -> str:
    """Return the row of a case in a Markdown table."""
    shown = html.escape(seen, quote=False).replace("|", "&#124;")
    return f"{statement(case)} {shown} (`{case.area}.{case.test_id}`) |"


def main() -> None:
    """Run every case and write the page."""
    sections, n_case = [], 0
    with tempfile.TemporaryDirectory() as scratch:
        for area, (_, title) in AREAS.items():
            rows = []
            for case in cases_of(area):
                folder = Path(scratch) / case.test_id
                folder.mkdir()
                try:
                    seen = case.run(folder)
                except AssertionError as fault:
                    raise SystemExit(f"{area}.{case.test_id}: {fault}") from fault
                print(f"{area}.{case.test_id}: {seen}", flush=True)
                rows.append(row(case, seen.replace(scratch, ".")))
            sections.append("\n".join([f"## {title}\n", COLUMNS, *rows, ""]))
            n_case += len(rows)
    head = HEAD.format(
        date=datetime.now(UTC).date(),
        python=platform.python_version(),
        numpy=np.__version__,
        n_case=n_case,
    )
    PAGE.write_text("\n".join([head, *sections]), encoding="utf-8")


if __name__ == "__main__":
    main()
