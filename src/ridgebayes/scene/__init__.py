"""Scenes to simulate: records, TOML files, units, and the effects to include.

The package imports the mechanics (`contact`) and the bounds of tables, but no solver settings and
no statistics. `Scene` is its record; `estimates.plan` decides which effects are simulated:

>>> from ridgebayes.scene.estimates import plan
>>> from ridgebayes.scene.scene import Scene
>>> scene = Scene.of([(0.032, 0.01)], p_over_E=0.01, relative=0.02)
>>> plan(scene)[0].simulated
('ridges', "Poisson's ratio")
"""
