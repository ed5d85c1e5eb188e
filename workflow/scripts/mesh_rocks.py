"""Mesh one terrain's rocks and ground."""

from polarsim.job import job
from polarsim.rocks.mesh import mesh_rocks

with job(snakemake) as call:
    call(mesh_rocks)
