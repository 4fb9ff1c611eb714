"""Textures under uncertainty: which ridge and groove meet a goal, how surely, and why.

`goals` reads what is asked for, `design.design` answers with a `record.Design`. On the way:
`lattice` has the textures that can be made, `bodies` draws what is not certain of body and widths,
`drawn_loads` has the loads of each draw of a posterior, `goal_values` averages over all of them,
`choice` recommends. `limits` says what an unmet goal lacks, `sensitivity` (a check by counts drawn
one by one, Sobol's indices, what to measure) and `next_simulation` say why, and what to do next.
"""
