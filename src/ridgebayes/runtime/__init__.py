"""How work is executed, whatever it is about: files, workers, progress and random streams.

`atomic` has files that appear whole or not at all, and locks; `reading` reads what others made,
with packages that may be missing; `quiet` imports arviz without its announcement; `journal` keeps
finished parts; `pool` has workers and ordered results, `cluster` those of Dask; `progress` times
stages, `memory` watches how much is used; `randomness` has named streams of one seed; `text` words
for messages, `templates` whole pages. The room knows `errors` and nothing of contact or statistics.

>>> from ridgebayes.runtime.pool import executor_for, map_ordered
>>> from ridgebayes.runtime.randomness import stream
>>> with executor_for(1) as executor:
...     list(map_ordered(abs, [-2, -1], executor))
[2, 1]
>>> bool(stream(1, "hybrid").random() == stream(1, "hybrid").random())
True
"""
