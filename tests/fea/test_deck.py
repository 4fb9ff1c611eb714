"""Input decks: what is read of them, and what is refused."""

import pytest

from ridgebayes import InputError
from ridgebayes.fea.deck import read_deck

NODES = "*NODE\n1, 0., -1., 0.\n2, 1., 0.\n3, 0., 1.\n"


def read(tmp_path, text, name="a.inp"):
    (tmp_path / name).write_text(text, encoding="utf-8")
    return read_deck(tmp_path / name)


def test_read_deck__nodes_sets_and_elements_are_those_written(tmp_path):
    deck = read(
        tmp_path,
        "** a comment\n*Node, nset=All\n1, 0., -1., 0.\n 2 , 1.D0, 0\n3, 0., 1.\n"
        "*ELEMENT, TYPE=CPE8R, ELSET=E\n7, 1, 2, 3, 1,\n2, 3, 1, 2\n8, 1, 2, 3\n"
        "*NSET, NSET=rim\n1, 3,\n*NSET, NSET=both\nRIM, 2\n"
        "*NSET, NSET=steps, GENERATE\n1, 7, 3\n*NSET,NSET=run,GENERATE\n2,4\n",
    )
    assert deck.nodes == {1: (0.0, -1.0), 2: (1.0, 0.0), 3: (0.0, 1.0)}
    listed = {"ALL": [1, 2, 3], "RIM": [1, 3], "BOTH": [1, 3, 2]}
    assert deck.nsets == listed | {"STEPS": [1, 4, 7], "RUN": [2, 3, 4]}
    assert deck.elements == {7: (1, 2, 3, 1, 2, 3, 1, 2), 8: (1, 2, 3)}  # over two lines, then one


@pytest.mark.parametrize(
    ("material", "E", "nu"),
    [
        # mu = 2 C10 = 0.4; nu 0.5 where D1 = 0, else K = 2 / D1.
        ("*HYPERELASTIC, NEO HOOKE\n0.2, 0.\n", 1.2, 0.5),
        ("*HYPERELASTIC, NEO HOOKE\n0.2, 0.1\n", 9 * 20 * 0.4 / (60 + 0.4), 59.2 / 120.8),
        ("*ELASTIC\n3., 0.3\n*ELASTIC\n7., 0.2\n", 3.0, 0.3),
        ("*ELASTIC\n7., 0.2\n*ELASTIC\n3., 0.3\n", 3.0, 0.3),
        ("*ELASTIC\n3., 0.3\n*HYPERELASTIC, NEO-HOOKE\n0.2, 0.\n", 1.2, 0.5),
        ("*ELASTIC\n3., 0.3\n*HYPERELASTIC, OGDEN\n0.4, 2., 0.\n*ELASTIC\n3., 0.3\n", None, None),
        ("", None, None),
    ],
)
def test_read_deck__the_material_is_the_rubber(tmp_path, material, E, nu):
    deck = read(tmp_path, NODES + material)
    assert [deck.E, deck.nu] == [E and pytest.approx(E, rel=1e-12), nu and pytest.approx(nu)]


def test_read_deck__line_ends_and_a_byte_order_mark_change_nothing(tmp_path):
    text = f"{NODES}*NSET, NSET=A\n1, 2\n"
    plain = read(tmp_path, text)
    for ending in ("\r\n", "\r"):
        (tmp_path / "b.inp").write_bytes(b"\xef\xbb\xbf" + text.replace("\n", ending).encode())
        assert read_deck(tmp_path / "b.inp") == plain


def test_read_deck__an_included_file_is_read_from_the_folder(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "nodes.inp").write_text(NODES)
    deck = read(tmp_path, "*INCLUDE, INPUT=parts/nodes.inp\n*NSET, NSET=A\n1\n")
    assert len(deck.nodes) == 3


@pytest.mark.parametrize("name", ["../b.inp", "/etc/hostname", "", "link.inp"])
def test_read_deck__an_include_from_elsewhere_is_refused(tmp_path, name):
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "b.inp").write_text(NODES)
    (inside / "link.inp").symlink_to(tmp_path / "b.inp")
    with pytest.raises(InputError, match=r"line 5: \*INCLUDE.*expected a file in the deck's own"):
        read(inside, f"{NODES}*INCLUDE, INPUT={name}\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("*NODE\n1, 0.\n", "line 2: 2 values; expected at least 3"),
        ("*NODE\n1, 0,5; 1\n", "line 2, value 3 = '5; 1'"),
        ("*NODE\n1.5, 0., 1.\n", "line 2: 1.5: expected a whole number"),
        ("*NODE\n1, nan, 1.\n", "line 2, value 2 = 'nan': expected a finite number"),
        ("*NODE\n1, 1e999, 1.\n", "line 2, value 2 = '1e999'"),
        ("*NODE\n-3, 0., 1.\n", "line 2: -3: expected a whole number above 0"),
        (NODES + "*INCLUDE, INPUT=a.inp\n", "at most 4 deep"),
        (NODES + "*NSET\n1\n", r"\*NSET without a name"),
        (NODES + "*NSET, NSET=A\nNOPE\n", "'NOPE'"),
        (NODES + "*NSET, NSET=A, GENERATE\n1, 5, 0\n", "line 6: 0: expected a whole number"),
        (NODES + "*NSET, NSET=A, GENERATE\n1, 900000000000\n", "GENERATE"),
        ("*ELEMENT, TYPE=CPE4\n1, 2, 3\n", r"no \*NODE block"),
        ("", r"no \*NODE block"),
        ("*NODE\n1, 0., 1.\n1, 0., 2.\n", "line 3: node 1 stands at two places"),
        ("*NODE\n1, 1_0., 1.\n", "line 2, value 2 = '1_0.'"),
        (NODES + "*NSET, NSET=A, GENERATE\n1, 9999999\n", "GENERATE of 9999999 nodes: expec"),
        (NODES + "*ELEMENT, TYPE=CPE4\n1, 2, 3,\n", "an element ends in a comma"),
        (NODES + "*ELEMENT, TYPE=CPE4\n1\n", "line 6: 1 values; expected at least 2"),
        (NODES + "*MATERIAL, NAME=A\n*HYPERELASTIC, NEO HOOKE\n0., 1.\n", "C10 = 0, D1 = 1; expec"),
        ("0.1;0.2\n", r"no \*NODE block"),
    ],
)
def test_read_deck__what_cannot_be_understood_is_named(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        read(tmp_path, text)


@pytest.mark.parametrize("content", [b"*NODE\n1, \xff", "*NODE\n1, 2".encode("utf-16"), b"\0"])
def test_read_deck__another_encoding_is_refused(tmp_path, content):
    (tmp_path / "a.inp").write_bytes(content)
    with pytest.raises(InputError, match=r"a\.inp, line \d: .*UTF-8"):
        read_deck(tmp_path / "a.inp")
