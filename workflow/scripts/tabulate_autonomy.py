"""Tabulate autonomous drives and the effects of light and detector."""

from pathlib import Path

from polarsim.report.autonomy_table import tabulate_autonomy
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    tabulate_autonomy(
        together=Path(snakemake.input.together),
        effects=Path(snakemake.input.effects),
        stem=Path(snakemake.output.table).with_suffix(""),
        effects_stem=Path(snakemake.output.effects_table).with_suffix(""),
        origin=snakemake.params.origin,
    )
