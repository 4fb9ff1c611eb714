"""Rendering of templates in the ``templates`` folder of a package."""

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


def rendered(room: str, template: str, **values: object) -> str:
    """Return a rendered template; values in HTML are escaped.

    Parameters
    ----------
    room : str
        Package, such as ``ridgebayes.fea``.
    template : str
        File name, such as ``deck.inp.jinja``.
    **values
        Values by name.
    """
    return environment_of(room, template).get_template(template).render(values)


def environment_of(
    room: str, template: str, finalize: Callable[[object], object] | None = None
) -> "Environment":
    """Return the environment of a template; `finalize` is applied to each value."""
    from jinja2 import Environment, PackageLoader, StrictUndefined  # few commands need it

    return Environment(
        loader=PackageLoader(room),
        autoescape=template.endswith(".html.jinja"),
        finalize=finalize,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
