"""Textures that meet a goal under uncertainty: design, recommendation and sensitivity.

`goals` parses goals, and `design.design` returns a `record.Design`. `lattice` lists the candidate
textures, `bodies` draws body and widths, `goal_values` averages over all draws, and `choice`
recommends a texture. `limits` finds the load or the widths that would meet an unmet goal,
`sensitivity` checks a design and splits its uncertainty among sources, and `next_simulation`
proposes a simulation.
"""
