"""Write the results page of a run."""

from pathlib import Path

from polarsim.job_files import list_of_paths, optional_path
from polarsim.report.results_page import write_results_page
from polarsim.reporting import reporting
from polarsim.site import Site

with reporting(log=snakemake.log[0]):
    write_results_page(
        tables={path.stem: path for path in list_of_paths(snakemake.input.tables)},
        figures={path.stem: path for path in list_of_paths(snakemake.input.figures)},
        strip=optional_path(snakemake.input.strip),
        phases=list_of_paths(snakemake.input.phases),
        datasets=dict(zip(snakemake.params.datasets, list_of_paths(snakemake.input.datasets), strict=True)),
        photos=optional_path(snakemake.input.photos),
        origin=snakemake.params.origin,
        site=Site(**snakemake.params.site).name,
        terrains=snakemake.params.terrains,
        positions=snakemake.params.positions,
        models=snakemake.params.models,
        photo_domain=snakemake.params.photo_domain,
        others=snakemake.params.others,
        page=Path(snakemake.output.page),
    )
