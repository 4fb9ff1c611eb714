r"""Output of other finite element programs to contact tables, and scenes to their input decks.

A table passes `columns`: its text becomes records and a header (`delimited`), then cells and
numbers (`cells`, and `spreadsheet` before it), or columns are read as they are (`parquet`).
`mapping` finds what each column is by `words` of `words.toml`, `missing` proposes what no word
tells, `wide` makes a row for each load, `convert` computes in SI units, and `increments` finds
transitions in runs.

A run is a contact history (`history`), and one module a format makes it: `calculix`, `abaqus_dat`,
`abaqus_rpt`, `febio`, `ansys`, `mesh_series` (over `mesh_files`). `runs` asks for the facts that
files lack, and `history.table_of` makes loads of any, by `rim` and `transitions`.

`read` recognises a file and calls these; `record` holds what the user says and what an import
returns; `deck_text` writes decks. The room knows tables and scenes, and nothing of models. A file
becomes a table, with messages about it:

>>> from pathlib import Path
>>> from tempfile import TemporaryDirectory
>>> from ridgebayes.fea.record import Given
>>> from ridgebayes.fea.read import import_files
>>> text = "Ridge width [um],Groove width [um],Q,P [N/mm]\n240,80,4,1e-3\n240,80,6,4e-3\n"
>>> with TemporaryDirectory() as folder:
...     path = Path(folder, "mine.csv")
...     _ = path.write_text(text)
...     columns = ("a=Ridge width", "b=Groove width", "line=P")
...     read = import_files([path], Given(map=columns, R="8 mm", E="60 kPa"))
>>> read.table.column("p_over_E").round(9).tolist()
[0.001041667, 0.004166667]
>>> read.messages[-1]
'kept: 2 rows, Q = 4 to 6, 0 as brackets'
"""
