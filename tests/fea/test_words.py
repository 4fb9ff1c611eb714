"""Words of headers, their units, and exact quotients."""

from fractions import Fraction

import numpy as np
import pytest

from ridgebayes.fea.words import column_unit, corners_of, divided, key_of

KEYS = {
    "a": "Ridge width,ridge_width,Stegbreite,Steg,Land width,ridge edge width,land",
    "b": "GrooveWidth,Rillenbreite,Nut,Nutweite,gap width",
    "R": "Radius,Halbmesser,Krümmungsradius,R,Fingertip radius",
    "E": "Young's modulus,E-Modul,Elastizitätsmodul,modulus",
    "Q": "contacts,Kontakte,Anzahl Stege,ridges in contact,cnt,Kontaktkanten,Stegkanten,"
    "berührte Kanten,Kontaktrippen [-],ridge edges,arêtes en contact,Anzahl Kontaktstege",
    "p": "Pressure,Flächenpressung,Nenndruck,mean pressure",
    "load": "Force,Normalkraft,Last,F,F_N,Belastung",
    "line": "line load,Linienlast,force per unit length",
    "p_over_E": "p/E,P/(2RE),p over E,load / E",
    "": "Note,ridge height,corner radius,load step,max pressure,shear modulus,reduced modulus,"
    "groove depth,friction force,q_lin,ridge spacing,Stegabstand,groove distance,ridge length,"
    "ridge angle,ridge type,groove radius,root radius,loss modulus,substrate modulus,E sd,"
    "ridge width sd,mean contact pressure,Kontaktdruck,pull-off force,Adhesionskraft,"
    "ridge fraction,Steganteil,groove/ridge ratio,number of grooves,Anzahl Rillen,ridge roughness,"
    "half load,load per side,Last halbes Modell,tare load,Nulllast,load offset,load range,min load,"
    "load type,force amplitude,G modulus,modulus G,contact modulus,storage modulus,100% modulus",
    "load_sd": "Force sd,SD,standard deviation of the pressure,Kraft Standardabw.",
    "load_lower": "untere Last",
    "a_over_R": "a/R",
    "b_over_R": "Groove width over radius",
    "D": "Durchmesser",
    "pitch": "Teilung",
    "nu": "Querkontraktionszahl",
}


@pytest.mark.parametrize(
    ("words", "key"), [(words, key) for key, some in KEYS.items() for words in some.split(",")]
)
def test_key_of__reads_words_of_the_field(words, key):
    assert key_of(words) == key


@pytest.mark.parametrize(
    ("headers", "corners"),
    [
        (["4", "6"], {"4": ("load", 4, ""), "6": ("load", 6, "")}),
        (["p Q=4", "p Q=6"], {"p Q=4": ("load", 4, "edges"), "p Q=6": ("load", 6, "edges")}),
        (["Probe 2 Kraft", "Probe 4 Kraft"], {}),
        (["load 3", "load 5"], {}),
        (["load 4"], {}),
        (["load #4", "load #6"], {}),
        (["height 4", "height 6"], {}),
    ],
)
def test_corners_of__takes_series_of_even_counts_alone(headers, corners):
    assert corners_of(headers) == corners


@pytest.mark.parametrize(
    ("key", "header", "explicit", "factor"),
    [
        ("a", "w [mm]", None, Fraction(1, 1000)),
        ("a", "w", "inch", Fraction(127, 5000)),
        ("E", "E, MPa", None, Fraction(10**6)),
        ("E", "E [N/mm²]", None, Fraction(10**6)),
        ("line", "P (kN/m)", None, Fraction(1000)),
        *(("line", f"P ({N_mm})", None, Fraction(1000)) for N_mm in ("Newton/mm", "N.mm-1")),
        *(("p", f"p ({unit})", None, Fraction(10**6)) for unit in ("N mm-2", "MPA")),
        ("a", "w [-]", None, Fraction(1)),
        ("a", "w [mm]", "mm", Fraction(1, 1000)),
        ("nu", "nu [-]", None, Fraction(1)),
        ("nu", "nu (of Poisson)", None, Fraction(1)),
        ("rel_se", "error [%]", None, Fraction(1, 100)),
        *(("a", header, None, None) for header in ("w [kPa]", "w [Mm^9]", "w [mm; of R]", "w mm")),
        *(
            ("a", "w (total)", None, None),
            ("E", "E [mpa]", None, None),
            ("a", "w [mm]", "um", None),
        ),
        *(("nu", "nu [mm]", None, None), ("nu", "nu", "kPa", None)),
    ],
)
def test_column_unit__converts_exactly_or_refuses(key, header, explicit, factor):
    _, got, rule = column_unit(key, header, explicit)
    assert "expected " in rule if factor is None else (got, rule) == (factor, "")


def test_divided__gives_the_numbers_a_person_would_write():
    rng = np.random.default_rng(3)
    wide = rng.integers(1, 10_000, 300)
    # Equality with the one correctly rounded quotient of whole numbers.
    assert divided(wide / 1000 * 1e-3, np.array(8.0 * 1e-3)).tolist() == (wide / 8000).tolist()
    # Empty cells stay, and what is too large is infinite.
    quotient = divided(np.array([1.0, np.nan, 1e308, -1e308]), np.array(1e-10))
    np.testing.assert_array_equal(quotient, [1e10, np.nan, np.inf, -np.inf])
