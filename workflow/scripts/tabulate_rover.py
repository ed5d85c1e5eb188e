"""Tabulate drives and the soil's check."""

from pathlib import Path

from polarsim.report.rover_table import tabulate_rover
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_rover(
        drives=Path(snakemake.input.drives),
        each=Path(snakemake.input.each),
        soil=Path(snakemake.input.soil),
        stem=Path(snakemake.output.drives).with_suffix(""),
        each_stem=Path(snakemake.output.each).with_suffix(""),
        soil_stem=Path(snakemake.output.soil).with_suffix(""),
        origin=snakemake.params.origin,
    )
