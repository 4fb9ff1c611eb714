"""How much does the error model change?
=====================================

The figure shows bands on each load of a texture that was not fitted. With independent rows (iid)
all bands are equally wide, and the band of Q = 4 just misses the load. At a given count the error
of a form is similar on all textures. The error model texture+step learns this error from the fitted
textures: its bands are a quarter as wide, and contain the loads.

.. image:: images/sphx_glr_bands_by_error_model_001.png
   :alt: How much does the error model change?
"""

import matplotlib.pyplot as plt
import numpy as np

import ridgebayes as rb

table, (a, b) = rb.paper_sweep(), (0.025, 0.018)
truth = rb.generate(rb.Scene.of([(a, b)])).frame
counts = truth["Q"].to_numpy()

figure, axis = plt.subplots(figsize=(6, 3.4), layout="constrained")
for k, noise in enumerate(("iid", "texture", "texture+step")):
    fit = rb.calibrate(table, rb.Hybrid(), noise=noise, rng=1)
    load = fit.predict_load(a, b, counts)
    low, high = (100 * (bound / truth["p_over_E"] - 1) for bound in load.interval(0.9))
    middle = 100 * (load.median() / truth["p_over_E"] - 1)
    place = counts + 0.3 * (k - 1)
    axis.errorbar(
        place, middle, np.abs([low, high] - middle.to_numpy()), fmt="o", capsize=3, label=noise
    )
axis.axhline(0, color="0.6", lw=0.8, zorder=0)
axis.set(xlabel="edges in contact Q", ylabel="predicted over computed load, %", xticks=counts)
axis.legend(frameon=False, title="error model, 90 % bands")
