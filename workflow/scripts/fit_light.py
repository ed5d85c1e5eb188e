"""Fit the light fields of the Sun lamps to the photos of all terrains."""

from polarsim.job_files import list_of_paths
from polarsim.render.fitting.light import fit_light
from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    fit_light(
        site=Site(**snakemake.params.site),
        cameras=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.cameras), strict=True)),
        meshes=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.input.meshes), strict=True)),
        photos=list_of_paths(snakemake.input.photos),
        domains=snakemake.params.domains,
        light=dict(zip(snakemake.params.terrains, list_of_paths(snakemake.output.light), strict=True)),
        options=RenderOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
