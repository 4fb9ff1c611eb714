"""Where does each form get loads wrong?
=====================================

The figure shows loads of three forms, fitted to the same rows, relative to loads of the half-plane
equation. The error of a form is not noise: it depends only on Q and on the texture.

.. image:: images/sphx_glr_errors_of_the_forms_001.png
   :alt: Where does each form get loads wrong?
"""

import matplotlib.pyplot as plt

import ridgebayes as rb

table = rb.paper_sweep()
textures = {
    "wide ridges, narrow grooves": (0.032, 0.01),
    "narrow ridges, wide grooves": (0.012, 0.03),
}

figure, axes = plt.subplots(1, 2, figsize=(7.5, 3.4), layout="constrained", sharey=True)
for form, mark in ((rb.Classic(), "^"), (rb.Modified(), "o"), (rb.Hybrid(), "D")):
    fit = rb.calibrate(table, form, noise="iid", rng=1)
    mean = fit.draws[:, : len(form.parameter_names)].mean(axis=0)
    for axis, (title, (a, b)) in zip(axes, textures.items(), strict=True):
        rows = table.frame.query("a_over_R == @a and b_over_R == @b")
        error = 100 * (form.load(rows["Q"], a, b, mean) / rows["p_over_E"] - 1)
        axis.plot(rows["Q"], error, mark + "-", label=form.name)
        axis.set(title=title, xlabel="edges in contact Q")
for axis in axes:
    axis.axhline(0, color="0.6", lw=0.8, zorder=0)
axes[0].set_ylabel("load error of the form, %")
axes[0].legend(frameon=False)
