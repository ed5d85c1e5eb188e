"""Read cover photos, assign photo keys and remove annotations."""

from pathlib import Path

from polarsim.cover_photos.photos import read_covers
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    read_covers(
        root=Path(snakemake.params.root),
        terrains=snakemake.params.terrains,
        keys=snakemake.params.known,
        pictures=Path(snakemake.output.pictures),
        drawn=Path(snakemake.output.drawn),
        labels=Path(snakemake.output.labels),
        pairing=Path(snakemake.output.pairing),
    )
