"""Draw the errors of all terrains' labels, and their confidence against the share of them that are right."""

from pathlib import Path

from polarsim.job_files import paths
from polarsim.report.figures.labels import draw_label_scores
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    draw_label_scores(
        terrains=[int(terrain) for terrain in snakemake.params.terrains],
        pairs=paths(snakemake.input.pairs),
        reliability=Path(snakemake.input.reliability),
        label_errors=paths(snakemake.output.label_errors),
        reliability_figure=Path(snakemake.output.reliability_figure),
        origin=snakemake.params.origin,
    )
