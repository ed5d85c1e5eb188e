"""File formats that other programs define: a module per format, with reader and writer.

All readers and writers share `files` (atomic writing, paths, encodings) and `readers`: an invalid or missing file
raises `FormatError` (`ConfigError` for YAML), a single line with the file. Files that only polarsim defines are in
`polarsim.run_files`.
"""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(__name__, read_parquet="tables", stated_rig="calibrations")
