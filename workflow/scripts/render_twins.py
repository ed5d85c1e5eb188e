"""Render the twins of one terrain under every reflectance model, and label them."""

from polarsim.grid import selected_grid
from polarsim.job import job
from polarsim.render.twins import LabelPaths, render_twins

with job(snakemake) as call:
    call(
        render_twins,
        keys=call(selected_grid),
        twins={model: snakemake.output[model] for model in snakemake.params.models},
        labels=call(LabelPaths),
    )
