"""Compare the detectors of cover photos and of their twins on both."""

from pathlib import Path

from polarsim.cover_photos.domains import compare_domains
from polarsim.detect.options import ComparisonOptions, TrainingOptions
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    compare_domains(
        predictions=list_of_paths(snakemake.input.predictions),
        labels=dict(zip(snakemake.params.domains, list_of_paths(snakemake.input.labels), strict=True)),
        datasets=list_of_paths(snakemake.input.datasets),
        photo_domain=snakemake.params.photo_domain,
        tables_of={name: Path(table) for name, table in snakemake.output.items() if name != "photos"},
        photos=Path(snakemake.output.photos),
        size=Site(**snakemake.params.site).images.size,
        options=ComparisonOptions(**snakemake.params.options),
        training=TrainingOptions(**snakemake.params.training),
        start=snakemake.params.start,
        imgsz=snakemake.params.imgsz,
    )
