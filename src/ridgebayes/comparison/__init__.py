"""Comparison of forms on one table: Bayes factors, probabilities, scores, verdict and bands.

`compare` fits and compares forms; `comparison` contains the result class. `bayes_factors` and
`scores` compute tables, `verdict` grades the most probable form, `same_loads` finds forms that can
reach equal loads at all rows, and `ranking` arranges the results for the report. `bands` computes
the tables of predicted Q and loads in a run folder, averaged over forms and error models. The
package neither draws figures nor writes files.

>>> import ridgebayes as rb
>>> cmp = rb.compare(rb.paper_sweep(), ["classic", "modified"], noise="iid", accuracy="quick")
>>> cmp.best, cmp.complete
('modified', True)
>>> cmp.bayes_factors[["form_a", "form_b", "reading"]].iloc[0].tolist()
['classic', 'modified', 'very strong for modified (Kass & Raftery); rows are not independent']
>>> cmp.verdict.grade, cmp.verdict.over
('decisive', 'classic')
"""
