"""Writes docs/hard-cases.md: each case, what must come out and what did.

``python -m tests.hard_cases.page`` from the repository's root runs every case; a case that fails
stops it, so the page never shows one.
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

Inputs chosen to break a calibration package. Each is either answered correctly or refused with a
message. `tests/hard_cases/` asserts what stands under *Expected*. *Seen* is the result of the run
of {date} (Python {python}, NumPy {numpy}). `python -m tests.hard_cases.page` runs all
cases and writes this page. It stops at the first case that fails, and takes about five minutes.

{counts}
"""


def statements(case: HardCase) -> list[str]:
    """Return the parts of a case's entry that do not depend on a run."""
    return [f"### {case.name}", f"**Why hard.** {case.why}", f"**Expected.** {case.expected}"]


def entry(case: HardCase, seen: str) -> str:
    """Return the entry of one case in Markdown."""
    name, why, expected = statements(case)
    shown = html.escape(seen, quote=False)
    code = f"`{case.area}.{case.test_id}`"
    return f"{name}\n\n{why}\n\n{expected}\n\n**Seen.** {shown} ({code})\n"


def main() -> None:
    """Run every case and write the page."""
    sections, counts = [], []
    with tempfile.TemporaryDirectory() as scratch:
        for area, (_, title) in AREAS.items():
            entries = []
            for case in cases_of(area):
                folder = Path(scratch) / case.test_id
                folder.mkdir()
                try:
                    seen = case.run(folder)
                except AssertionError as fault:
                    raise SystemExit(f"{area}.{case.test_id}: {fault}") from fault
                print(f"{area}.{case.test_id}: {seen}", flush=True)
                entries.append(entry(case, seen.replace(scratch, ".")))
            sections.append("\n".join([f"## {title}\n", *entries]))
            counts.append(f"{len(entries)} in {title[0].lower()}{title[1:]}")
    n_case = sum(len(cases_of(area)) for area in AREAS)
    shares = f"{n_case} cases: {', '.join(counts)}."
    head = HEAD.format(
        date=datetime.now(UTC).date(),
        python=platform.python_version(),
        numpy=np.__version__,
        counts=shares,
    )
    PAGE.write_text("\n".join([head, *sections]), encoding="utf-8")


if __name__ == "__main__":
    main()
