"""At which load are eight edges reached, and how sure is that?
============================================================

Loads measured on a test rig scatter. Here the loads of four textures have 8 % of simulated noise.
The fit infers the scatter from the rows, and answers with a probability for each load.

.. image:: images/sphx_glr_load_for_eight_edges_001.png
   :alt: At which load are eight edges reached, and how sure is that?
"""

import matplotlib.pyplot as plt
import numpy as np

import ridgebayes as rb

rng = np.random.default_rng(1)
exact = rb.generate(rb.Scene.of([(0.03, 0.03), (0.045, 0.03), (0.02, 0.04), (0.04, 0.02)])).frame
rows = exact[exact["Q"] <= 14][["a_over_R", "b_over_R", "Q", "p_over_E"]]
rows = rows.assign(p_over_E=rows["p_over_E"] * np.exp(0.08 * rng.standard_normal(len(rows))))
fit = rb.calibrate(rows, rb.Hybrid(), noise="iid", rng=1)
loads = np.linspace(1e-4, 0.025, 400)
q = fit.predict(0.035, 0.03, loads)

figure, axis = plt.subplots(figsize=(6, 3.4), layout="constrained")
for n in (4, 6, 8):
    axis.plot(loads, q.at_least(n), label=f"P(Q ≥ {n})")
low, high = fit.predict_load(0.035, 0.03, 8).interval(0.9)
axis.axvspan(low, high, color="0.9", zorder=0, label="load of Q = 8, 90 %")
axis.set(xlabel="load p/E", ylabel="probability")
figure.legend(frameon=False, loc="outside upper center", ncols=4, fontsize=9)
