r"""Import of measured tables and finite element output, and export of input decks.

`read.import_files` recognises the format of a file and calls the reader of tables or of runs.
`record` defines the user's facts (`Given`), the collected errors and the result (`Imported`).

Tables: `read.read_columns` reads a table with any columns and units. `delimited` finds the header
of a text file and reads plain cells; `cells` reads other cells, with comments, notes and styles of
numbers. `binary_tables` reads Excel and Parquet. `mapping` matches headers with contract
columns by the vocabulary of `words` and `words.toml`, and `convert` converts to SI units. `layouts`
reads tables without a row for each load: merged cells, wide tables, and increments of load-stepped
runs.

Runs: `calculix`, `abaqus`, `listings` (FEBio and ANSYS), `node_table` and `meshes` read each format
into a `history.ContactHistory`. `runs` collects the facts that the files lack, and
`history.table_of` computes transition loads with `rim` and `transitions`.

Decks: `deck` reads the input deck of a run, and `deck_text` writes a scene as a deck.

The package depends on tables and scenes, not on models.

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
