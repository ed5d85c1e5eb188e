"""Draw how far one terrain's projected meshes lie from the boxes that people drew."""

from pathlib import Path

from polarsim.report.figures.residuals import draw_residuals_of_run
from polarsim.reporting import reporting
from polarsim.scoring.match_rule import MatchRule
from polarsim.scoring.options import TablesOptions

with reporting(log=snakemake.log[0]):
    draw_residuals_of_run(
        terrain=int(snakemake.wildcards.terrain),
        run=Path("results") / snakemake.wildcards.run,
        rule=MatchRule(**snakemake.params.rule),
        figure=Path(snakemake.output.figure),
        options=TablesOptions(**snakemake.params.options),
    )
