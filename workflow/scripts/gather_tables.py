"""Put tables of all splits and seeds together: an output of the name of every input."""

from polarsim.detect.gather import gather_tables
from polarsim.job import job

with job(snakemake) as call:
    for name, table in snakemake.output.items():
        call(gather_tables, parts=snakemake.input.get(name), table=table)
