"""Templates of a room: text as it is, HTML escaped, a value that is missing refused."""

import jinja2
import pytest

from ridgebayes.runtime import templates

ROWS = "{% for row in rows %}\n| {{ row | join(' | ') }} |\n{% endfor %}\n"


@pytest.fixture(autouse=True)
def room(monkeypatch):
    """A room with a page in Markdown and one in HTML."""
    pages = {"page.md.jinja": ROWS, "page.html.jinja": "<li>{{ text }}</li>{{ frame | safe }}"}
    monkeypatch.setattr(jinja2, "PackageLoader", lambda *_, **__: jinja2.DictLoader(pages))


def test_rendered__escapes_html():
    page = templates.rendered("room", "page.html.jinja", text="a < b", frame="<table></table>")
    assert page == "<li>a &lt; b</li><table></table>"


def test_rendered__refuses_a_missing_value():
    with pytest.raises(jinja2.UndefinedError, match="rows"):
        templates.rendered("room", "page.md.jinja")
