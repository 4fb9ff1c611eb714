"""Predictions of a posterior: the distribution of Q at a load, and of the load that reaches a Q.

`predict` has both, of one posterior and of weighted ones (`Predictive`); `q_distribution` and
`load_distribution` are the records that they return (`predicted` what both do), and mixtures of
them by given weights. `posterior_loads` has the log loads of a posterior's draws, normal for each
draw, and `load_draws` the averages over draws that all answers are made of. `joint_draws` has loads
over a/pitch, and draws counts of bodies, each on its own texture; `of_scene` predicts a scene, and
`extrapolation` flags predictions beyond the calibrated range. The room knows `inference` and
`model`.

>>> import numpy as np
>>> from ridgebayes.predict.q_distribution import QDistribution, mix_q
>>> one = QDistribution(np.array([1.0, 1.0, 0.5]), np.array(False), 10, "simulation")
>>> other = QDistribution(np.array([1.0, 0.5]), np.array(False), 10, "simulation")
>>> mix_q([one, other], [0.5, 0.5]).pmf.tolist()
[0.25, 0.5, 0.25]
"""
