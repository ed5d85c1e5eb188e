"""Render the twins of one terrain's test photos with one component replaced."""

from polarsim.detect.split import tested_keys
from polarsim.grid import selected_grid
from polarsim.job import job
from polarsim.render.twins import LabelPaths, render_twins

with job(snakemake) as call:
    call(
        render_twins,
        keys=call(selected_grid),
        only=call(tested_keys),
        twins={snakemake.params.model: snakemake.output.twins},
        labels=call(LabelPaths),
    )
