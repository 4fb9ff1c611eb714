"""The command line: one module a command, their shared options, and the run folder.

`options` and `table_options` declare what each command may be told, `shared_options` what several
may, and `cli` lists them; they load nothing heavy. `command` in the module of a command's name does
the work and returns an `Answer`, which `terminal` shows. `run_folder` writes a folder whole or not
at all, `run_files` says which files a run has. The room knows every other one, and none knows it.
"""

import time

BEGAN = time.perf_counter()  # the program, of which imports are the first second
