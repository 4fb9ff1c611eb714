"""Figures of result objects, drawn by the functions of `drawing`.

`gallery` lists the figures of a report by name and draws each once, on workers or on first use.
`bodies` draws contact solutions, which the report does not show.

Examples
--------
>>> import ridgebayes as rb
>>> from ridgebayes.checks.report_data import report_data
>>> from ridgebayes.report.figures.gallery import Gallery
>>> data = report_data(rb.compare(rb.paper_sweep(), ["modified"], noise="iid", accuracy="quick"))
>>> sorted(Gallery(data))
['bands-first', 'held-out']
"""
