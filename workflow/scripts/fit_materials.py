"""Fit the materials of a terrain to photos."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.photo import parse_terrain
from polarsim.render.fitting.fit import fit_materials
from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    fit_materials(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        photos=optional_path(snakemake.input.photos),
        light=Path(snakemake.input.light),
        domains=snakemake.params.domains,
        materials=Path(snakemake.output.materials),
        options=RenderOptions(**snakemake.params.options),
        threads=snakemake.threads,
    )
