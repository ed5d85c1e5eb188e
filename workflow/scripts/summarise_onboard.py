"""Sum up what is seen on board of all drives."""

from pathlib import Path

from polarsim.reporting import reporting
from polarsim.rover.cameras.options import OnboardOptions
from polarsim.rover.onboard.table import summarise_onboard

with reporting(log=snakemake.log[0]):
    summarise_onboard(
        [Path(table).parent.parent for table in snakemake.input.tables],
        Path(snakemake.output.onboard),
        OnboardOptions(**snakemake.params.options),
    )
