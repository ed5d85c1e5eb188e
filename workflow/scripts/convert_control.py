"""Write the twins with invented relief as images with labels."""

from pathlib import Path

from polarsim.cover_photos.twins import convert_control
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    convert_control(
        photos=Path(snakemake.input.photos),
        twins=Path(snakemake.input.twins[0]).parent,
        rendered=Path(snakemake.input.rendered),
        pictures=Path(snakemake.output.pictures),
        labels=Path(snakemake.output.labels),
    )
