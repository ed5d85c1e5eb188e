"""File formats that other programs define, one module a format, its reader beside its writer.

`files` and `readers` are what all readers and writers share: atomic writing, paths, encodings, errors in one line.
Files that only polarsim defines are in `polarsim.run_files`.
"""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(__name__, read_parquet="tables")
