"""Checks of fits: coverage, cross-validation, predictive checks, power scaling and cost.

Each check takes fits, comparisons or tables and returns a data frame or a small record. Figures
and files are made elsewhere.

>>> import ridgebayes as rb
>>> from ridgebayes.checks.predictive_checks import posterior_checks
>>> fit = rb.calibrate(rb.paper_sweep(), rb.Hybrid(), noise="iid", rng=1)
>>> checks = posterior_checks(fit, n_draw=500)
>>> [name for name, p in checks.p_values.items() if not 0.01 < p < 0.99]
['trend']
"""
