"""Words of headers and title lines."""

import pytest

from ridgebayes.fea.words import corners_of, count_term, key_of


@pytest.mark.parametrize(
    ("words", "key"),
    [
        *((one, "a") for one in ("Ridge width", "ridge_width", "Stegbreite", "Steg", "Land width")),
        *((one, "b") for one in ("GrooveWidth", "Rillenbreite", "Nut", "Nutweite", "gap width")),
        *((one, "R") for one in ("Radius", "Halbmesser", "Krümmungsradius", "R")),
        *((one, "E") for one in ("Young's modulus", "E-Modul", "Elastizitätsmodul", "modulus")),
        *(
            (one, "Q")
            for one in ("contacts", "Kontakte", "Anzahl Stege", "ridges in contact", "cnt")
        ),
        *(
            (one, "Q")
            for one in ("Kontaktkanten", "Stegkanten", "berührte Kanten", "Kontaktrippen [-]")
        ),
        *((one, "Q") for one in ("ridge edges", "arêtes en contact", "Anzahl Kontaktstege")),
        *((one, "a") for one in ("ridge edge width", "Steg", "land")),
        *((one, "p") for one in ("Pressure", "Flächenpressung", "Kontaktdruck", "mean pressure")),
        *((one, "load") for one in ("Force", "Normalkraft", "Last", "F", "Belastung")),
        *((one, "line") for one in ("line load", "Linienlast", "force per unit length")),
        *((one, "p_over_E") for one in ("p/E", "P/(2RE)", "p over E", "load / E")),
        *(
            (one, "")
            for one in ("Note", "ridge height", "corner radius", "load step", "max pressure")
        ),
        *(
            (one, "")
            for one in (
                "shear modulus",
                "reduced modulus",
                "groove depth",
                "friction force",
                "q_lin",
            )
        ),
        ("untere Last", "load_lower"),
        ("a/R", "a_over_R"),
        ("Groove width over radius", "b_over_R"),
        ("Durchmesser", "D"),
        ("Teilung", "pitch"),
        ("Querkontraktionszahl", "nu"),
    ],
)
def test_key_of__reads_words_of_the_field(words, key):
    assert key_of(words) == key


@pytest.mark.parametrize(
    ("words", "term"),
    [
        *(("Anzahl Stege", "ridges"), ("proximal edges", "edges"), ("Kontaktsegmente", "segments")),
        *(("edges per side", "per-side"), ("contacts", ""), ("n", "")),
    ],
)
def test_count_term__says_what_is_counted_or_nothing(words, term):
    assert count_term(words) == term


@pytest.mark.parametrize(
    ("headers", "found"),
    [
        (["4", "6"], {"4": ("load", 4, ""), "6": ("load", 6, "")}),
        (
            ["p at Q=4", "p at Q=6"],
            {"p at Q=4": ("load", 4, "edges"), "p at Q=6": ("load", 6, "edges")},
        ),
        (["Probe 2 Kraft", "Probe 4 Kraft"], {}),
        (["load 3", "load 5"], {}),
        (["load 4"], {}),
        (["height 4", "height 6"], {}),
    ],
)
def test_corners_of__takes_series_of_even_counts_alone(headers, found):
    assert corners_of(headers) == found
