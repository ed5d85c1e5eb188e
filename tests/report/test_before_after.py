"""Figure of photos with twins before and after fits."""

import numpy as np
import pytest

from polarsim.formats import png
from polarsim.formats.tables import write_parquet
from polarsim.photo import BLACK_LEVEL, PhotoKey
from polarsim.report.figures.before_after import draw_before_after, photos_of_terrains
from polarsim.run_files.fitted_photos import FittedPhotos
from polarsim.scoring.twin_photos import ComparedPhoto, compare_twins
from tests.support.polar_photos import HEIGHT, WIDTH

KEY = PhotoKey.parse("03_A_off_30_L_0256")


@pytest.fixture
def drawn_figure(tmp_path):
    """Draw a photo whose twin before is unrelated and whose twin after equals the photo."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    light = 800 + 600 * np.sin(x / 61) * np.cos(y / 83)
    folders = {name: tmp_path / name / "Terrain03" for name in ("photos", "principled", "fitted")}
    for name, image in (("photos", light), ("principled", light.T[:HEIGHT, :1].repeat(WIDTH, 1)), ("fitted", light)):
        png.write_png(folders[name] / f"{KEY}.png", (BLACK_LEVEL + image).astype(np.uint16))
    paths = {name: {KEY: folder / f"{KEY}.png"} for name, folder in folders.items()}
    photo = {KEY: ComparedPhoto(paths.pop("photos")[KEY])}
    pairs = compare_twins(photo, paths, {}, {"fitted": [FittedPhotos(frozenset({"180"}), frozenset({"A"}))]})
    write_parquet(tmp_path / "pairs.parquet", pairs)
    figure = tmp_path / "figure.png"
    draw_before_after(
        usual_exposure_ms=256,
        pairs=[tmp_path / "pairs.parquet"], photos=[folders["photos"]], drawn=None, before=[folders["principled"]],
        after=[folders["fitted"]], before_title="principled", after_model="fitted", figure=figure, width=1600,
    )  # fmt: skip
    return png.read_png(figure)[..., :3].astype(int)


def test_the_columns_are_photo_before_after_and_the_difference_of_the_latter(drawn_figure):
    row = drawn_figure[135:-105]  # between titles and bar
    photo, before, after, difference = (row[:, start + 20 : start + 380].mean(axis=-1) for start in range(0, 1600, 400))
    assert photo.std() > 20
    assert np.corrcoef(photo[:80].ravel(), after[:80].ravel())[0, 1] > 0.7  # columns differ by some pixels
    assert before[:80].std() < 1  # the tone curve of an unrelated twin is level
    assert (difference[:80] > 240).mean() > 0.9  # the middle of the colours is light grey


def test_shown_photos_are_spread_over_terrains_without_rover_light():
    names = [
        f"{t:02d}_{p}_{light}_{azimuth}_L_{ms}"
        for t in range(1, 7) for p in "AC" for light in ("off", "on") for azimuth in ("30", "no")
        for ms in ("0032", "0256")
    ]  # fmt: skip
    shown = photos_of_terrains(map(PhotoKey.parse, names[::-1]), 256)
    assert {key.terrain for key in shown} == set(range(1, 7))
    assert {(key.light, key.azimuth, key.exposure_ms) for key in shown} == {("off", "30", 256)}
    assert len(photos_of_terrains(map(PhotoKey.parse, names), 256, 3)) == 3
    assert photos_of_terrains([], 256) == []
