"""Hold the soil against its limit, measured wheels and what others published."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.soil.published import check_soil

with reporting(log=snakemake.log[0]):
    check_soil(
        soils=Path(snakemake.input.soils),
        limit=Path(snakemake.output.limit),
        measured_slopes=Path(snakemake.output.measured_slopes),
        checks=Path(snakemake.output.checks),
    )
