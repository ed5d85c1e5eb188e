"""Draw what one detector finds in photo and twins."""

from pathlib import Path

from polarsim.report.of_run import draw_finds_of_run
from polarsim.reporting import reporting
from polarsim.scoring.options import TablesOptions

with reporting(log=snakemake.log[0]):
    domains = snakemake.params.domains
    draw_finds_of_run(
        trained=snakemake.wildcards.trained,
        run=Path("results") / snakemake.wildcards.run,
        photo_domain=snakemake.params.photo_domain,
        instances=Path(snakemake.input.instances),
        ipd=Path(snakemake.input.ipd),
        predictions=dict(zip(domains, map(Path, snakemake.input.predictions), strict=True)),
        labels=dict(zip(domains, map(Path, snakemake.input.labels), strict=True)),
        seen=Path(snakemake.output.seen),
        gap_rocks=Path(snakemake.output.gap_rocks),
        origin=snakemake.params.origin,
        options=TablesOptions(**snakemake.params.options),
    )
