"""A run of the shipped yard from simulated raw data to rocks, with small photos: no file of polarsim changes."""

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.run_files.rigs import read_localised

pytestmark = pytest.mark.slow

OVERLAY = """
site: {base: yard, images: {width: 612, height: 512}}
terrains: [yard-a]
positions: [gate, north]
grid: {azimuths: ["45"], lights: ["off"], exposures_ms: [40]}
analog: {ground_step_mm: 10, rock_detail: 3}
"""


@pytest.fixture(scope="module")
def yard(tmp_path_factory, make_checkout, snakemake):
    folder = make_checkout(tmp_path_factory.mktemp("yard"))
    (folder / "small_yard.yaml").write_text(OVERLAY)
    rocks = "results/yard/rocks/Terrainyard-a/rocks.parquet"
    done = snakemake(folder, rocks, "--configfile", "config/yard.yaml", "small_yard.yaml")
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_photos_are_converted_to_the_photo_format(yard):
    raw = png.read_png(yard / "data/yard/yard-a/gate/sun-45_lamp-off/left_40.png")
    photos = pd.read_parquet(yard / "results/yard/acquire/Terrainyard-a/photos.parquet").set_index("key")
    converted = png.read_photo(yard / photos.loc["yard-a_gate_off_45_L_0040", "path"], (612, 512))
    assert raw.dtype == np.uint8
    assert len(photos) == 4
    np.testing.assert_allclose(converted, 16 + (raw.astype(float) - 2).clip(0) * (4095 - 16) / 253, atol=0.51)


def test_scans_and_three_walls_localise_the_rigs(yard):
    for position in ("gate", "north"):
        found, true = (
            read_localised(yard / folder / f"Pos{position}.json")
            for folder in ("results/yard/cameras/located/Terrainyard-a", "data/yard/truth/Terrainyard-a/cameras")
        )
        offset = found.sandbox_from_left.translation - true.sandbox_from_left.translation
        assert np.linalg.norm(offset) < 0.05  # of 0.1 m in the survey; walls are placed with errors of 1 cm
        turn = found.sandbox_from_left.rotation.T @ true.sandbox_from_left.rotation
        assert np.degrees(np.arccos((np.trace(turn) - 1) / 2)) < 0.5


def test_most_rocks_of_8_cm_are_found(yard):
    found, true = (
        pd.read_parquet(yard / path)
        for path in ("results/yard/rocks/Terrainyard-a/rocks.parquet", "data/yard/truth/Terrainyard-a/rocks.parquet")
    )
    large = true[true["size_m"] > 0.08][["x", "y"]].to_numpy()
    distance = np.linalg.norm(large[:, None] - found[["x", "y"]].to_numpy(), axis=2).min(axis=1)
    assert (distance < 0.06).mean() > 0.7
