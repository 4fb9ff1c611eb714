"""Count the lines of code: ``python docs/architecture/code_lines.py`` prints them room by room.

A line of code is one that holds a token: blank lines, comments and docstrings do not count.
"""

import ast
import io
import tokenize
from collections import Counter
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src" / "ridgebayes"
_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
}


def code_lines(text: str) -> int:
    """Return how many lines of a module's text hold code."""
    docstrings: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        documented = isinstance(
            node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
        )
        if documented and ast.get_docstring(node, clean=False) is not None:
            first = node.body[0]
            docstrings.update(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_CODE:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - docstrings)


def main() -> None:
    """Print the lines of each room, of all, and the longest files."""
    rooms: Counter[str] = Counter()
    longest = []
    for path in SOURCE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        rooms[path.relative_to(SOURCE).parts[0]] += code_lines(text)
        longest.append((len(text.splitlines()), path.relative_to(SOURCE).as_posix()))
    for room, n in rooms.most_common():
        print(f"{n:6} {room}")
    print(f"{sum(rooms.values()):6} in all, {len(longest)} files")
    print("longest files:", ", ".join(f"{name} {n}" for n, name in sorted(longest)[:-4:-1]))


if __name__ == "__main__":
    main()
