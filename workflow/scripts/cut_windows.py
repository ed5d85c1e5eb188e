"""Cut windows from labelled cover photos."""

from pathlib import Path

from polarsim.cover_photos.windows import cut_windows
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    cut_windows(
        photos=Path(snakemake.input.photos),
        labels=Path(snakemake.input.labels),
        windows=Path(snakemake.output.windows),
        size=Site(**snakemake.params.site).images.size,
        count=snakemake.params.windows,
        stored_px=snakemake.params.stored_px,
        seed=snakemake.params.seed,
    )
