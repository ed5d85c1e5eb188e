"""Hold the soil against its limit and against measured wheels."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.soil.check import check_soil

with reporting(log=snakemake.log[0]):
    check_soil(
        soils=Path(snakemake.input.soils),
        limit=Path(snakemake.output.limit),
        measured_slopes=Path(snakemake.output.measured),
    )
