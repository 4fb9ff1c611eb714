"""Which form do the loads support, and how firmly?
================================================

ln BF compares how well two forms, with their priors, predict the rows. It depends on the error
model: each point assumes one error model. The rows contradict error models below −10 in the right
panel, and these carry no weight.

.. image:: images/sphx_glr_which_form_001.png
   :alt: Which form do the loads support, and how firmly?
"""

import matplotlib.pyplot as plt

import ridgebayes as rb

comparison = rb.compare(rb.paper_sweep(), [rb.Modified(), rb.Hybrid()], rng=1)
used = comparison.evidence.query("used").pivot_table("log_evidence", "noise", "form")
used = used.sort_values("hybrid")

figure, (left, right) = plt.subplots(1, 2, figsize=(7.5, 3.6), layout="constrained", sharey=True)
left.plot(used["hybrid"] - used["modified"], used.index, "o")
left.axvline(0, color="0.6", lw=0.8, zorder=0)
low, high = comparison.verdict.ln_bf_range
left.axvspan(low, high, fc="0.92", ec="0.6", zorder=0, label="range of the verdict")
left.set(xlabel="ln BF, Hybrid over Modified", title=f"verdict: {comparison.verdict.grade}")
left.legend(frameon=False, loc="lower right")
right.plot(used["hybrid"] - used["hybrid"].max(), used.index, "o", color="C1")
right.set(xlabel="ln evidence of the error model", title="Hybrid, best = 0")
