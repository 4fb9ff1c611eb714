"""Simulation of scenes: tables of transition loads, and contact at given loads.

`generation.generate` returns a `ContactTable`, and `responses.contact_at_loads` the contact between
transitions. The package imports scenes, mechanics and tables, but no sampling:

>>> from ridgebayes.scene.scene import Scene
>>> from ridgebayes.simulate.generation import generate
>>> generate(Scene.of([(0.032, 0.01)], p_over_E=0.005)).frame["Q"].tolist()
[4, 6]
"""
