"""The contact table: its columns, their rules, its files, and the tables of the package.

`columns` has the contract, `rules` finds every cell that breaks it, `files` reads and writes, and
`table` has the record that everything else works on, `ContactTable`. `datafiles` finds the embedded
data. The room knows `errors` and `runtime`.

>>> import pandas as pd
>>> from ridgebayes.table.table import read_table
>>> rows = {"a_over_R": 0.032, "b_over_R": 0.01, "Q": [4, 6], "p_over_E": [0.00098, 0.0038]}
>>> table = read_table(pd.DataFrame(rows))
>>> table
ContactTable(table: 2 rows, 1 texture)
>>> table.column("nu").tolist(), table.labels
([0.5, 0.5], ('a0.032_b0.01',))
"""
