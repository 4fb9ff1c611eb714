"""Text of templates, which lie in the folder ``templates`` of a room."""

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


def rendered(room: str, template: str, **values: object) -> str:
    """Return a template of a room with values in it; of HTML they are escaped.

    Parameters
    ----------
    room : str
        Package, such as ``ridgebayes.fea``.
    template : str
        File in its folder, such as ``deck.inp.jinja``.
    **values
        By name.
    """
    return environment_of(room, template).get_template(template).render(values)


def environment_of(
    room: str, template: str, finalize: Callable[[object], object] | None = None
) -> "Environment":
    """Return what renders a template of a room; `finalize` is what each value goes through."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # which few commands need

    return Environment(
        loader=PackageLoader(room),
        autoescape=template.endswith(".html.jinja"),
        finalize=finalize,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
