"""Write the results section of a run."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.results_section import write_results_section

with reporting(log=snakemake.log[0]):
    write_results_section(
        tables=Path(snakemake.input.tables[0]).parent,
        stereo_ipd=Path(snakemake.input.stereo_ipd[0]) if snakemake.input.stereo_ipd else None,
        datasets=dict(zip(snakemake.params.datasets, map(Path, snakemake.input.datasets), strict=True)),
        pictures={Path(folder).name: Path(folder) for folder in snakemake.input.pictures},
        figures=dict(zip(snakemake.params.figures, map(Path, snakemake.input.figures), strict=True)),
        phases=Path(snakemake.input.phases),
        ledger=Path(snakemake.input.ledger[0]) if snakemake.input.ledger else None,
        page=Path(snakemake.output.page),
        rules=snakemake.params.rules,
        origin=snakemake.params.origin,
    )
