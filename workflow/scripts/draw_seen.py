"""Draw what a judge sees in photo and twins."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.tables.of_run import draw_seen_of_run
from polarsim.tables.options import TablesOptions

with reporting(log=snakemake.log[0]):
    domains = snakemake.params.domains
    draw_seen_of_run(
        trained=snakemake.wildcards.trained,
        run=Path("results") / snakemake.wildcards.run,
        photo_domain=snakemake.params.photo_domain,
        instances=Path(snakemake.input.instances),
        ipd=Path(snakemake.input.ipd),
        predictions=dict(zip(domains, map(Path, snakemake.input.predictions), strict=True)),
        labels=dict(zip(domains, map(Path, snakemake.input.labels), strict=True)),
        figure=Path(snakemake.output.figure),
        origin=snakemake.params.origin,
        options=TablesOptions(**snakemake.params.options),
    )
