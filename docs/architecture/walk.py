"""Follow a table to a Bayes factor: ``python docs/architecture/walk.py`` prints the rooms passed.

Two forms are compared on the embedded sweep, error models weighed. Each module is noted when one of
its functions is entered for the first time, in the order of the calls. A return is a module met in
a room that was left before: what somebody who reads the code in that order has to go back for.
"""

import sys
from itertools import groupby
from pathlib import Path
from types import FrameType

import ridgebayes as rb

HOME = Path(rb.__file__).parent


def modules_entered() -> list[tuple[str, str]]:
    """Return room and module of a comparison of two forms, in the order of first entry."""
    found: list[tuple[str, str]] = []
    met: set[str] = set()

    def enter(frame: FrameType, event: str, _: object) -> None:
        file = frame.f_code.co_filename
        # Bodies of modules and classes run when they are imported, which is no part of the walk.
        if event != "call" or file in met or frame.f_code.co_name.startswith("<"):
            return
        met.add(file)
        path = Path(file)
        if HOME in path.parents and path.stem not in ("__init__", "_types", "errors"):
            room, *rest = path.relative_to(HOME).with_suffix("").parts
            found.append((room, ".".join(rest)))

    for name in rb.__all__:
        getattr(rb, name)
    sys.setprofile(enter)
    try:
        _ = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], rng=1).verdict
    finally:
        sys.setprofile(None)
    return found


def main() -> None:
    """Print the walk and its counts."""
    entered = modules_entered()
    left: set[str] = set()
    n_return = 0
    for room, modules in groupby(entered, key=lambda pair: pair[0]):
        back = room in left
        n_return += back
        left.add(room)
        print(f"{'back to ' if back else ''}{room}: {', '.join(name for _, name in modules)}")
    print(f"{len(entered)} modules in {len(left)} rooms, {n_return} returns")


if __name__ == "__main__":
    main()
