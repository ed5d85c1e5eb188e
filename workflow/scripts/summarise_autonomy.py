"""Summarise autonomous drives and the effects of light and detector, and write their tables."""

from pathlib import Path

from polarsim.job_files import list_of_paths
from polarsim.report.autonomy_table import tabulate_autonomy
from polarsim.reporting import reporting
from polarsim.rover.planning.summary import summarise_autonomy

together, effects = Path(snakemake.output.together), Path(snakemake.output.effects)
with reporting(log=snakemake.log[0]):
    summarise_autonomy(
        drives=list_of_paths(snakemake.input.drives),
        each=Path(snakemake.output.each),
        together=together,
        effects=effects,
    )
    tabulate_autonomy(
        together=together,
        effects=effects,
        stem=Path(snakemake.output.table).with_suffix(""),
        effects_stem=Path(snakemake.output.effects_table).with_suffix(""),
        origin=snakemake.params.origin,
    )
