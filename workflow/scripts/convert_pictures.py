"""Convert the pictures and labels of one domain."""

from polarsim.detect.pictures import convert_domain
from polarsim.grid import selected_grids
from polarsim.job import job

with job(snakemake) as call:
    call(
        convert_domain,
        pictures=snakemake.params.pictures,
        keys=call(selected_grids),
        folder=snakemake.output.pictures,
    )
