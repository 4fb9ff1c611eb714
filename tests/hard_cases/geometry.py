"""Hard cases of geometry and forms: extreme textures, loads at the edge of floating point."""

import numpy as np

import ridgebayes as rb
from tests.hard_cases.case import hard_case

PRINTED = (rb.Classic(), rb.Modified(), rb.Hybrid())


@hard_case(
    "Q of 10^6 by the printed forms",
    why="A transition load of 10^6 edges is a product of numbers of sizes 10^11 and 10^-8; "
    "rounding makes the floor of the inverse miss by an edge.",
    expected="at the load given for Q exactly Q edges touch, one ulp below it Q - 2 (exact)",
)
def q_of_a_million():
    Q = 1_000_000 + 2 * np.arange(1000)
    for form in PRINTED:
        load = form.load(Q, 0.012, 0.03)
        np.testing.assert_array_equal(form.count(load, 0.012, 0.03), Q)
        np.testing.assert_array_equal(form.count(np.nextafter(load, 0), 0.012, 0.03), Q - 2)
    return f"exact for {len(Q)} counts from {Q[0]:,} of {', '.join(f.name for f in PRINTED)}"
