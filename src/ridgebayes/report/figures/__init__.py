"""From records to calls of `drawing`, whose figures know none.

`gallery` lists the figures of a report by name, each drawn once, by workers or when it is asked
for. `bodies` draws solutions of contact, which the report does not show.

Examples
--------
>>> import ridgebayes as rb
>>> from ridgebayes.checks.report_data import report_data
>>> from ridgebayes.report.figures.gallery import Gallery
>>> data = report_data(rb.compare(rb.paper_sweep(), [rb.Modified()], noise="iid", rng=1))
>>> sorted(Gallery(data))[:3]
['bands', 'bands-first', 'corner-modified']
"""
