"""Forms against each other on one table: Bayes factors, probabilities, scores, verdict, bands.

`compare` fits and compares; `comparison` has its record. `bayes_factors` and `scores` make their
tables, `verdict` grades the most probable form, `same_loads` finds forms with equal loads at all
rows, and `ranking` arranges the results for a page. `bands` predicts Q and loads as the files of a
run hold them, averaged over forms and error models. The room knows fits and evidences, and neither
draws nor writes.

>>> import ridgebayes as rb
>>> cmp = rb.compare(rb.paper_sweep(), [rb.Classic(), rb.Modified()], noise="iid", rng=1)
>>> cmp.best, cmp.complete
('modified', True)
>>> cmp.bayes_factors[["form_a", "form_b", "reading"]].iloc[0].tolist()
['classic', 'modified', 'very strong for modified (Kass & Raftery); rows are not independent']
>>> cmp.verdict.grade, cmp.verdict.over
('decisive', 'classic')
"""
