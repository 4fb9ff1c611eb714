"""HTML page of a design: map, recommended texture and sources of uncertainty."""

import base64

from ridgebayes import drawing
from ridgebayes.runtime.templates import rendered
from ridgebayes.scene.units import Body
from ridgebayes.texture_design.record import Design


def drawn_design(result: Design, kind: str) -> bytes:
    """Return the map of a design as a ``png`` or ``svg`` file."""
    with drawing.style.styled():
        figure = drawing.style.new_figure(6.4, 5.2)
        result.plot(figure.subplots())
    return drawing.style.as_bytes(figure, kind)


def design_page(result: Design, png: bytes, body: Body) -> str:
    """Return a self-contained HTML page of a design.

    Parameters
    ----------
    result : Design
        Design to show.
    png : bytes
        Map of the design.
    body : Body
        Body of the scene. If it has a radius, widths are shown in micrometres as well.
    """
    return rendered(
        "ridgebayes.report",
        "design.html.jinja",
        found=result,
        why=result.to_dict(),
        image="data:image/png;base64," + base64.b64encode(png).decode("ascii"),
        micrometres=None if body.radius is None else 1e6 * float(body.radius),
    )
