"""Edge cases of geometry and forms: extreme textures, loads at the limits of floating point."""

import functools
import math
from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import minimize_scalar

import ridgebayes as rb
from ridgebayes import LogNormal
from ridgebayes.contact import hertz
from ridgebayes.contact.halfplane import HalfPlaneLoads, transition_loads
from ridgebayes.contact.scaling import reduced_load
from ridgebayes.inference.latent import LatentIntegral
from ridgebayes.scene.scene import Texture
from tests.drawn import model_of
from tests.hard_cases.case import hard_case, refused

PRINTED = (rb.Classic(), rb.Modified(), rb.Hybrid())
TEXTURES = ((0.012, 0.03), (0.022, 0.02), (0.032, 0.01), (0.018, 0.045))
EXTREMES = (0.0, -0.01, math.nan, math.inf, 5e-324, 1e-320, 1e-200, 1e200)


def every_form(textures=TEXTURES):
    """Every form with its coefficients: the printed ones, and some K for each texture."""
    bound = rb.PowerLaw().bind(textures)
    own = np.array([2.7 / (a + b) for a, b in textures])
    return [
        *((form, np.array(form.published)) for form in (*PRINTED, rb.HalfPlane())),
        (bound, own),
    ]


@functools.cache
def half_plane_loads(ratio: float, n: int, rel_tol: float = 1e-8) -> HalfPlaneLoads:
    """Loads of ridges `ratio` times as wide as the grooves; all must be ok."""
    loads = transition_loads(ratio, 1.0, n, rel_tol=rel_tol)
    assert set(loads.status) == {"ok"}, loads.status
    return loads


def line_contacts(k: int, a: float) -> float:
    """F_k of ridges of width `a` pitches, each taken as one line of force.

    On itself a strip of width a acts at the distance a/4; at the others' lines at theirs.
    """
    x = np.arange(2 * k) - (2 * k - 1) / 2
    distance = np.abs(x[:, None] - x)
    np.fill_diagonal(distance, a / 4)
    corner = k + 0.5 - a / 2
    rows = np.column_stack(
        [-np.log(np.vstack([distance, np.abs(corner - x)])), -np.ones(2 * k + 1)]
    )
    force = np.linalg.solve(rows, np.append(-(x**2), -(corner**2)) / 2)[:-1]
    return math.pi / 4 * force.sum()


@hard_case(
    "Ridges far narrower than grooves: a/b from 1e-6 down to 1e-60",
    why="The ridges act like line forces, and their compliance grows as ln(1/a). There is no "
    "finite limit. A mesh of fixed size solves for a wider ridge.",
    expected="The loads of line forces, from a separate linear system with ln|x| influence and a "
    "capacity of a/4 each. They agree to O(a/b), and to 1e-12 at least.",
)
def narrow_ridges_are_line_forces():
    worst = 0.0
    for ratio in (1e-6, 1e-8, 1e-12, 1e-30, 1e-60):
        found = half_plane_loads(ratio, 8).F
        expected = [line_contacts(k, ratio / (1 + ratio)) for k in range(1, 9)]
        worst = max(worst, np.abs(found / expected - 1).max())
    assert worst < 1e-12
    slender = half_plane_loads(1e-60, 8).F / half_plane_loads(1e-6, 8).F
    return (
        f"8 loads at each of 5 ratios within 1e-12; F_1 and F_8 at 1e-60 are {slender[0]:.4f} and "
        f"{slender[-1]:.4f} of those at 1e-6"
    )


@hard_case(
    "Grooves far narrower than ridges: a/b of 100, 1000, 10^4",
    why="Between nearly closed ridges the pressure has a layer as thin as the groove at each "
    "edge. With too few functions the solution is smooth and misses the effect of the grooves.",
    expected="Hertz's load times 1 + b/(3 k pitch), from the gap beyond the edge of a single "
    "strip. The remainder falls as (b/a)^2. Its coefficient, -0.35, is the same at all three "
    "ratios to 3 %.",
)
def narrow_grooves_are_hertz_and_a_little():
    k, left = np.arange(1, 5), []
    for ratio in (1e2, 1e3, 1e4):
        pitch = 1 + ratio
        first = math.pi / 8 * k**2 * (1 + 1 / (3 * k * pitch))
        left.append((half_plane_loads(ratio, 4).F / first - 1) * ratio**2)
    np.testing.assert_allclose(left, np.broadcast_to(left[-1], (3, 4)), rtol=0.03)
    assert np.all(np.abs(left) < 0.4)
    return f"remainder over (b/a)^2: {', '.join(f'{x:.2f}' for x in left[-1])} for F_1 to F_4"


@hard_case(
    "Grooves a hundred-thousandth and a ten-millionth as wide as a ridge",
    why="The number of coefficients needed grows as sqrt(a/b). A solver that silently uses fewer "
    "returns a number with an error of unknown size.",
    expected="At 10^5 and a tolerance of 1e-2: Hertz's load within the tolerance. At 10^7: no "
    "number, and a status that names the coefficients needed and the limit. The form and the "
    "scene's plan refuse it too.",
)
def grooves_nearly_closed():
    loads = half_plane_loads(1e5, 1, 1e-2)
    np.testing.assert_allclose(loads.F, math.pi / 8, rtol=1e-2)
    narrow = rb.Scene.of([(0.02, 1e-10)])
    refused(lambda: rb.contact_at_loads(narrow, [0.01]), rb.InputError, "b/R = 1e-10")
    status = rb.contact_at_loads(narrow, [0.01], solver="half-plane")["status"]
    assert status.str.startswith("not computed").all()
    far = transition_loads(1e7, 1.0, 8)
    assert np.isnan(far.F).all()
    assert {text.split(":")[0] for text in far.status} == {"not computed"}
    words = refused(
        lambda: rb.HalfPlane().load(4, 1e-2, 1e-9), rb.InputError, "b/R = 1e-09", "coefficients"
    )
    return (
        f"10^5: {loads.F[0] * 8 / math.pi:.5f} of Hertz's load; 10^7: {far.status[0]}; form {words}"
    )


@hard_case(
    "a = 0 and b = 0",
    why="These look like valid limits: no ridges, no grooves. Both lead to a division by zero or "
    "to the logarithm of zero.",
    expected="Forms, solver, scene and table refuse both and name the width. The closed forms are "
    "continuous as b tends to 0 (rounding).",
)
def no_ridges_and_no_grooves():
    row = {"Q": 4, "p_over_E": 0.001}
    seen = ""
    for a, b, name in ((0.0, 0.02, "a_over_R"), (0.02, 0.0, "b_over_R")):
        for form, theta in every_form():
            refused(
                lambda f=form, t=theta, a=a, b=b: f.load(4, a, b, t),
                rb.InputError,
                f"{name}: expected finite and > 0",
                "got 0.0",
            )
        refused(lambda a=a, b=b: rb.Scene.of([(a, b)]), rb.InputError, f"{name} = 0.0")
        refused(lambda a=a, b=b: transition_loads(a, b, 1), rb.InputError, "width = 0.0")
        frame = pd.DataFrame([{"a_over_R": a, "b_over_R": b, **row}])
        with pytest.raises(rb.InputError, match=name) as told:
            rb.read_table(frame)
        seen = str(told.value).splitlines()[-1].strip()
    for form in PRINTED:
        near = [float(form.load(8, 0.02, b)) for b in (1e-12, 1e-30)]
        assert near[0] == pytest.approx(near[1], rel=1e-9)
    return f"refused in 4 places; message for a table: {seen}"


@hard_case(
    "Widths that are denormal, 1e-200, 1e200, infinite, negative or NaN",
    why="Loads scale with the width squared. At 1e-200 they underflow to zero, and the count at "
    "the load of 10 edges came out as 6. At 1e200 they overflow with only a warning.",
    expected="Every form, method and scene refuses them with a message. Widths of 1e-50 and 1e50 "
    "work: the count at the load of Q is Q (exact).",
)
def widths_beyond_floats():
    for form, theta in every_form():
        for bad in EXTREMES:
            for ask in (
                lambda w, f=form, t=theta: f.load(10, w, 0.02, t),
                lambda w, f=form, t=theta: f.load(10, 0.02, w, t),
                lambda w, f=form, t=theta: f.count(0.01, w, w, t),
                lambda w, f=form, t=theta: f.continuous_count(0.01, w, w, t),
                lambda w, f=form, t=theta: f.slope(w, w, t),
                lambda w, f=form, t=theta: f.log_load_gradient(t, w, w),
            ):
                refused(lambda w=bad, a=ask: a(w), rb.InputError, "_over_R", "finite and > 0")
    for bad in EXTREMES:
        refused(lambda w=bad: rb.Scene.of([(w, 0.02)]), rb.InputError, "a_over_R")
    sizes = ((1e-50, 1e-50), (1e50, 1e50), (1e-50, 1e50), (0.01, 1e-50))
    for form, theta in every_form(sizes):
        solvable = sizes[:3] if form.name == "half-plane" else sizes
        for a, b in solvable:
            assert form.count(form.load(10, a, b, theta), a, b, theta) == 10
    words = refused(lambda: rb.Hybrid().load(10, 1e-200, 1e-200), rb.InputError)
    return f"8 widths in 6 calls of 5 forms refused, such as {words!r}; 1e-50 and 1e50 exact"


@hard_case(
    "Coefficients of 1e300, infinity, NaN, zero and below",
    why="A coefficient that diverges gives a load of 0 at any count. A negative one is squared "
    "and gives a load that looks right.",
    expected="Not finite or beyond 1e60: refused. Not positive: NaN as load and gradient, and no "
    "count. So small that the load overflows: infinite.",
)
def coefficients_run_away():
    for form, theta in every_form():
        one = np.ones(len(theta))
        for bad in (1e300, math.inf, -math.inf, math.nan):
            for ask in (form.load, form.count):
                refused(lambda f=ask, t=bad * one: f(4, 0.022, 0.02, t), rb.InputError, "theta")
        for bad in (0.0, -1.3):
            assert np.isnan(form.load(4, 0.022, 0.02, bad * one))
            assert np.isnan(form.log_load_gradient(bad * one, 0.022, 0.02)).all()
            refused(
                lambda t=bad * one, f=form: f.count(0.01, 0.022, 0.02, t), rb.InputError, "rate"
            )
        assert form.load(4, 0.022, 0.02, 1e-200 * one) == math.inf
        assert form.count(0.01, 0.022, 0.02, 1e-200 * one) == 2
    return "5 forms: refused, NaN, infinite as expected; no warning"


@hard_case(
    "Q of 10^6 with the closed forms",
    why="A transition load of 10^6 edges is a product of numbers near 10^11 and 10^-8. Rounding "
    "can make the inverse miss by an edge.",
    expected="At the load given for Q exactly Q edges touch; one ulp below it, Q - 2 (exact).",
)
def q_of_a_million():
    Q = 1_000_000 + 2 * np.arange(1000)
    for form in PRINTED:
        load = form.load(Q, 0.012, 0.03)
        np.testing.assert_array_equal(form.count(load, 0.012, 0.03), Q)
        np.testing.assert_array_equal(form.count(np.nextafter(load, 0), 0.012, 0.03), Q - 2)
    return f"exact for {len(Q)} counts from {Q[0]:,} of {', '.join(f.name for f in PRINTED)}"


@hard_case(
    "Q of 10^6 with the power law and the half-plane equation",
    why="The power law is a square of Q and has to be just as exact. The half-plane equation "
    "would need 500,000 pairs of ridges in the solver, and hours.",
    expected="Power law: the load in rational arithmetic (2 ulp), and its count exactly. "
    "Half-plane: refused, with the number of pairs and the limit.",
)
def q_of_a_million_by_the_others():
    form, K = rb.PowerLaw().bind(((0.012, 0.03),)), 65.7
    Q = 1_000_000 + 2 * np.arange(1000)
    load = form.load(Q, 0.012, 0.03, [K])
    exact = [float((Fraction(int(q) - 2) / Fraction(K)) ** 2) for q in Q]
    np.testing.assert_allclose(load, exact, rtol=2 * np.finfo(float).eps)
    np.testing.assert_array_equal(form.count(load, 0.012, 0.03, [K]), Q)
    np.testing.assert_array_equal(form.count(np.nextafter(load, 0), 0.012, 0.03, [K]), Q - 2)
    words = refused(
        lambda: rb.HalfPlane().load(1_000_000, 0.012, 0.03), rb.InputError, "pairs", "at most 500"
    )
    return f"power law exact for {len(Q)} counts; half-plane {words}"


@hard_case(
    "Invalid counts: odd, 4.5, 2^53 + 2, 1e300, infinite, NaN",
    why="Beyond 2^53 a float cannot tell an even number from an odd one. Infinity modulo 2 is NaN "
    "with a warning.",
    expected="Every form's load refuses them. The count refuses a load whose count exceeds 2^52.",
)
def counts_that_are_no_counts():
    for form, theta in every_form():
        for bad in (5, 4.5, 0, -2, 2.0**53 + 2, 1e300, math.inf, math.nan):
            refused(lambda f=form, t=theta, q=bad: f.load(q, 0.022, 0.02, t), rb.InputError, "Q:")
        words = refused(lambda f=form, t=theta: f.count(1e299, 0.022, 0.02, t), rb.InputError)
        refused(lambda f=form, t=theta: f.count(1.7e308, 0.022, 0.02, t), rb.InputError, "1e+300")
    return f"8 counts and 2 loads refused by 5 forms; power law at 1e299 {words}"


@hard_case(
    "p/E of 1e-300 and of 1",
    why="At 1e-300 the contact is 1e-150 of the radius wide; at 1 it is a third of it. Tables and "
    "counts contain both after a mistake in units or a preload.",
    expected="Forms: 2 edges, and the floor of the closed form (exact). Scene: refused at 1e-300, "
    "as there is no transition. Up to 1 the loads rise with Q, and they are within 1 % of Hertz's "
    "beyond Q = 20.",
)
def loads_of_nothing_and_of_everything():
    for form, theta in every_form():
        assert form.count([0.0, 5e-324, 1e-300], 0.022, 0.02, theta).tolist() == [2, 2, 2]
    for form, c in ((rb.Classic(), 1.382), (rb.Modified(), 1.38)):
        lead = 0.01 if form.name == "classic" else 0.0
        pairs = math.floor((Fraction(c) - Fraction(lead)) / (Fraction(0.022) + Fraction(0.02)))
        assert form.count(1.0, 0.022, 0.02) == 2 + 2 * pairs
    none = refused(
        lambda: rb.generate(rb.Scene.of([(0.022, 0.02)], p_over_E=1e-300)),
        rb.InputError,
        "no transition under p/E = 1e-300",
    )
    frame = rb.generate(rb.Scene.of([(0.022, 0.02)], p_over_E=1.0), solver="half-plane").frame
    Q, p = frame["Q"].to_numpy(), frame["p_over_E"].to_numpy()
    assert np.array_equal(Q, 4 + 2 * np.arange(len(Q)))
    assert np.all(np.diff(p) > 0)
    smooth = hertz.load_of_half_width((Q / 2 - 1) * 0.042)
    assert np.all(np.abs(p / smooth - 1)[Q > 20] < 0.01)
    counted = rb.contact_at_loads(rb.Scene.of([(0.022, 0.02)]), [1.0], solver="half-plane")
    assert counted["status"].tolist() == ["ok"]
    assert counted["Q"].tolist() == [Q[-1]]
    return f"2 edges at 1e-300, {Q[-1]} at 1 by solver and count of a scene; {none}"


@hard_case(
    "A table with loads of 1e-300 and of 1",
    why="Sums of squares of ln p lose digits if they are taken about zero. So do sums over widths "
    "that differ a thousandfold.",
    expected="The table is read and fitted. The density at given sigma has its top in ln c at the "
    "closed form mean(ln h L - ln p/2), to 1e-8.",
)
def tables_of_extreme_loads():
    a, b = np.repeat([1e-48, 0.2, 0.03], 4), np.repeat([1e-48, 0.3, 1e-9], 4)
    Q = np.tile([4, 6, 8, 10], 3)
    noise = 0.01 * np.cos(np.arange(12.0))
    p = rb.Modified().load(Q, a, b, [1.3]) * np.exp(noise)
    table = rb.read_table(pd.DataFrame({"a_over_R": a, "b_over_R": b, "Q": Q, "p_over_E": p}))
    wide = {"c": LogNormal(1.0, 100.0)}
    model = model_of(table, rb.Modified(), priors=wide)
    integral, sigma = LatentIntegral(model), model.to_scores(np.array([[1.0, 0.01]]))[0, 1]

    def off(u):
        found = integral.estimated(np.array([[u, sigma]]), np.random.default_rng(0), 8)
        return -float(found.log_density[0] + 0.5 * u * u)

    found = minimize_scalar(off, bounds=(0.0, 0.01), method="bounded", options={"xatol": 1e-13})
    top = float(model.to_theta(np.array([[found.x, sigma]]))[0, 0])
    expected = math.exp(math.log(1.3) - noise.mean() / 2)
    assert top == pytest.approx(expected, rel=1e-8)
    return f"loads from {p.min():.0e} to {p.max():.1e}: c = {top:.6f}, closed form {expected:.6f}"


@hard_case(
    "Loads exactly at a transition, one ulp below and one above, with every form",
    why="Every row of a table is such a load. The floor of a rounded square root gives Q - 2 for "
    "half of them.",
    expected="Q at the load and one ulp above; Q - 2 one ulp below (exact). For 4 textures, Q up "
    "to 60, nu of 0, 0.3, 0.4999 and 0.5, and 200 draws of coefficients at once.",
)
def transitions_hit_exactly():
    rng, n = np.random.default_rng(7), 0
    a, b = np.array(TEXTURES).T[:, :, None]
    Q = np.arange(4, 62, 2)
    for form, theta in every_form():
        draws = theta * np.exp(0.2 * rng.standard_normal((200, 1)))
        for nu in (0.0, 0.3, 0.4999, 0.5):
            for one in (theta, draws[0], draws[1]):
                load = form.load(Q, a, b, one, nu)
                above, below = np.nextafter(load, np.inf), np.nextafter(load, 0)
                wanted = np.broadcast_to(Q, load.shape)
                assert np.array_equal(form.count(load, a, b, one, nu), wanted)
                assert np.array_equal(form.count(above, a, b, one, nu), wanted)
                assert np.array_equal(form.count(below, a, b, one, nu), wanted - 2)
                n += load.size
            at = float(form.load(12, 0.022, 0.02, draws[5], nu))
            many = form.count(at, 0.022, 0.02, draws, nu)
            single = [int(form.count(at, 0.022, 0.02, one, nu)) for one in draws]
            assert many.tolist() == single
            assert many[5] == 12
    return f"{n:,} transitions of 5 forms exact; draws in one call equal single calls"


@hard_case(
    "A scene's counts just below and above its own transition loads",
    why="Table and count come from different solvers. One finds the load of an event, the other "
    "the contact at a load.",
    expected="Q - 2 edges at a load 1e-6 below that of the table, and Q at 1e-6 above (1e-6 is "
    "the tolerance of contact ends). The same with floors, corners and an offset.",
)
def scenes_counts_agree_with_their_tables():
    plain = Texture(a_over_R=0.022, b_over_R=0.02)
    others = {
        "plain": plain,
        "corners": plain.model_copy(update={"corner_radius_over_R": 0.002}),
        "offset": plain.model_copy(update={"offset": 0.2}),
        "floor": plain.model_copy(update={"groove_depth_over_R": 0.002}),
    }
    n = 0
    for texture in others.values():
        scene = rb.Scene(textures=(texture,), p_over_E=0.012, nu=0.3)
        frame = rb.generate(scene, solver="half-plane").frame
        p, Q = frame["p_over_E"].to_numpy(), frame["Q"].to_numpy()
        step = 1 if texture.offset else 2
        for factor, wanted in ((1 - 1e-6, Q - step), (1 + 1e-6, Q)):
            found = rb.contact_at_loads(scene, p * factor, solver="half-plane", rel_tol=1e-8)
            assert found["status"].eq("ok").all()
            assert found["Q"].tolist() == wanted.tolist()
        n += len(Q)
    return f"{n} transitions of {', '.join(others)} on both sides"


@hard_case(
    "One pair of ridges: only Q = 2",
    why="Below the first transition the table of a texture is empty. Fits and averages of an "
    "empty table give NaN.",
    expected="generate refuses and names the first load. The contact itself is solved: 2 edges "
    "with equal shares (rounding).",
)
def one_pair_of_ridges():
    scene = rb.Scene.of([(0.5, 0.5)], p_over_E=0.01)
    words = refused(lambda: rb.generate(scene), rb.InputError, "no transition", "the first is at")
    found = rb.contact_at_loads(scene, [0.01, 0.1])
    assert found["Q"].tolist() == [2, 2]
    assert rb.ridge_forces(scene, [0.01, 0.1])["share"].tolist() == pytest.approx([0.5, 0.5])
    for form in PRINTED:
        assert form.load(2, 0.5, 0.5) >= 0
        assert form.count(form.load(2, 0.5, 0.5), 0.5, 0.5) == 2
    return f"Q = 2 at p/E of 0.01 and 0.1; table {words}"


@hard_case(
    "A pitch of a millionth of the radius",
    why="At any realistic load 10^5 ridges touch. Forms can handle this. Solvers that list every "
    "ridge run out of time and memory; this one took 40 s to report it at p/E of 10^10.",
    expected="Forms: by scale invariance the count at p/L^2 is that of a pitch of 0.042 (exact). "
    "Scene: a status with the number of unknowns, and no load. No row with a Q lacks a status.",
)
def pitch_of_a_millionth():
    for form, theta in every_form(((0.022, 0.02), (2.2e-7, 2e-7))):
        fine = form.load([4, 6, 40], 2.2e-7, 2e-7, theta)
        coarse = form.load([4, 6, 40], 0.022, 0.02, theta)
        np.testing.assert_allclose(fine / coarse, (2.2e-7 / 0.022) ** 2, rtol=1e-14)
    for p in (0.01, 1e10):
        found = rb.contact_at_loads(rb.Scene.of([(1e-6, 1e-6)]), [p], solver="half-plane")
        assert found["Q"].tolist() == [0]
        assert found["contact_fraction"].isna().all()
        assert found["status"].str.startswith("not computed: some ").all()
        forces = rb.ridge_forces(rb.Scene.of([(1e-6, 1e-6)]), [p], solver="half-plane")
        assert forces["status"].tolist() == found["status"].tolist()
        assert forces["share"].isna().all()
    return f"loads scale by 1e-10; a scene says {found['status'][0]!r}"


@hard_case(
    "Poisson's ratio of 0, 0.4999 and 0.5",
    why="At 0.5 displacement-based solid elements lock, and 1 - 2 nu stands in denominators. On a "
    "half-plane only 1 - nu^2 matters.",
    expected="(1 - nu^2) p is the same (rounding) for forms, half-plane loads, Hertz and contacts "
    "at given loads. -0.1, 0.5000001 and NaN are refused.",
)
def poissons_ratio_at_its_ends():
    for nu in (0.0, 0.4999, 0.5):
        share = 0.75 / (1 - nu**2)
        for form, theta in every_form():
            ratio = form.load([4, 40], 0.022, 0.02, theta, nu) / form.load(
                [4, 40], 0.022, 0.02, theta
            )
            np.testing.assert_allclose(ratio, share, rtol=1e-15 * 4)
        tables = [
            rb.generate(rb.Scene.of([(0.022, 0.02)], nu=n, p_over_E=0.02 * s), solver=solver).frame
            for solver in ("half-plane", "hertz")
            for n, s in ((nu, share), (0.5, 1.0))
        ]
        for one, other in (tables[:2], tables[2:]):
            np.testing.assert_allclose(one["p_over_E"] / other["p_over_E"], share, rtol=1e-14)
        one = rb.contact_at_loads(rb.Scene.of([(0.022, 0.02)], nu=nu), [0.004 * share])
        other = rb.contact_at_loads(rb.Scene.of([(0.022, 0.02)], nu=0.5), [0.004])
        assert one["half_width_over_R"][0] == pytest.approx(other["half_width_over_R"][0], rel=1e-9)
    for bad in (-0.1, 0.5000001, math.nan):
        refused(lambda n=bad: rb.Hybrid().load(4, 0.022, 0.02, nu=n), rb.InputError, "nu:")
        refused(lambda n=bad: rb.Scene.of([(0.022, 0.02)], nu=n), rb.InputError, "nu")
        refused(lambda n=bad: reduced_load(0.01, n), rb.InputError, "nu:")
    return "loads at nu = 0 are 0.75 of those at 0.5 by 5 forms, 2 solvers and a scene's contact"


@hard_case(
    "Textures from 10^-6 R to 10 R in one call",
    why="An internal table sized for the largest texture is wrong for the smallest, or does not "
    "fit in memory.",
    expected="Each element equals the result of a call for it alone (exact), in any order.",
)
def very_different_textures_in_one_call():
    a = np.array([1e-6, 0.5, 0.022, 10.0, 1e-3, 0.022])
    b = np.array([1e-4, 1e-4, 0.02, 0.1, 5.0, 0.02])
    Q = np.array([4, 8, 8, 6, 10, 40])
    order = np.array([3, 1, 5, 0, 4, 2])
    for form, theta in every_form(tuple(zip(a.tolist(), b.tolist(), strict=True))[:5]):
        loads = form.load(Q, a, b, theta)
        alone = [float(form.load(*one, theta)) for one in zip(Q, a, b, strict=True)]
        assert loads.tolist() == alone
        assert form.load(Q[order], a[order], b[order], theta).tolist() == loads[order].tolist()
        assert form.count(loads, a, b, theta).tolist() == Q.tolist()
    return f"loads from {loads.min():.1e} to {loads.max():.1e}, each equal to its own call"


@hard_case(
    "Ridges reached at the same load: a body over a groove, over a ridge, and 1e-12 beside them",
    why="A symmetric body reaches two ridges at one load. A solver of single events finds them at "
    "two loads that differ by rounding, or counts one twice.",
    expected="Over a groove: 4, 6, 8. Over a ridge: 5, 7, 9. At an offset of a millionth of a "
    "pitch each tie splits into two events within 1e-4 of the tie (first order in the offset).",
)
def ties_of_symmetric_ridges():
    def rows(offset, rel_tol=1e-8):
        texture = Texture(a_over_R=0.022, b_over_R=0.02, offset=offset)
        scene = rb.Scene(textures=(texture,), p_over_E=0.012)
        frame = rb.generate(scene, solver="half-plane", rel_tol=rel_tol).frame
        assert frame["status"].eq("ok").all()
        return frame["Q"].tolist(), frame["p_over_E"].to_numpy()

    groove, ridge, beside, mirror = rows(0.0), rows(0.5), rows(1e-6), rows(-1e-6)
    assert groove[0] == [4, 6, 8]
    assert ridge[0] == rows(-0.5)[0]
    assert all(q % 2 for q in ridge[0])
    assert beside[0] == mirror[0] == list(range(4, 9))
    np.testing.assert_allclose(beside[1], mirror[1], rtol=1e-7)
    # Those from 5 to 8 edges are the halves of ties; 3 and 4 are the first.
    ties = np.repeat(groove[1], 2)[1:]
    np.testing.assert_allclose(beside[1], ties, rtol=1e-4)
    assert np.all(np.diff(beside[1]) > 0)
    return f"over a groove {groove[0]}, over a ridge {ridge[0]}, beside {beside[0]}"


@hard_case(
    "Corner radii from 1e-300 of the ridge to all of it",
    why="A corner far below rounding leads to a division by its radius. On a round corner the "
    "first contact is so small that the lowest trial load could not be solved; the answer was 'no "
    "transition' up to a load that reaches 8 edges. Corners of half a ridge leave no flat top. "
    "Gaps were then searched on its far side, and loads came out 0.8 % too high.",
    expected="Below 1e-8 of a ridge: the loads of sharp corners (1e-8). At a quarter and half of "
    "a ridge: every load is lower than that of sharp corners, and the counts 1e-6 below and above "
    "it agree. A larger corner is refused.",
)
def corners_of_any_radius():
    def loads(corner):
        texture = Texture(a_over_R=0.022, b_over_R=0.02, corner_radius_over_R=corner)
        scene = rb.Scene(textures=(texture,), p_over_E=0.01)
        frame = rb.generate(scene, solver="half-plane").frame
        assert frame["status"].eq("ok").all()
        p = frame["p_over_E"].to_numpy()
        if corner > 1e-6:
            for factor, less in ((1 - 1e-6, 2), (1 + 1e-6, 0)):
                found = rb.contact_at_loads(scene, p * factor, solver="half-plane", rel_tol=1e-8)
                assert found["Q"].tolist() == (frame["Q"] - less).tolist()
        return p

    sharp = loads(0.0)
    for corner in (1e-300, 1e-15, 1e-11):
        np.testing.assert_allclose(loads(corner), sharp, rtol=2e-8)
    quarter, half = loads(0.0055), loads(0.011)
    assert np.all(half < quarter)
    assert np.all(quarter < sharp)
    ratio = half[0] / sharp[0]
    words = refused(
        lambda: Texture(a_over_R=0.022, b_over_R=0.02, corner_radius_over_R=0.0111),
        rb.InputError,
        "half the ridge width",
    )
    return f"tiny corners: as sharp; half a ridge: {ratio:.2f} times the first load; {words}"


@hard_case(
    "Groove floors at depths from a billionth of R to 10^300 R",
    why="A floor level with the ridges makes a flat surface, and grooves fill at once. A floor "
    "far below must not change any digit.",
    expected="At 10^300: the loads without a floor (exact). At 1e-9: Hertz's half-width within 1 "
    "%.",
)
def floors_of_any_depth():
    def texture(depth):
        return Texture(a_over_R=0.022, b_over_R=0.02, groove_depth_over_R=depth)

    found = {}
    for depth in (None, 1e300, 1e-9):
        scene = rb.Scene(textures=(texture(depth),), p_over_E=0.005)
        found[depth] = rb.contact_at_loads(scene, [0.004, 0.02], solver="half-plane")
        assert found[depth]["status"].eq("ok").all(), found[depth]["status"].tolist()
    assert found[None].equals(found[1e300])
    smooth = hertz.half_width(np.array([0.004, 0.02]))
    np.testing.assert_allclose(found[1e-9]["half_width_over_R"], smooth, rtol=0.01)
    share = found[1e-9]["contact_fraction"].min()
    return f"10^300: loads without a floor; 1e-9: {share:.0%} of Hertz's width is in contact"


@hard_case(
    "Loads of a scene that are 0, negative, NaN, infinite or 1.7e308",
    why="They come from mistakes in a list of loads. Loads are sorted, and each solution starts "
    "from the one before, so one bad load affects all that follow.",
    expected="Each is refused with its value. Valid loads give the same rows in any order (1e-9).",
)
def loads_out_of_range_and_order():
    scene = rb.Scene.of([(0.022, 0.02)])
    for bad in (0.0, -1.0, math.nan, math.inf, 1.7e308):
        for ask in (rb.contact_at_loads, rb.ridge_forces):
            refused(lambda p=bad, f=ask: f(scene, [0.004, p]), rb.InputError, f"p_over_E = {bad}")
    up = rb.contact_at_loads(scene, [0.001, 0.004, 0.009])
    down = rb.contact_at_loads(scene, [0.009, 0.004, 0.001])
    numbers = up.select_dtypes("number").columns
    np.testing.assert_allclose(up[numbers], down[numbers][::-1], rtol=1e-9)
    return "5 loads refused by 2 functions; order does not matter"
