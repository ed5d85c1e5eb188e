"""Write the reflectance of every model over the phase angle."""

from pathlib import Path

from polarsim.render.goniometer import write_reflectance
from polarsim.render.options import RenderOptions
from polarsim.reporting import reporting

with reporting(log=snakemake.log[0]):
    write_reflectance(
        curves=Path(snakemake.output.curves),
        options=RenderOptions(**snakemake.params.options),
    )
