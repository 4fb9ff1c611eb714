"""Scenes to numbers: transition loads as tables, and what a body does under given loads.

Knows scenes, mechanics and tables; nothing that samples. `generation.generate` gives a
`ContactTable`, `responses.contact_at_loads` what happens between transitions:

>>> from ridgebayes.scene.scene import Scene
>>> from ridgebayes.simulate.generation import generate
>>> generate(Scene.of([(0.032, 0.01)], p_over_E=0.005)).frame["Q"].tolist()
[4, 6]
"""
