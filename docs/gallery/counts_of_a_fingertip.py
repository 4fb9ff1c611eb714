"""How many ridge edges does a fingertip touch at each load?
=========================================================

A fingertip with a radius of 8 mm and a modulus of 60 kPa on ridges of 0.25 mm with grooves of
0.2 mm. The Hybrid form is fitted to the embedded sweep, which does not contain this texture. Where
the band spans two counts, the next pair of edges may or may not be reached yet.

.. image:: images/sphx_glr_counts_of_a_fingertip_001.png
   :alt: How many ridge edges does a fingertip touch at each load?
"""

import matplotlib.pyplot as plt
import numpy as np

import ridgebayes as rb

R, E = 8.0, 60.0  # mm, kPa
fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
load = np.linspace(0.01, 1.2, 400)  # kPa, force over projected area
q = fit.predict(0.25 / R, 0.2 / R, load / E)
lower, upper = q.interval(0.9)

figure, axis = plt.subplots(figsize=(6, 3.4), layout="constrained")
axis.fill_between(load, lower, upper, step="mid", alpha=0.35, lw=0, label="90 % band")
axis.plot(load, q.median(), drawstyle="steps-mid", label="median")
axis.set(xlabel="load, kPa", ylabel="edges in contact Q", yticks=range(2, 10, 2))
axis.legend(frameon=False)
