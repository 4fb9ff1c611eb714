"""Predictions of a posterior: the distribution of Q at a load, and of the load that reaches a Q.

`predict` has both, of one posterior and of weighted ones (`Predictive`); `q_distribution` and
`load_distribution` the records that they return (`predicted` what both do, `load_draws` the draws
of loads), and mixtures of them by given weights; `predictive_cdf` the averages over draws,
`interpolant` their tables for many loads; `joint_draws` counts drawn at many loads, each
body on its own texture; `extrapolation` what lies beyond the calibrated range. The room knows
`inference` and `model`.

>>> import numpy as np
>>> from ridgebayes.predict.q_distribution import QDistribution, mix_q
>>> one = QDistribution(np.array([1.0, 1.0, 0.5]), np.array(False), 10, "simulation")
>>> other = QDistribution(np.array([1.0, 0.5]), np.array(False), 10, "simulation")
>>> mix_q([one, other], [0.5, 0.5]).pmf.tolist()
[0.25, 0.5, 0.25]
"""
