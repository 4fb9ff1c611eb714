"""Which ridges carry the load?
============================

The figure shows the shares of the ridges on one side, counted from the middle. A ridge that was
just reached carries no load yet: the count rises before the new pair carries load.

.. image:: images/sphx_glr_who_carries_the_load_001.png
   :alt: Which ridges carry the load?
"""

import matplotlib.pyplot as plt
import numpy as np

import ridgebayes as rb

loads = np.geomspace(2e-4, 0.02, 60)
forces = rb.ridge_forces(rb.Scene.of([(0.022, 0.02)]), loads)
shares = forces.pivot_table(index="p_over_E", columns="ridge", values="share").fillna(0.0)

figure, axis = plt.subplots(figsize=(6, 3.4), layout="constrained")
axis.stackplot(shares.index, 100 * shares.to_numpy().T, labels=[f"ridge {k + 1}" for k in shares])
axis.set(xlabel="load p/E", ylabel="share of the load on one side, %", xscale="log", ylim=(0, 50))
axis.margins(x=0)
axis.legend(loc="lower left")
