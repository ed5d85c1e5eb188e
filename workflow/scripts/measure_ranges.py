"""Measure range maps of a terrain in stereo photos."""

from pathlib import Path

from polarsim.cameras.range_maps import measure_ranges
from polarsim.photo import parse_terrain
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    measure_ranges(
        site=Site(**snakemake.params.site),
        terrain=parse_terrain(snakemake.wildcards.terrain),
        photos=Path(snakemake.input.photos),
        calibration=Path(snakemake.input.calibration),
        inventory=Path(snakemake.input.inventory),
        corrected=Path(snakemake.output.calibration),
        measured=Path(snakemake.output.inventory),
        maps=Path(snakemake.output.maps),
    )
