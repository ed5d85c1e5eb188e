"""Read cover photos, assign photo keys and remove annotations."""

from pathlib import Path

from polarsim.cover_photos.photos import read_covers
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    read_covers(
        root=Path(snakemake.params.root),
        terrains=snakemake.params.terrains,
        keys=snakemake.params.known,
        size=Site(**snakemake.params.site).images.size,
        usual_exposure_ms=Site(**snakemake.params.site).usual_exposure_ms,
        pictures=Path(snakemake.output.pictures),
        drawn=Path(snakemake.output.drawn),
        labels=Path(snakemake.output.labels),
        pairing=Path(snakemake.output.pairing),
    )
