r"""Output of other finite element programs to contact tables, and scenes to their input decks.

A run is a contact history (`history`), and one module a format makes it: `calculix`, `abaqus_dat`,
`abaqus_rpt`, `febio`, `ansys`, `mesh_series` (over `mesh_files`). `history.table_of` makes loads of
any, by `rim` and `transitions`. `columns` reads tables: cells (`delimited`, `spreadsheet`,
`parquet`), their header (`layout`), its meaning (`mapping`, by `words` of `words.toml`), numbers in
SI units (`quantities`) and what follows (`interpret`). `read` recognises a file and calls them;
`deck_text` writes decks. The room knows tables and scenes, and nothing of models. A file becomes a
table, with messages about it:

>>> from pathlib import Path
>>> from tempfile import TemporaryDirectory
>>> from ridgebayes.fea.given import Given
>>> from ridgebayes.fea.read import import_files
>>> text = "Ridge width [um],Groove width [um],Q,P [N/mm]\n240,80,4,1e-3\n240,80,6,4e-3\n"
>>> with TemporaryDirectory() as folder:
...     path = Path(folder, "mine.csv")
...     _ = path.write_text(text)
...     columns = ("a=Ridge width", "b=Groove width", "line=P")
...     found = import_files([path], Given(map=columns, R="8 mm", E="60 kPa"))
>>> found.table.column("p_over_E").round(9).tolist()
[0.001041667, 0.004166667]
>>> found.messages[-1]
'kept: 2 rows, Q = 4 to 6, 0 as brackets'
"""
