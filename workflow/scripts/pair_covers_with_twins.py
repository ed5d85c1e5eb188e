"""Write cover photos and their twins as images with labels."""

from pathlib import Path

from polarsim.cover_photos.twins import pair_covers_with_twins
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    pair_covers_with_twins(
        photos=Path(snakemake.input.photos),
        annotated=Path(snakemake.input.annotated),
        propagated=Path(snakemake.input.propagated),
        twins={model: Path(folder) for model, folder in snakemake.params.twins.items()},
        rendered=Path(snakemake.input.rendered),
        photo_domain=snakemake.params.photo_domain,
        pictures=dict(zip(snakemake.params.domains, list_of_paths(snakemake.output.pictures), strict=True)),
        labels=dict(zip(snakemake.params.domains, list_of_paths(snakemake.output.labels), strict=True)),
    )
