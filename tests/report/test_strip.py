"""The strip of one photo on a run's first page."""

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.formats.files import read_json
from polarsim.formats.tables import key_columns, label_table, write_parquet
from polarsim.photo import PhotoKey
from polarsim.report.figures.strip import PANEL_WIDTH, draw_strip, shown_key

BOX = {"x0": 500.0, "y0": 400.0, "x1": 900.0, "y1": 700.0}
DARK, SHOWN, TESTED = (PhotoKey.parse(f"03_A_off_30_L_{ms}") for ms in ("2048", "0256", "0128"))


@pytest.fixture
def strip(tmp_path):
    """`strip(photos=keys, found=keys)`: the captions by panel, and the folder."""

    def make(photos, found=None):
        for key in (DARK, SHOWN, TESTED):
            png.write(tmp_path / f"twins/{key}.png", np.full((1216, 1936), 1000, np.uint16))
            png.write(tmp_path / f"photos/{key}.png", np.full((1216, 1936), 508, np.uint16))
        rows = [{"key": str(key), "path": str(tmp_path / f"photos/{key}.png")} for key in photos]
        write_parquet(tmp_path / "photos.parquet", pd.DataFrame(rows, columns=["key", "path"]).astype("str"))
        label = {"kind": "rock", "rock": 7, "source": "seed", "confidence": 1.0} | BOX
        write_parquet(tmp_path / "labels.parquet", label_table([key_columns(SHOWN) | label]))
        seen = [{"key": str(key), "kind": "rock", "confidence": 0.9} | BOX for key in found or ()]
        seen += [{**row, "confidence": 0.1, "x1": 1800.0} for row in seen]
        if found:
            write_parquet(tmp_path / "found.parquet", pd.DataFrame(seen))
        draw_strip(
            photos=tmp_path / "photos.parquet", twins=tmp_path / "twins", labels=tmp_path / "labels.parquet",
            predictions=tmp_path / "found.parquet" if found else None, model="hapke", trained="analog",
            strip=tmp_path / "strip",
        )  # fmt: skip
        told = read_json(tmp_path / "strip/strip.json")
        return told["key"], dict(told["panels"]), tmp_path / "strip"

    return make


def test_a_photo_with_a_twin_and_a_detector_has_five_panels(strip):
    key, panels, folder = strip([DARK, SHOWN, TESTED], found=[TESTED])
    assert key == str(TESTED)
    assert list(panels) == ["photo", "twin", "difference", "labels", "detections"]
    assert all(png.read(folder / f"{name}.png").shape[1] == PANEL_WIDTH for name in panels)
    difference = png.read(folder / "difference.png")
    np.testing.assert_allclose(difference[300, 300], [255, 128, 128], atol=3)  # twice as bright: one of two stops
    found = png.read(folder / "detections.png").astype(int)
    scale = PANEL_WIDTH / 1936
    assert tuple(found[round(550 * scale), round(500 * scale)]) == (255, 176, 0)
    assert len(set(found[round(550 * scale), round(1800 * scale)])) == 1  # grey: the unsure box is not drawn


def test_without_photos_the_twin_stands_alone_with_its_labels(strip):
    key, panels, _ = strip([])
    assert (key, list(panels)) == (str(SHOWN), ["twin", "labels"])


def test_without_any_picture_there_is_no_panel():
    assert shown_key({}, {}, label_table([]), None) is None
