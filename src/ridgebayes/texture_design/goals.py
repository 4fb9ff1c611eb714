"""Parse goals: the counts that a texture has to reach, and their probabilities.

| text | |
|---|---|
| ``P(Q >= 8) >= 0.95`` | also ``>``, ``<``, ``<=``, ``=``, ``6 <= Q <= 10`` |
| ``P(Q >= 12) <= 5 %`` | the same as ``P(Q < 12) >= 95 %`` |
| ``P(Q >= 8 at 0.8 N) >= 0.95`` | a pressure, line load or force, for a scene with units |
| ``P(Q >= 8 at p/E = 0.004:0.02:5) >= 0.95`` | at the worst of five loads |
| ``P(Q = 8 at every p/E = 0.009:0.01:3) >= 0.9`` | at all loads together |
| ``P(Q(0.004) < 8 <= Q(0.01)) >= 0.9`` | at two loads; ``Q(50 %)``: at half the largest load |
| ``sd(Q) <= 1`` | a bound on the spread |

Several goals are separated by ``and`` or ``;``. A goal without a load is at the scene's largest
load.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations, product

from ridgebayes._types import FloatArray
from ridgebayes.errors import InputError
from ridgebayes.runtime.text import clipped
from ridgebayes.scene.typed import parse_loads
from ridgebayes.scene.units import NO_UNITS, Body, load_to_si
from ridgebayes.table.columns import LARGEST_LOAD

_USAGE = (
    "such as 'P(Q >= 8) >= 0.95', 'P(6 <= Q <= 10 at p/E = 0.01) >= 90 %', "
    "'P(Q(0.004) < 8 <= Q(0.01)) >= 0.9' or 'sd(Q) <= 1', with 'and' between several"
)
_NUMBER = r"[0-9.]+(?:e[+-]?[0-9]+)?"
_AT = r"(?P<at>at\b.*)?"
_PROBABILITY = re.compile(
    rf"p\s*\((?P<event>(?:[^()]|\([^()]*\))*?){_AT}\)\s*(?P<op>>=|<=)\s*(?P<level>{_NUMBER})"
    r"\s*(?P<percent>%?)",
    re.IGNORECASE,
)
_SPREAD = re.compile(rf"sd\s*\(\s*q\s*{_AT}\)\s*(?P<op><=)\s*(?P<level>{_NUMBER})", re.IGNORECASE)
_LOADS = re.compile(
    r"at\s+(?P<rule>every\b|worst\b)?\s*(?:(?:p/E|p|P'|F)\s*=)?\s*(?P<loads>\S.*)", re.IGNORECASE
)
_WITH_UNIT = re.compile(r"[-+.,\d]+(?:e[+-]?\d+)?\s*[^\W\d_].*", re.IGNORECASE)
_SYMBOLS = {"p/E": "", "pressure": " Pa", "line load": " N/m", "force": " N"}
_Q = re.compile(r"q(?:\s*\((?P<load>[^()]+)\))?", re.IGNORECASE)
_FLIPPED = {"<": ">", "<=": ">=", "=": "=", ">": "<", ">=": "<="}
MOST_COUNT = 2_000  # largest count in a goal


@dataclass(frozen=True)
class Load:
    """A load in a unit, whose p/E may be uncertain.

    Parameters
    ----------
    value : float
        Load, above 0.
    unit : {"p/E", "share", "pressure", "line load", "force"}, optional
        ``share`` is a fraction of the scene's largest load; the last three are Pa, N/m and N.
    """

    value: float
    unit: str = "p/E"

    def p_over_E(self, units: Mapping[str, FloatArray]) -> FloatArray:
        """Return p/E, given p/E of a load of 1 in each unit."""
        return self.value * units[self.unit]

    def __str__(self) -> str:
        if self.unit == "share":
            return f"{100 * self.value:g} %"
        return f"{self.value:g}{_SYMBOLS[self.unit]}"


LARGEST = Load(1.0, "share")


@dataclass(frozen=True)
class Case:
    """One event: Q reaches counts at some loads, and stays below counts at others.

    Parameters
    ----------
    at_least, below : tuple of (int, Load)
        Even counts, and the loads at which Q reaches them or stays below them.
    """

    at_least: tuple[tuple[int, Load], ...] = ()
    below: tuple[tuple[int, Load], ...] = ()

    @property
    def loads(self) -> tuple[Load, ...]:
        """Distinct loads of the case."""
        return tuple(dict.fromkeys(load for _, load in (*self.at_least, *self.below)))

    def excludes(self, other: "Case") -> bool:
        """Return whether two cases exclude each other, as Q never falls while the load rises."""
        return any(
            n >= m and low.unit == high.unit and low.value <= high.value
            for case, rival in permutations((self, other))
            for n, low in case.at_least
            for m, high in rival.below
        )


@dataclass(frozen=True)
class Goal:
    """A bound on a probability, or on the standard deviation of Q.

    Parameters
    ----------
    text : str
        Goal as written.
    cases : tuple of Case
        Events, of which the worst counts; for a spread each has one load.
    level : float
        Bound on the probability or the standard deviation.
    is_spread : bool, optional
        Whether the goal is an upper bound on the standard deviation of Q.
    """

    text: str
    cases: tuple[Case, ...]
    level: float
    is_spread: bool = False

    def margin(self, value: float) -> float:
        """Return the distance of a value inside its bound; for a spread, over the bound."""
        return 1 - value / self.level if self.is_spread else value - self.level


def parse_goals(
    text: str | Sequence[str], loads: Sequence[Load] = (LARGEST,), body: Body = NO_UNITS
) -> tuple[Goal, ...]:
    """Parse the goals of one or several texts.

    Parameters
    ----------
    text : str or sequence of str
        Goals, as in the table of this module.
    loads : sequence of Load, optional
        Loads of goals without loads.
    body : Body, optional
        Body that converts loads with units to p/E.

    Raises
    ------
    InputError
        If a goal cannot be parsed, is impossible, or contradicts another goal.

    Examples
    --------
    >>> goal, = parse_goals("P(6 <= Q <= 10 at p/E = 0.01) >= 95 %")
    >>> goal.cases, goal.level
    ((Case(at_least=((6, Load(value=0.01, unit='p/E')),), below=((12, Load(value=0.01, \
unit='p/E')),)),), 0.95)
    """
    texts = [*text] if isinstance(text, list | tuple) and text else [text]
    parts = [part for line in texts for part in re.split(r";|\band\b", _plain(line))]
    goals = tuple(_goal(part.strip(), tuple(loads), body) for part in parts)
    for goal, other in permutations(goals, 2):
        _refuse_contradiction(goal, other)
    return goals


def _plain(text: object) -> str:
    if not isinstance(text, str):
        raise InputError(f"goal: expected a text {_USAGE}, got {text!r}")
    for sign, plain in {"≥": ">=", "≤": "<=", "==": "=", "&": ";"}.items():
        text = text.replace(sign, plain)
    return text


def _goal(text: str, loads: tuple[Load, ...], body: Body) -> Goal:
    where = f"goal {clipped(text)}"
    match = _PROBABILITY.fullmatch(text) or _SPREAD.fullmatch(text)
    if match is None:
        raise InputError(f"{where}: expected one {_USAGE}")
    parts = match.groupdict()
    words = _LOADS.fullmatch((parts["at"] or "").strip())
    if words is not None:
        loads = read_loads(words["loads"], where, body)
    elif parts["at"] is not None:
        raise InputError(f"{where}: expected loads as 'at p/E = 0.01' or LO:HI:N")
    try:
        level = float(parts["level"]) / (100 if parts.get("percent") else 1)
    except ValueError:
        raise InputError(f"{where}: expected a number as its bound") from None
    if "event" not in parts:
        if not 0 < level < math.inf:
            raise InputError(f"{where}: expected a bound above 0")
        cases = tuple(Case(((2, load),)) for load in loads)
        return Goal(text, cases, level, is_spread=True)
    if not 0 < level < 1:
        raise InputError(f"{where}: expected a probability between 0 and 1, got {level:g}")
    body_of_Q = body if words is None else None  # None: Q(load) is refused
    cases = tuple(_event(parts["event"], load, body_of_Q, where) for load in loads)
    if parts["op"] == "<=":
        cases, level = tuple(_complement(case, where) for case in cases), 1 - level
    if words is not None and (words["rule"] or "").lower() == "every":
        cases = (Case(*(sum((getattr(c, k) for c in cases), ()) for k in ("at_least", "below"))),)
    for case in cases:
        if case.excludes(case):
            raise InputError(f"{where}: no count meets this; Q never falls as the load rises")
    return Goal(text, tuple(dict.fromkeys(cases)), level)


def _event(text: str, load: Load, body: Body | None, where: str) -> Case:
    """Return the event at a load, or at the loads in brackets after Q."""
    terms = [part.strip() for part in re.split(r"(<=|>=|=|<|>)", text)]
    if len(terms) not in (3, 5):
        raise InputError(f"{where}: expected an event {_USAGE}")
    at_least, below = [], []
    for left, op, right in (terms[i : i + 3] for i in range(0, len(terms) - 2, 2)):
        first, second = (_Q.fullmatch(term) for term in (left, right))
        match = first or second
        if match is None or (first and second):
            raise InputError(
                f"{where}: expected Q on one side of each {op!r}, a count on the other"
            )
        here = load
        if match["load"] is not None:
            if body is None:
                raise InputError(f"{where}: expected Q(load) or 'at p/E = ..', got both")
            here, *others = read_loads(match["load"], where, body)
            if others:
                raise InputError(f"{where}: expected one load in brackets, got {match['load']!r}")
        low, high = _bounds(*((right, op) if first else (left, _FLIPPED[op])), where)
        at_least += [] if low is None else [(low, here)]
        below += [] if high is None else [(high, here)]
    return Case(tuple(at_least), tuple(below))


def _complement(case: Case, where: str) -> Case:
    if len(case.at_least) + len(case.below) > 1:
        raise InputError(f"{where}: expected >= after a probability of more than one bound, got <=")
    return Case(case.below, case.at_least)


def _bounds(text: str, op: str, where: str) -> tuple[int | None, int | None]:
    """Return the even counts that Q has to reach and to stay below; None for no bound."""
    if not text.isdecimal() or not 0 < int(text) <= MOST_COUNT:
        raise InputError(f"{where}: expected a whole count from 1 to {MOST_COUNT}, got {text!r}")
    n = int(text)
    if op == "=" and n % 2:
        raise InputError(f"{where}: Q is even; expected an even count, got {n}")
    up, above = 2 * -(-n // 2), 2 * (n // 2) + 2  # smallest even counts >= n and > n
    low = {">=": up, ">": above, "=": n}.get(op)
    high = {"<": up, "<=": above, "=": n + 2}.get(op)
    if high is not None and high <= 2:
        raise InputError(f"{where}: no count meets this; Q is at least 2")
    return low, high


def read_loads(text: str, where: str, body: Body) -> tuple[Load, ...]:
    """Return a single load, or the loads of LO:HI:N (evenly spaced) or log:LO:HI:N."""
    units: set[str] = set()

    def number(part: str) -> float:
        load = _load(part, body)
        units.add(load.unit)
        if len(units) > 1:
            raise InputError(f"{text!r}: expected both ends of one kind")
        return load.value

    values = parse_loads(text, f"{where}:", number)
    return tuple(Load(value, *units) for value in values.tolist())


def _load(text: str, body: Body) -> Load:
    text = text.strip()
    is_share = text.endswith("%")
    try:
        value = p_over_E = float(text.removesuffix("%")) / (100 if is_share else 1)
        unit = "share" if is_share else "p/E"
    except ValueError:
        value = p_over_E = math.nan
        if _WITH_UNIT.fullmatch(text):
            (exact, unit), p_over_E = load_to_si(text), body.p_over_E(text)
            value = float(exact)
    if not 0 < p_over_E <= (1 if is_share else LARGEST_LOAD):
        raise InputError(
            f"expected a load p/E above 0, one with a unit such as '0.8 N', or a share "
            f"such as 50 % of the scene's largest load, got {clipped(text)}"
        )
    return Load(value, unit)


def _refuse_contradiction(goal: Goal, other: Goal) -> None:
    """Refuse goals on events that exclude each other and have levels above 1 in sum."""
    if goal.is_spread or other.is_spread or goal.level + other.level <= 1:
        return
    if any(case.excludes(rival) for case, rival in product(goal.cases, other.cases)):
        raise InputError(
            f"goal: {clipped(goal.text)} and {clipped(other.text)} contradict each other: "
            "the two events exclude each other, and their probabilities would exceed 1"
        )
