"""Sum up drives one by one and together."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.drive.table import summarise_drives

with reporting(log=snakemake.log[0]):
    summarise_drives(
        [Path(drive).parent for drive in snakemake.input.drives],
        each=Path(snakemake.output.each),
        together=Path(snakemake.output.together),
    )
