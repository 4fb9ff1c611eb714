"""Scenes to simulate, their TOML files and units, and the effects that a scene calls for.

Knows the mechanics (`contact`) and the bounds of tables; no solver's settings, no statistics. Its
record is `Scene`; `estimates.plan` says which effects its transition loads depend on:

>>> from ridgebayes.scene.estimates import plan
>>> from ridgebayes.scene.scene import Scene
>>> scene = Scene.of([(0.032, 0.01)], p_over_E=0.01, relative=0.02)
>>> plan(scene)[0].simulated
('ridges', "Poisson's ratio")
"""
