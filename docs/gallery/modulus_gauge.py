"""Ridges as a modulus gauge: how stiff is the body?
=================================================

The load at which a body reaches its next ridge is proportional to its modulus. The half-plane form
has one coefficient c, which scales loads by 1/c². With a guess of E the ratios p/E of the table are
the true ratios times truth over guess, so the true E is the guess over c².

Here the body is a finite-element cylinder of 60 kPa, whose loads scatter by 3 %. The guess is 45
kPa. The prior of c is wide, since the guess may be far off.

.. image:: images/sphx_glr_modulus_gauge_001.png
   :alt: Ridges as a modulus gauge: how stiff is the body?
"""

import matplotlib.pyplot as plt
import numpy as np

import ridgebayes as rb

truth, guess = 60.0, 45.0  # kPa
rows = rb.reference_fe().calibration.frame[["a_over_R", "b_over_R", "Q", "p_over_E", "nu"]]
scatter = np.exp(0.03 * np.random.default_rng(1).standard_normal(len(rows)))
measured = truth * rows["p_over_E"] * scatter  # kPa
table = rows.assign(p_over_E=measured / guess)

priors = {"half-plane": {"c": rb.LogNormal(1.0, 0.5)}}
fit = rb.calibrate(table, rb.HalfPlane(), noise="texture+step", priors=priors, rng=1)
modulus = guess / fit.draws[:, 0] ** 2
low, high = np.quantile(modulus, [0.05, 0.95])

figure, axis = plt.subplots(figsize=(6, 3.2), layout="constrained")
axis.hist(modulus, 60, density=True, color="0.8")
axis.axvspan(low, high, color="0.9", zorder=0, label=f"90 %: {low:.1f} to {high:.1f} kPa")
axis.axvline(truth, color="black", label="true modulus")
axis.axvline(guess, color="black", linestyle="--", label="guess")
axis.set(xlabel="modulus E (kPa)", yticks=[])
figure.legend(frameon=False, loc="outside upper center", ncols=3, fontsize=9)
