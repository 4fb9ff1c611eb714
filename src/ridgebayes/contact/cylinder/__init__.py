"""Soft cylinder on rigid ridges by finite elements, at small and at finite strain.

`material`, `mesh` and `solid` describe the body, `faces` the rigid side, `surface` the gaps between
them, and `contact_problem` both together. `newton` finds equilibria, `cylinder` transitions.
`small_strain` has the transitions of a linear body, and `fields` writes states to files. The
package imports profiles, but neither scenes nor tables.

>>> from ridgebayes.contact.cylinder.cylinder import Cylinder
>>> from ridgebayes.contact.rigid_profile import Profile
>>> body = Cylinder(Profile(0.06, 0.03), p_max=0.006, edges=4)
>>> [transition.Q for transition in body.transitions(0.006)]
[4]
"""
