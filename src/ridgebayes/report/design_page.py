"""The page of a design: map, recommended texture, and where the uncertainty comes from."""

import base64

from ridgebayes import drawing
from ridgebayes.runtime.templates import rendered
from ridgebayes.scene.units import Body
from ridgebayes.texture_design.record import Design


def drawn_design(found: Design, kind: str) -> bytes:
    """Return the map of a design as a file, ``png`` or ``svg``."""
    best = (found.best["a_over_R"], found.best["b_over_R"])
    figure = drawing.designs.plot_designs(found.designs, best, found.shown, is_met=found.feasible)
    return drawing.style.as_bytes(figure, kind)


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
    return rendered(
        "ridgebayes.report",
        "design.html.jinja",
        goals=[goal.text for goal in found.goals],
        found=found,
        image="data:image/png;base64," + base64.b64encode(png).decode("ascii"),
        micrometres=None if body.radius is None else 1e6 * float(body.radius),
        tables=[
            ("Shares in the variance of Q and of failure (Sobol's indices)", _shares(found)),
            ("What to measure next", _measurements(found)),
            ("What to simulate next", _simulations(found)),
        ],
    )


def _shares(found: Design) -> list[list[str]]:
    """Return a header and rows of text; none where there are none."""
    rows = [
        [row["of"], row["source"]]
        + [
            f"{100 * max(share, 0.0):.0f} ± {100 * se:.1g} %"
            for share, se in (
                (row["first_order"], row["first_order_se"]),
                (row["total_order"], row["total_order_se"]),
            )
        ]
        for row in found.to_dict()["shares"]
    ]
    return _headed(["of", "source", "alone", "with all interactions"], rows)


def _measurements(found: Design) -> list[list[str]]:
    rows = [
        [
            row["measure"],
            "exactly" if not row["spread_left"] else f"to {row['spread_left']:g} of its spread",
            f"{100 * row['resolved']:.2g} %",
            f"{row['probability_low']:.4g} to {row['probability_high']:.4g}",
        ]
        for row in found.to_dict()["measure"]
    ]
    return _headed(["if known", "how well", "settles", "probability then (90 %)"], rows)


def _simulations(found: Design) -> list[list[str]]:
    rows = [
        [
            f"{row['a_over_R']:.4g}",
            f"{row['b_over_R']:.4g}",
            str(row["Q"]),
            f"{row['p_over_E']:.3g}",
            f"{row['information']:.2f}",
            f"{row['form_a']} or {row['form_b']}",
        ]
        for row in found.to_dict()["simulate_next"]
    ]
    return _headed(["a/R", "b/R", "Q", "p/E", "information (ln 2 settles)", "tells"], rows)


def _headed(header: list[str], rows: list[list[str]]) -> list[list[str]]:
    return [header, *rows] if rows else []
