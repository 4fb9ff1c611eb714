"""Output of other programs to contact tables: one module a file format."""
