"""Predictions of a posterior: the distribution of Q at a load, and of the load that reaches a Q.

`predict` predicts from one posterior or from several weighted posteriors (`Predictive`).
`q_distribution` and `load_distribution` contain the returned distributions and average them with
given weights; `predicted` contains their shared methods. `posterior_loads` computes the log load of
each posterior draw, which is normal given the draw, and `load_draws` averages over draws.
`joint_draws` interpolates loads over a/pitch and draws counts for bodies with different textures.
`of_scene` predicts a scene, and `extrapolation` flags predictions beyond the calibrated range. The
package imports `inference` and `model`.

>>> import numpy as np
>>> from ridgebayes.predict.q_distribution import QDistribution, mix_q
>>> first = QDistribution(np.array([1.0, 1.0, 0.5]), np.array(False), 10, "simulation")
>>> second = QDistribution(np.array([1.0, 0.5]), np.array(False), 10, "simulation")
>>> mix_q([first, second], [0.5, 0.5]).pmf.tolist()
[0.25, 0.5, 0.25]
"""
