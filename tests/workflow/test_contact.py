"""Contact sheets of the rule draw_photos with photos of the analog, without twins as substitutes."""

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.formats.tables import label_table, write_parquet
from polarsim.grid import GridOptions, selected_grid
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.site import polar
from tests.support.polar_photos import HEIGHT, WIDTH
from tests.workflow.conftest import SMALL
from tests.workflow.figures import find_picture, resized

SHEET = "results/small/figures/contact_Terrain01_PosA.png"


@pytest.mark.slow
def test_a_contact_sheet_ignores_images_in_the_working_folder(checkout, snakemake, rng):
    keys = selected_grid(polar(), 1, ["A"], GridOptions(**SMALL["grid"]))
    for key in keys:
        coarse = rng.uniform(200, 4000, (12, 19)).astype(np.float32)
        png.write_png(checkout / f"data/{key}.png", resized(coarse, WIDTH)[:HEIGHT].astype(np.uint16))
    acquired = checkout / "results/small/acquire/Terrain01/photos.parquet"
    write_parquet(acquired, pd.DataFrame([{"key": str(key), "path": f"data/{key}.png"} for key in keys]))
    write_inventory(acquired.with_name("inventory.json"), Inventory(1, "analog"))
    for stage in ("labels", "renders"):
        write_parquet(checkout / f"results/small/{stage}/tables/Terrain01.parquet", label_table([]))
    (checkout / "results/small/renders/hapke/Terrain01").mkdir(parents=True)
    call = (SHEET, "--configfile", "config/small.yaml", "--rerun-triggers", "mtime", "--allowed-rules", "draw_photos")
    png.write_png(
        checkout / "03_A_on_350_R_0256_hapke.png", np.zeros((8, 8), np.uint8)
    )  # name of an output of `polarsim show`
    png.write_png(checkout / f"{keys[0]}.png", np.zeros((HEIGHT, WIDTH), np.uint16))  # same name as a photo
    done = snakemake(checkout, *call)
    assert done.returncode == 0, done.stderr[-3000:]
    usual = [key for key in keys if key.exposure_ms == 256]  # without labels, this exposure represents the bracket
    assert len(usual) == 4
    tiles = [find_picture(checkout / SHEET, checkout / f"data/{key}.png") for key in usual]
    assert min(correlation for correlation, _ in tiles) > 0.95
    centres = np.array([position for _, position in tiles])
    assert np.linalg.norm(centres[:, None] - centres, axis=-1)[~np.eye(4, dtype=bool)].min() > 0.3  # separate tiles
