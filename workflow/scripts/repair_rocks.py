"""Close the published rock meshes of a terrain and list their defects."""

from pathlib import Path

from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.repair import repair_rocks
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    repair_rocks(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        inventory=Path(snakemake.input.inventory),
        cameras=Path(snakemake.input.cameras),
        meshes=Path(snakemake.input.meshes),
        copies=Path(snakemake.output.copies),
        options=RocksOptions(**snakemake.params.options),
    )
