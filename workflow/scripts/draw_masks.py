"""Draw polygons, grey maps and COCO masks of one terrain's photos."""

from polarsim.grid import selected_grid
from polarsim.job import job
from polarsim.labels.masks import draw_masks

with job(snakemake) as call:
    call(draw_masks, keys=call(selected_grid))
