"""Execution of work: files, workers, progress and random streams.

`atomic` writes files atomically and has locks; `reading` reads untrusted files, and imports
optional packages; `quiet` imports ArviZ without its announcement; `journal` keeps finished parts;
`pool` has workers and ordered results, `cluster` executors on Dask; `progress` times stages, and
`memory` measures peak memory; `randomness` has named streams of one seed; `text` formats messages
and `templates` whole pages. The package imports `errors` and nothing of contact or statistics.

>>> from ridgebayes.runtime.pool import executor_for, map_ordered
>>> from ridgebayes.runtime.randomness import stream
>>> with executor_for(1) as executor:
...     list(map_ordered(abs, [-2, -1], executor))
[2, 1]
>>> bool(stream(1, "hybrid").random() == stream(1, "hybrid").random())
True
"""
