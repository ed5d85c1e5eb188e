"""Score one terrain's labels."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.options import TablesOptions
from polarsim.tables.quality_labels import score_labels

with reporting(log=snakemake.log[0]):
    score_labels(
        terrain=int(snakemake.wildcards.terrain),
        labels=Path(snakemake.input.boxes),
        truth=Path(snakemake.params.truth),
        seeds=Path(snakemake.input.seeds),
        quality=Path(snakemake.output.quality),
        options=TablesOptions(**snakemake.params.options),
    )
