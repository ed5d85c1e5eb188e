"""Put the tables of all splits and seeds together."""

from pathlib import Path

from polarsim.detect.gather import gather_tables
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    gather_tables(
        parts=[Path(path) for path in snakemake.input.parts],
        splits=snakemake.params.splits,
        seeds=snakemake.params.seeds,
        table=Path(snakemake.output.table),
    )
