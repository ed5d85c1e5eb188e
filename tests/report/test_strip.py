"""Strip of images of one photo on the results page."""

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.formats.files import read_json
from polarsim.formats.tables import label_table, write_parquet
from polarsim.photo import PhotoKey
from polarsim.report.figures.strip import PANEL_WIDTH, draw_strip, shown_key
from polarsim.site import polar
from tests.support.label_rows import label_row

BOX = {"x0": 500.0, "y0": 400.0, "x1": 900.0, "y1": 700.0}
DARK, SHOWN, TESTED = (PhotoKey.parse(f"03_A_off_30_L_{ms}") for ms in ("2048", "0256", "0128"))


@pytest.fixture
def strip(tmp_path):
    """Return a function that writes a strip and returns photo key, captions by panel, and folder."""

    def make(photos, tested=None):
        for key in (DARK, SHOWN, TESTED):
            png.write_png(tmp_path / f"twins/{key}.png", np.full((1216, 1936), 1000, np.uint16))
            png.write_png(tmp_path / f"photos/{key}.png", np.full((1216, 1936), 508, np.uint16))
        rows = [{"key": str(key), "path": str(tmp_path / f"photos/{key}.png")} for key in photos]
        write_parquet(tmp_path / "photos.parquet", pd.DataFrame(rows, columns=["key", "path"]).astype("str"))
        write_parquet(tmp_path / "labels.parquet", label_table([label_row(SHOWN, box=BOX.values())]))
        predicted = [{"key": str(key), "kind": "rock", "confidence": 0.9} | BOX for key in tested or ()]
        predicted += [{**row, "confidence": 0.1, "x1": 1800.0} for row in predicted]
        if tested:
            write_parquet(tmp_path / "predictions.parquet", pd.DataFrame(predicted))
        draw_strip(
            site=polar(),
            photos=tmp_path / "photos.parquet", twins=tmp_path / "twins", labels=tmp_path / "labels.parquet",
            predictions=tmp_path / "predictions.parquet" if tested else None, model="hapke", trained="analog",
            strip=tmp_path / "strip",
        )  # fmt: skip
        captions = read_json(tmp_path / "strip/strip.json")
        return captions["key"], dict(captions["panels"]), tmp_path / "strip"

    return make


def test_a_photo_with_a_twin_and_a_detector_has_five_panels(strip):
    key, panels, folder = strip([DARK, SHOWN, TESTED], tested=[TESTED])
    assert key == str(TESTED)
    assert list(panels) == ["photo", "twin", "difference", "labels", "detections"]
    assert all(png.read_png(folder / f"{name}.png").shape[1] == PANEL_WIDTH for name in panels)
    difference = png.read_png(folder / "difference.png")
    np.testing.assert_allclose(difference[300, 300], [225, 147, 135], atol=3)  # twice as bright: 1 stop of 3
    detections = png.read_png(folder / "detections.png").astype(int)
    scale = PANEL_WIDTH / 1936
    assert tuple(detections[round(550 * scale), round(500 * scale)]) == (255, 176, 0)
    assert len(set(detections[round(550 * scale), round(1800 * scale)])) == 1  # grey: below the minimum confidence


def test_without_photos_the_panels_are_twin_and_labels(strip):
    key, panels, _ = strip([])
    assert (key, list(panels)) == (str(SHOWN), ["twin", "labels"])


def test_without_images_there_is_no_panel():
    assert shown_key(polar(), {}, {}, label_table([]), None) is None
