"""Tabulate drives and the soil's checks."""

from pathlib import Path

from polarsim.report.rover_table import tabulate_rover
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_rover(
        drives=Path(snakemake.input.drives),
        each=Path(snakemake.input.each),
        soil=Path(snakemake.input.soil),
        measured=Path(snakemake.input.measured),
        checks=Path(snakemake.input.checks),
        stem=Path(snakemake.output.table).with_suffix(""),
        each_stem=Path(snakemake.output.each_table).with_suffix(""),
        soil_stem=Path(snakemake.output.soil_table).with_suffix(""),
        checks_stem=Path(snakemake.output.checks_table).with_suffix(""),
        origin=snakemake.params.origin,
    )
