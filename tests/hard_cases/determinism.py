"""Hard cases of repeating: the same numbers from other runs, processes and Pythons."""
