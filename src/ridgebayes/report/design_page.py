"""The page of a design: map, recommended texture, and where the uncertainty comes from."""

import base64

import pandas as pd

from ridgebayes.drawing.designs import plot_designs
from ridgebayes.drawing.style import as_bytes
from ridgebayes.scene.units import Body
from ridgebayes.texture_design.record import Design


def drawn_design(found: Design, kind: str) -> bytes:
    """Return the map of a design as a file, ``png`` or ``svg``."""
    best = (found.best["a_over_R"], found.best["b_over_R"])
    figure = plot_designs(found.designs, best, found.shown, is_met=found.feasible)
    return as_bytes(figure, kind)


def design_page(found: Design, png: bytes, body: Body) -> str:
    """Return one self-contained HTML page.

    Parameters
    ----------
    found : Design
        The design.
    png : bytes
        Its map.
    body : Body
        With a radius, widths are shown in micrometres as well.
    """
    # Only a page needs it.
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("ridgebayes.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    filled = {
        "goals": [goal.text for goal in found.goals],
        "found": found,
        "image": "data:image/png;base64," + base64.b64encode(png).decode("ascii"),
        "micrometres": None if body.radius is None else 1e6 * float(body.radius),
        "tables": [
            ("Shares in the variance of Q and of failure (Sobol's indices)", _rows(found.shares)),
            (
                "What to measure next (spread left 0: known exactly, the most that can be done)",
                _rows(found.measure),
            ),
            ("What to simulate next", _rows(found.simulate_next.head(5))),
        ],
    }
    return environment.get_template("design.html.jinja").render(filled)


def _rows(frame: pd.DataFrame) -> list[list[str]]:
    """Return a header and rows of text; none of an empty frame."""
    if frame.empty:
        return []
    cells = [
        [f"{x:.4g}" if isinstance(x, float) else str(x) for x in row]
        for row in frame.itertuples(index=False)
    ]
    return [[name.replace("_", " ") for name in frame.columns], *cells]
