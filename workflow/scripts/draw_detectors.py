"""Draw what the detectors of a run found."""

from pathlib import Path

from polarsim.report.figures.detectors import draw_detectors
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_detectors(
        found={name: Path(path) for name, path in snakemake.input.items()},
        figures={name: Path(path) for name, path in snakemake.output.items()},
        origin=snakemake.params.origin,
    )
