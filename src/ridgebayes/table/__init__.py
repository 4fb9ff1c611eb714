"""Contact tables: columns, validation and files, and the tables shipped with the package.

`columns` defines the columns, `rules` finds all cells that violate a rule, `files` reads and writes
tables, and `table` defines `ContactTable`, on which the rest of the package works. `datafiles`
finds the embedded data. The package imports only `errors` and `runtime`.

>>> import pandas as pd
>>> from ridgebayes.table.table import read_table
>>> rows = {"a_over_R": 0.032, "b_over_R": 0.01, "Q": [4, 6], "p_over_E": [0.00098, 0.0038]}
>>> table = read_table(pd.DataFrame(rows))
>>> table
ContactTable(table: 2 rows, 1 texture)
>>> table.column("nu").tolist(), table.labels
([0.5, 0.5], ('a0.032_b0.01',))
"""
