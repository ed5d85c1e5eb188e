"""The `polarsim` command, one module per panel of `--help`.

Heavy modules are imported inside the commands that need them, so that `--help` is fast.
"""

from polarsim.cli import runs, sites, labels, rocks, rendering, detectors, rover, sharing  # isort: skip  # this order
from polarsim.cli.application import app, main

__all__ = ["app", "detectors", "labels", "main", "rendering", "rocks", "rover", "runs", "sharing", "sites"]
