"""When does small strain stop being enough?
=========================================

The figure shows loads of the half-plane equation, relative to loads of a body under large
deformation, such as a fingertip. `--solver auto` and `ridgebayes plan` choose by this difference
and the required accuracy.

.. image:: images/sphx_glr_large_loads_001.png
   :alt: When does small strain stop being enough?
"""

import matplotlib.pyplot as plt

import ridgebayes as rb

figure, axis = plt.subplots(figsize=(6, 3.4), layout="constrained")
for nu in (0.5, 0.45, 0.3):
    scene = rb.Scene.of([(0.06, 0.05)], p_over_E=0.3, nu=nu)
    small = rb.generate(scene, solver="half-plane").frame.set_index("Q")["p_over_E"]
    large = rb.generate(scene, solver="two-scale").frame.set_index("Q")["p_over_E"]
    ratio = (100 * (small / large - 1)).dropna()
    axis.plot(large[ratio.index], ratio, "o-", label=f"Poisson's ratio {nu:g}")
axis.axhspan(-1, 1, color="0.92", zorder=0, label="within 1 %")
axis.set(xlabel="load p/E", ylabel="half-plane over large deformation, %", xscale="log")
axis.legend(frameon=False)
