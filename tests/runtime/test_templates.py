"""Templates of a room: text as it is, HTML escaped, a value that is missing refused."""

from types import SimpleNamespace

import jinja2
import pytest

from ridgebayes.runtime.templates import rendered

CHECK = {"n_scene": 1, "n_neglected": 2, "n_within": 1, "n_honest": 3, "names": ["a", "b"]}


def test_rendered__lays_out_a_table():
    text = rendered("ridgebayes.commands", "plan_check.md.jinja", rows=[["1", "<2"]], **CHECK)
    assert text.endswith("| a | b |\n|---|---|\n| 1 | <2 |\n")


def test_rendered__escapes_html():
    table, frame = SimpleNamespace(where="<b>.csv", calibration=[1]), "<table></table>"
    known = {"texture": (0.1, 0.2), "machine": "m", "cheapest": ["a < b"], "figures": {"t": "f"}}
    page = rendered("ridgebayes.commands", "cost.html.jinja", table=table, rows=frame, **known)
    assert "&lt;b&gt;.csv" in page
    assert "<li>a &lt; b</li>" in page
    assert frame in page


def test_rendered__refuses_a_missing_value():
    with pytest.raises(jinja2.UndefinedError, match="rows"):
        rendered("ridgebayes.commands", "plan_check.md.jinja", **CHECK)
