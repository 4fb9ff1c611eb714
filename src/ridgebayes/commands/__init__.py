"""Command line: one module for each command, the shared options and the run folder.

`options` and `table_options` declare the options of each command, `shared_options` those of several
commands, and `cli` lists the commands; these modules import nothing heavy. The function `command`
in the module of each command does the work and returns an `Answer`, which `terminal` prints.
`run_folder` writes a folder completely or not at all, and `run_files` lists the files of a run. The
package imports all other packages and none imports it.
"""

import time

BEGAN = time.perf_counter()  # start of the program; imports take about one second
