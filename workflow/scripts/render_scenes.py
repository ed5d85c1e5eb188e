"""Render scenes that are strewn with the rocks of one terrain."""

from polarsim.covers.render_scenes import render_scenes
from polarsim.job import job

with job(snakemake) as call:
    call(render_scenes)
