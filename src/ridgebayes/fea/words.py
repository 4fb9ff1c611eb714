"""What headers and title lines say: the field's words, in English, German and French."""

import re
import unicodedata
from collections.abc import Iterable, Sequence

from ridgebayes.fea.column_units import NUMBER

# A key, what its words look like, and what they must not hold. The first that fits is taken.
_COUNTED = r"(?:ridges?|lands?|(?:kontakt)?(?:stege?n?|rippen)|(?:ridge )?edges|edge"
_COUNTED += r"|(?:kontakt|steg|rippen)?kanten|corners?|contacts?|kontakten?|kontakte|segments?"
_COUNTED += r"|segmenten?|kontaktsegmente|abschnitte|d?aretes?|nervures|stries|q)"
_SHAPE = r"height|hohe|depth|tiefe|corner|ecke|rundung|fillet|flank|wall"
_PATTERNS = tuple(
    (key, re.compile(yes), re.compile(no or r"(?!)"))
    for key, yes, no in (
        (
            "Q",
            rf"^(?:proximal\w* |contact )?{_COUNTED}$(?<!land)(?<!ridge)(?<!steg)|\bq\b"
            rf"|^c(?:ou)?nts?$|^anzahl$|^nombre$|^n$|\b(?:number|no|n|num|count|anzahl|zahl|nombre)\b.*\b{_COUNTED}\b"
            rf"|\b{_COUNTED}\b.*(?:[ei]n contact|i[mn] kontakt|touched|touching|beruhrt|reached"
            rf"|count|(?:pro|je|per) (?:seite|side))|\b(?:touched|touching|beruhrte\w*) {_COUNTED}"
            r"|(?:steg|rippen|kanten|kontakt|segment)(?:an)?zahl",
            r"width|breite|largeur|pressure|druck|\blin",
        ),
        ("pitch", r"pitch|period|teilung|wavelength|wellenlange|\bpas\b", ""),
        (
            "a",
            r"\b(?:ridge|land|rib|nervures?|stries?)\b|^(?:steg|rippe)|\b(?:steg|rippe)",
            _SHAPE + "|radius|gap",
        ),
        (
            "b",
            r"groove|rille|\bnut|valley|trench|channel|gap width|lucke|rainure|sillon",
            _SHAPE + "|radius",
        ),
        ("D", r"diameter|durchmesser|diametre", ""),
        ("R", r"radius|halbmesser|rayon|^r$", r"corner|edge|ridge|eck|kante|fillet|rundung|tip"),
        (
            "E",
            r"young|modulus|\be modul|emodul|elastizitatsmodul|^e$",
            r"reduced|reduziert|effe[ck]tiv|shear|schub|bulk|kompression|\*|strain",
        ),
        ("nu", r"poisson|querkontraktion|querdehn|^nu$|^\u03bd$", ""),
        ("offset", r"offset|versatz", ""),
        ("rel_se", r"\brel\w*\b.*(?:\bse\b|error|fehler|uncertainty|unsicherheit)", ""),
        ("line", r"line load|linienlast|streckenlast|per (?:unit )?length|pro lange|lineique", ""),
        ("p", r"pressure|druck|pressung|pression", r"max|peak|spitze|hertz|ridge"),
        (
            "load",
            r"\b(?:load|force|charge)\b|(?:last|kraft|belastung)\b|^[fp]$",
            r"max|peak|spitze|cell|step|rate|case|nr|time|friction|reib|tangential|quer|shear"
            r"|schub|lateral|horizontal|inc|\bno\b",
        ),
        ("texture", r"^(?:texture|textur|muster|pattern)(?: (?:id|name|label))?$", ""),
        (
            "series",
            r"^(?:series|serie|messreihe|repeat|replicate|wiederholung|specimen|rig|labor\w*)"
            r"(?: (?:id|no|nr|name))?$",
            "",
        ),
    )
)
_LOWER = re.compile(r"\b(?:lower|untere\w*|before|vorher\w*|previous|from|von)\b")
_RATIO = re.compile(r"(.+?) ?(?:/|\bover\b|\bdurch\b) ?(.+)")
_NO_CORNER = re.compile(r"probe|sample|specimen|seri|test|run|textu|rig|channel|sensor|cell|step")
_FILLERS = re.compile(
    rf"\b(?:{_COUNTED}|n|at|bei|with|mit|for|fur|count|number|of|anzahl|in contact|proximal\w*)\b"
)
COUNTS = {
    "edges": "each ridge in contact touches at one proximal edge: Q = proximal edges",
    "ridges": "each ridge in contact touches at one proximal edge: Q = ridges",
    "segments": "each ridge in contact carries one contact segment: Q = segments",
    "per-side": "counted on one side of the body: Q = 2 x count",
}
_TERMS = (
    ("per-side", r"(?:pro|je|per) (?:seite|side|half)|/ ?side"),
    ("segments", r"segment|abschnitt"),
    ("edges", r"edge|kante|corner|arete|\bq\b"),
    ("ridges", r"ridge|\bland|steg|rippe|nervure|strie"),
)
_PAIR = re.compile(r"(\d+(?:[.,]\d+)?)\s*([^\W\d_]+)?")
_SETTING = re.compile(
    r"([^\W\d][^\d:=;,\t\[\]()]*?)\s*(?:[\[(]([^\])]*)[\])])?\s*[:=;\t ]+\s*"
    r"(\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)(?:[;\t ]*([^\W\d][^\s;,)]*))?"
)


def plain(text: str) -> str:
    """Return words in small letters without accents, of signs only ``/`` and ``*``.

    Examples
    --------
    >>> plain("RidgeWidth"), plain("Flächen-Pressung"), plain("a / R")
    ('ridge width', 'flachen pressung', 'a / r')
    """
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    text = unicodedata.normalize("NFKD", text.lower().replace("ß", "ss"))
    text = "".join(one for one in text if not unicodedata.combining(one))
    return re.sub(r"[^a-z0-9/*\u03bd%]+", " ", text.replace("'", "")).strip()


def key_of(words: str) -> str:
    """Return what a header's words mean, as a key of ``--map``; empty where that is not clear.

    Examples
    --------
    >>> [key_of(one) for one in ("Stegbreite", "Groove width", "Normalkraft", "p over E", "Note")]
    ['a', 'b', 'load', 'p_over_E', '']
    """
    text = plain(words)
    if match := _RATIO.fullmatch(text):
        key, under = (_key_of(part) for part in match.groups())
        over_R = key if key in ("a", "b", "offset") else match[1] if match[1] in ("a", "b") else ""
        if under == "R" and over_R:
            return f"{over_R}_over_R"
        is_line = re.fullmatch(r"\(?2 ?\*? ?r ?\*? ?e\)?", match[2]) is not None
        if key in ("load", "p", "line") and (under == "E" or is_line):
            return "p_over_E"
        if under in ("R", "E"):
            return ""
    return _key_of(text)


def _key_of(text: str) -> str:
    for key, yes, no in _PATTERNS:
        if yes.search(text) and not no.search(text):
            is_lower = key in ("load", "p", "line") and _LOWER.search(text)
            return f"{key}_lower" if is_lower else key
    return ""


def count_term(words: str) -> str:
    """Return which of `COUNTS` words speak of; empty where they do not say.

    Examples
    --------
    >>> count_term("Anzahl Stege"), count_term("contacts")
    ('ridges', '')
    """
    return next((term for term, some in _TERMS if re.search(some, plain(words))), "")


def corners_of(headers: Iterable[str]) -> dict[str, tuple[str, int, str]]:
    """Return headers that name a count each: what their columns hold, the count and its term.

    Headers that differ in one whole number, two of them at least, all even where no word says
    what is counted.

    Examples
    --------
    >>> corners_of(["a", "F at 4 ridges", "F at 6 ridges"])
    {'F at 4 ridges': ('load', 4, 'ridges'), 'F at 6 ridges': ('load', 6, 'ridges')}
    """
    groups: dict[str, dict[str, int]] = {}
    for header in headers:
        if len(numbers := re.findall(r"\d+", header)) == 1 and len(numbers[0]) <= 6:
            template = re.sub(r"\d+", "*", header)
            groups.setdefault(template, {})[header] = int(numbers[0])
    found: dict[str, tuple[str, int, str]] = {}
    for template, some in groups.items():
        words = plain(template.replace("*", " "))
        term = count_term(words)
        rest = " ".join(_FILLERS.sub(" ", words).split())
        key = key_of(rest) if rest else "load"
        is_even = all(n % 2 == 0 for n in some.values())
        is_load = key.removesuffix("_lower") in ("load", "p", "line", "p_over_E")
        if len(some) > 1 and (is_even or term) and is_load and not _NO_CORNER.search(words):
            found |= {header: (key, n, term) for header, n in some.items()}
    return found


def texture_of(text: str) -> tuple[str, str, str] | None:
    """Return ridge width, groove width and their unit of a text with just two numbers.

    Examples
    --------
    >>> texture_of("240x80 um"), texture_of("a0.03_b0.01"), texture_of("Nut 0,1 / Steg 0,2")
    (('240', '80', 'um'), ('0.03', '0.01', ''), ('0.2', '0.1', ''))
    """
    pairs = _PAIR.findall(text)
    if len(pairs) != 2:
        return None
    (first, unit_a), (second, unit_b) = ((n.replace(",", "."), unit) for n, unit in pairs)
    before = plain(text[: text.index(pairs[0][0])])
    if before.endswith(("b", "g")) or _key_of(before) == "b":
        first, second = second, first
    return first, second, unit_b or (unit_a if unit_a != "x" else "")


def settings_of(titles: Sequence[tuple[int, str]]) -> dict[str, tuple[str, int]]:
    """Return R, D, E and nu that title lines give, each with its line.

    Examples
    --------
    >>> settings_of([(1, "Test 7"), (2, "Radius R = 8 mm, E-Modul: 0,06 MPa"), (3, "nu; 0.49")])
    {'R': ('8 mm', 2), 'E': ('0.06 MPa', 2), 'nu': ('0.49', 3)}
    """
    found: dict[str, tuple[str, int]] = {}
    for line, text in titles:
        for words, unit, number, after in _SETTING.findall(text):
            key = key_of(words)
            number = number.replace(",", ".")
            if key in ("R", "D", "E", "nu") and NUMBER.fullmatch(number):
                of = "" if key == "nu" else (unit or after).strip()
                found.setdefault(key, (f"{number} {of}".strip(), line))
    return found
