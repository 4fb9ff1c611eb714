"""Checks of fits: coverage, cross-validation, predictive checks, power scaling, plans, cost.

Each refits, replicates or measures, and returns a frame or a small record. The room knows fits,
comparisons and scenes; it neither draws nor writes.

>>> import ridgebayes as rb
>>> from ridgebayes.checks.predictive_checks import posterior_checks
>>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
>>> checks = posterior_checks(fit, n_draw=500)
>>> [name for name, p in checks.p_values.items() if not 0.01 < p < 0.99]
['trend']
"""
