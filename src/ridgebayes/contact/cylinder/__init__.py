"""The soft cylinder on rigid ridges by finite elements, at small and at finite strain.

`material`, `mesh` and `solid` are the body, `faces` the rigid side, `surface` the gaps between,
`contact_problem` both together, `newton` its equilibrium, `cylinder` the transitions;
`small_strain` has those of a linear body, `fields` writes states to files. Knows profiles; no
scene, no table.

>>> from ridgebayes.contact.cylinder.cylinder import Cylinder
>>> from ridgebayes.contact.rigid_profile import Profile
>>> body = Cylinder(Profile(0.06, 0.03), p_max=0.006, edges=4)
>>> [one.Q for one in body.transitions(0.006)]
[4]
"""
