"""Text of templates, which lie in the folder ``templates`` of a room."""


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
    from jinja2 import Environment, PackageLoader, StrictUndefined  # which few commands need

    environment = Environment(
        loader=PackageLoader(room),
        autoescape=template.endswith(".html.jinja"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(template).render(values)
