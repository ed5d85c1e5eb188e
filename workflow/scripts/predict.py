"""Predict with a detector on the test images of every domain."""

from pathlib import Path

from polarsim.detect.options import PredictionOptions
from polarsim.detect.predict import predict_domains
from polarsim.job_files import list_of_paths
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    predict_domains(
        weights=Path(snakemake.input.weights),
        datasets=list_of_paths(snakemake.input.datasets),
        predictions=list_of_paths(snakemake.output.predictions),
        site=Site(**snakemake.params.site),
        options=PredictionOptions(**snakemake.params.options),
        threads=snakemake.threads,
        cameras=list_of_paths(snakemake.input.cameras),
        meshes=list_of_paths(snakemake.input.meshes),
    )
