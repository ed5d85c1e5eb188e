"""Publish a run in a format."""

from pathlib import Path

from polarsim.publish.options import PublishOptions
from polarsim.publish.run import publish_run
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    publish_run(
        form=snakemake.wildcards.form,
        receipt=Path(snakemake.output.receipt),
        options=PublishOptions(**snakemake.params.options),
        split=snakemake.params.split,
    )
