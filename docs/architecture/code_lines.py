"""Count the lines of code: ``python docs/architecture/code_lines.py`` prints them room by room.

Blank lines, comments and docstrings are not counted. With ``--check`` the script prints only the
rooms above their budget, and ends with exit code 1 if there are any.
"""

import ast
import io
import sys
import tokenize
from collections import Counter
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src" / "ridgebayes"
# Code lines that a room may have: today's count, so that a room which grows says so. Lower a budget
# when its room has shrunk; write the reason beside a budget that is raised.
BUDGETS = {
    "modules of the package": 443,  # with `request`, cautions, the check of argument types
    "runtime": 775,  # scripts from standard input; freed memory that the next batch takes
    "distributions": 495,  # with those of SciPy, and a refusal of arrays, by the key of the prior
    "drawing": 947,
    "contact": 3_253,  # few orders solved together, events started from the last two: floors
    "table": 655,  # rows that are ok; the check for plain CSV that import uses
    "scene": 1_319,  # with loads as they are typed; estimates at the highest of many loads
    "simulate": 505,  # effects at the loads that are asked for
    "fea": 3_719,  # warnings of counts; runs print forces of nodes, tables hold loads
    "model": 1_578,  # the methods, coefficients and name of a form of the user agree; no bools
    "inference": 2_500,  # likelihoods at other degrees of freedom; steps drawn together
    "predict": 1_078,  # loads over a/pitch of one count, DataArrays, strata of a new texture's K
    "evidence": 669,  # degrees of freedom are integrated out; fewer draws for pairs far behind
    "comparison": 876,  # the page knows the weight of normal errors
    "checks": 779,  # load errors of brackets; cost checks its texture and warns of units
    "friction": 865,  # draws the blocks of a scene itself; floors bound penetration
    "texture_design": 1_120,  # refuses loads above all models; widths of the scene that vary
    "report": 1_474,  # cautions of readings; held-out brackets, kinds of figure files named once
    "commands": 2_210,  # cautions of a design appear once; figures of plans replace no file
}
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
    """Print the lines and the budget of each room; exit with 1 if a room is above its budget."""
    rooms: Counter[str] = Counter()
    longest = []
    for path in SOURCE.rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        room, *rest = path.relative_to(SOURCE).parts
        rooms[room if rest else "modules of the package"] += code_lines(text)
        longest.append((len(text.splitlines()), path.relative_to(SOURCE).as_posix()))
    above = [room for room, n in rooms.items() if n > BUDGETS.get(room, 0)]
    if "--check" not in sys.argv[1:]:
        for room, n in rooms.most_common():
            print(f"{n:6} of {BUDGETS.get(room, 0):5} {room}")
        print(f"{sum(rooms.values()):6} of {sum(BUDGETS.values()):5} in all, {len(longest)} files")
        names = ", ".join(f"{name} {n}" for n, name in sorted(longest)[:-4:-1])
        print(f"longest files: {names}")
    if above:
        reasons = [
            f"{room}: {rooms[room]} code lines, at most {BUDGETS.get(room, 0)}" for room in above
        ]
        sys.exit("\n".join(reasons))


if __name__ == "__main__":
    main()
