"""Goals as text: what is read, and what is refused with one message."""

from fractions import Fraction

import pytest

from ridgebayes import InputError
from ridgebayes.scene.units import Body
from ridgebayes.texture_design.goals import LARGEST, Case, Load, parse_goals

FINGER = Body(Fraction("0.008"), Fraction(60_000), Fraction("0.01"))
HALF = Load(0.5, "share")


@pytest.mark.parametrize(
    ("text", "at_least", "below"),
    [
        ("P(Q >= 8) >= 0.95", [(8, LARGEST)], []),
        ("p( q≥7 )>=95%", [(8, LARGEST)], []),  # counts are even
        ("P(Q > 8) >= 0.95", [(10, LARGEST)], []),
        ("P(8 < Q) >= 0.95", [(10, LARGEST)], []),
        ("P(Q <= 9) >= 0.95", [], [(10, LARGEST)]),
        ("P(Q < 9) >= 0.95", [], [(10, LARGEST)]),
        ("P(Q = 6) >= 0.95", [(6, LARGEST)], [(8, LARGEST)]),
        ("P(6 <= Q <= 10) >= 0.95", [(6, LARGEST)], [(12, LARGEST)]),
        ("P(Q >= 12) <= 0.05", [], [(12, LARGEST)]),
        ("P(Q >= 8 at p/E = 0.01) >= .95", [(8, Load(0.01))], []),
        ("P(Q >= 8 at 50 %) >= 0.95", [(8, HALF)], []),
        ("P(Q >= 8 at 0.8 N) >= 0.95", [(8, Load(0.8, "force"))], []),
        ("P(Q >= 8 at p = 600 Pa) >= 0.95", [(8, Load(600.0, "pressure"))], []),
        (
            "P(Q >= 8 at every 1 N/m:0.02 N/cm:2) >= 0.95",
            [(8, Load(1.0, "line load")), (8, Load(2.0, "line load"))],
            [],
        ),
        ("P(Q(50 %) < 8 <= Q(1e-2)) >= 0.95", [(8, Load(0.01))], [(8, HALF)]),
        (
            "P(Q = 8 at every p/E = 0.01:0.02:2) >= 0.95",
            [(8, Load(0.01)), (8, Load(0.02))],
            [(10, Load(0.01)), (10, Load(0.02))],
        ),
    ],
)
def test_goal__is_read(text, at_least, below):
    (goal,) = parse_goals(text, body=FINGER)
    assert goal.cases == (Case(tuple(at_least), tuple(below)),)
    assert goal.level == pytest.approx(0.95)


def test_goals__several_and_the_worst_of_several_loads():
    one, other, spread = parse_goals(
        ["P(Q >= 8 at worst p/E = log:0.001:0.004:3) >= 0.9 and P(Q <= 20) >= 0.9", "sd(Q) <= 1"],
        (Load(0.01),),
    )
    loads = [case.at_least[0][1].value for case in one.cases]
    assert loads == pytest.approx([0.001, 0.002, 0.004])
    assert other.cases == (Case(below=((22, Load(0.01)),)),)
    assert spread.is_spread
    assert spread.margin(0.75) == 0.25
    assert one.margin(0.95) == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "expected one such as"),
        ("Q >= 8", "expected one such as"),
        ("P(Q >= 8)", "expected one such as"),
        ("P(Q >= 8) >= 0.9 and", "goal '': expected one"),
        ("P(Q >= 8) > 0.95", "expected one such as"),
        ("P(Q >= 8) >= 95", "expected a probability between 0 and 1, got 95"),
        ("P(Q >= 8) >= 0..5", "expected a number as its bound"),
        ("P(Q => 8) >= 0.5", "expected a whole count from 1 to 2000, got ''"),
        ("P(Q) >= 0.5", "expected an event"),
        ("P(4 <= 8) >= 0.5", "expected Q on one side of each"),
        ("P(Q >= eight) >= 0.5", "expected a whole count from 1 to 2000, got 'eight'"),
        ("P(Q = 7) >= 0.5", "Q is even; expected an even count, got 7"),
        ("P(Q < 2) >= 0.5", "no count meets this; Q is at least 2"),
        ("P(10 <= Q <= 6) >= 0.5", "no count meets this"),
        ("P(Q(0.01) >= 8 > Q(0.02)) >= 0.5", "no count meets this"),
        ("P(6 <= Q <= 8) <= 0.5", "expected >= after a probability of more than one bound"),
        ("P(Q >= 8 at 0) >= 0.5", "expected a load p/E above 0"),
        ("P(Q >= 8 at 120 %) >= 0.5", "or a share such as 50 %"),
        ("P(Q >= 8 at 0.02:0.01:3) >= 0.5", "LO:HI:N or log:LO:HI:N with 0 < LO"),
        ("P(Q >= 8 at 0.02:1 N:3) >= 0.5", "expected both ends of one kind"),
        ("P(Q >= 8 at 0,8 N) >= 0.5", "has a decimal comma; expected a point, such as '0.8 N'"),
        ("P(Q >= 8 at 8 mm) >= 0.5", "'8 mm': expected a number and a unit of a load"),
        ("P(Q >= 8 at -1 N) >= 0.5", "expected a load p/E above 0"),
        ("P(Q >= 8 at half) >= 0.5", "expected a load p/E above 0, one with a unit"),
        ("P(Q(0.01) >= 8 at 0.02) >= 0.5", "got both"),
        ("sd(Q) <= 0", "expected a bound above 0"),
        ("P(Q >= 8) >= 0.95; P(Q <= 6) >= 0.1", "contradict each other"),
        ("P(Q >= 8 at 0.01) >= 0.6; P(Q < 8 at 0.02) >= 0.6", "contradict each other"),
        (7, "expected a text"),
    ],
)
def test_goal__is_refused_with_one_message(text, expected):
    with pytest.raises(InputError) as refused:
        parse_goals([text], body=FINGER)
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


def test_goals__that_can_both_be_met_are_no_contradiction():
    assert len(parse_goals("P(Q >= 8 at 0.02) >= 0.9; P(Q <= 6 at 0.01) >= 0.9")) == 2
    assert len(parse_goals("P(Q >= 8) >= 0.5; P(Q <= 6) >= 0.5")) == 2


def test_goals__a_load_with_a_unit_needs_what_it_is_over():
    with pytest.raises(InputError, match=r"'0\.8 N': needs the body's length"):
        parse_goals("P(Q >= 8 at 0.8 N) >= 0.5", body=Body.of("8 mm", "60 kPa"))
