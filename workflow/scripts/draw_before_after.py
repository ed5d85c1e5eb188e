"""Draw photos with twins before and after what was fitted to photos."""

from pathlib import Path

from polarsim.job_files import list_of_paths, optional_path
from polarsim.report.figures.before_after import draw_before_after
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    draw_before_after(
        usual_exposure_ms=Site(**snakemake.params.site).usual_exposure_ms,
        pairs=list_of_paths(snakemake.input.appearance),
        photos=list_of_paths(snakemake.input.photos),
        drawn=optional_path(snakemake.input.drawn),
        before=list_of_paths(snakemake.input.before),
        after=list_of_paths(snakemake.input.after),
        before_title=snakemake.params.before_title,
        after_model=snakemake.params.after_model,
        figure=Path(snakemake.output.figure),
    )
