"""The `polarsim` command, a module for each panel of its help.

Heavy modules are imported by the commands that need them, so that --help is quick.
"""

from polarsim.cli import runs, labels, rendering, detectors, rover, sharing  # isort: skip  # panels in this order
from polarsim.cli.application import app, main

__all__ = ["app", "detectors", "labels", "main", "rendering", "rover", "runs", "sharing"]
