"""Draw a photo with twin, difference, labels and detections."""

from pathlib import Path

from polarsim.job_files import optional_path
from polarsim.report.figures.strip import draw_strip
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    draw_strip(
        site=Site(**snakemake.params.site),
        photos=Path(snakemake.input.photos),
        twins=Path(snakemake.input.twins),
        labels=Path(snakemake.input.labels),
        predictions=optional_path(snakemake.input.predictions),
        model=snakemake.params.model,
        trained=snakemake.params.trained,
        strip=Path(snakemake.output.strip),
    )
