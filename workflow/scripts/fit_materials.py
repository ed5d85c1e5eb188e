"""Fit the materials of one terrain to its photos."""

from polarsim.job import job
from polarsim.render.fitting.fit import fit_materials

with job(snakemake) as call:
    call(fit_materials)
