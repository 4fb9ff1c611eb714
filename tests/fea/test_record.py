"""Mappings as people write them, and warnings of doubtful rows that break no rule."""

import re

import numpy as np
import pandas as pd
import pytest

import ridgebayes as rb
from ridgebayes.contact.hertz import load_of_half_width
from ridgebayes.fea.record import Imported, parse_map, read_mapping
from tests.fea.tables import imported

A, B, NU = 0.04, 0.02, 0.49


@pytest.mark.parametrize(
    ("Q", "times", "rel_se", "said"),
    [
        ([4, 6, 8], 4.99, 0.0, "^$"),
        ([4], 5.01, 0.0, "a0.04_b0.02 Q = 4 .*check the units"),
        ([4], 0.201, 0.0, "^$"),
        ([4], 0.199, 0.0, "a0.04_b0.02 Q = 4 .*check the units"),
        ([4, 6, 8], 1.0, [0.19, 0.21, 0.0], "^1 row, a0.04_b0.02 Q = 6 .*rel_se is above 0.2"),
        ([6, 8], 1.0, 0.0, "a0.04_b0.02 Q = 6 .*lower Q are missing"),
        ("count 2", 0.001, 0.0, "^$"),
        ("count 6", 10.0, 0.0, "^$"),
        ("count 6", 11.0, 0.0, "Q = 6 .*check the units"),
        ("count 6", 0.199, 0.0, "Q = 6 .*check the units"),
        ("failed 6", np.nan, 0.0, "^$"),
    ],
)
def test_cautions__name_doubtful_rows(Q, times, rel_se, said):
    """Loads are multiples of a smooth body's, whose contact reaches the next ridge."""
    word, Q = (Q.split()[0], [int(Q.split()[1])]) if isinstance(Q, str) else ("", Q)
    load = times * load_of_half_width(B / 2 + (A + B) * (np.array(Q) / 2 - 1), nu=NU)
    columns = {"a_over_R": A, "b_over_R": B, "nu": NU, "Q": Q, "p_over_E": load, "rel_se": rel_se}
    columns |= {"count": {"kind": "count"}, "failed": {"status": "failed"}, "": {}}[word]
    table = rb.ContactTable.from_frame(pd.DataFrame(columns))
    assert re.search(said, "".join(Imported(table, ()).cautions))


@pytest.mark.parametrize(
    ("text", "key", "header"),
    [
        ("a=Ridge width [mm]", "a", "Ridge width [mm]"),
        ("a = Ridge width;mm", "a", "Ridge width;mm"),
        ("status Q=4=Stat=1", "status Q=4", "Stat=1"),
        ("status:4=First", "status:4", "First"),
        ("p=Q=*", "p", "Q=*"),
        ("Q=Count", "Q", "Count"),
        ("Q=4=four", "Q=4", "four"),
        ("line=N=4 [N/mm]", "line", "N=4 [N/mm]"),
    ],
)
def test_parse_map__splits_keys_from_headers(text, key, header):
    assert parse_map([text]) == {key: header}


@pytest.mark.parametrize("texts", [["a"], ["=x"], ["a="], ["a=x", "a=y"], [""]])
def test_parse_map__refuses_what_is_no_pair(texts):
    with pytest.raises(rb.InputError, match=r"^--map .*expected "):
        parse_map(texts)


def test_read_mapping__columns_and_values_are_those_read_columns_takes(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(
        '[columns]\na = "Ridge;um"\nb = "Groove;um"\n"status Q=4" = "first"\n'
        '[values]\nR = "8 mm"\nnu = 0.49\n'
    )
    mapping, values = read_mapping(path)
    assert values == {"R": "8 mm", "nu": "0.49"}
    data = tmp_path / "mine.csv"
    data.write_text("Ridge,Groove,p_over_E,first\n240,80,0.001,open\n240,80,0.002,closed\n")
    table = imported(data, mapping, **values).table
    assert table.textures == ((0.03, 0.01),)
    assert table.column("p_over_E").tolist() == [0.002]


@pytest.mark.parametrize(
    "text",
    [
        "a = ",
        'a = "x"',
        "[columns]\na = 1",
        "[columns]\na = ['x']",
        "[values]\nR = true",
        "[other]",
        "x = " + "[" * 5000,
        "\0",
    ],
)
def test_read_mapping__refuses_other_content_in_words(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(rb.InputError, match=r"mine\.toml"):
        read_mapping(path)
