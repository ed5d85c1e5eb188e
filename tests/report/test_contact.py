import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.formats.tables import label_table, write_parquet
from polarsim.photo import COLOURS, PhotoKey
from polarsim.report.figures import contact
from polarsim.site import polar
from tests.support.label_rows import label_row

KEYS = [
    PhotoKey.parse(f"03_A_{light}_{azimuth}_{camera}_{exposure}")
    for light in ("off", "on")
    for azimuth in ("no", "30")
    for camera in "LR"
    for exposure in ("0064", "0256", "1024")
]


def drawn(folder, name, rows, keys=KEYS, pictures=(), width=800):
    write_parquet(folder / "labels.parquet", label_table(rows))
    contact.draw_contact(
        site=polar(),
        keys=keys,
        labels=folder / "labels.parquet",
        pictures=pictures,
        figure=folder / name,
        width=width,
    )
    return png.read_png(folder / name)


@pytest.mark.parametrize(
    ("labels", "chosen"),
    [
        ({}, "0256"),  # no labels: the usual exposure
        ({"0064": 1, "0256": 2, "1024": 2}, "0256"),  # equal counts: the exposure nearest to 256 ms
        ({"0064": 1, "0256": 2, "1024": 3}, "1024"),
        ({"0064": 3, "0256": 2, "1024": 2}, "0064"),
    ],
)
def test_the_exposure_with_the_most_labels_is_shown(labels, chosen):
    exposures = [key for key in KEYS if key.bracket == KEYS[0].bracket]
    table = label_table([label_row(key) for key in exposures for _ in range(labels.get(str(key)[-4:], 0))])
    assert str(contact.most_labelled(exposures, table, 256)).endswith(chosen)


def test_labels_in_the_lowest_tenth_or_below_one_half_are_doubtful():
    high = pd.Series(np.linspace(0.55, 1.0, 101))
    assert (high < contact.doubtful_confidence(high)).mean() == pytest.approx(0.1, abs=0.01)
    low = pd.Series([0.3] * 80 + [0.9] * 20)
    assert (low < contact.doubtful_confidence(low)).sum() == 80
    equal = pd.Series([0.9] * 50)
    assert not (equal < contact.doubtful_confidence(equal)).any()
    assert contact.doubtful_confidence(pd.Series([], dtype=float)) == 0.5


def test_a_sheet_has_a_row_per_azimuth_and_a_column_per_camera_and_light(tmp_path):
    sheet = drawn(tmp_path, "sheet.png", [label_row(key) for key in KEYS])
    assert sheet.shape[1] == drawn(tmp_path, "none.png", [], []).shape[1] == 800
    no_sun = drawn(tmp_path, "row.png", [], [key for key in KEYS if key.azimuth == "no"])
    left = drawn(tmp_path, "column.png", [], [key for key in KEYS if key.camera == "L" and key.light == "off"])
    assert 0.4 * sheet.shape[0] < no_sun.shape[0] < 0.6 * sheet.shape[0]  # half of the rows
    assert left.shape[0] > 3 * sheet.shape[0]  # a quarter of the columns: tiles are four times as wide


def test_a_tile_s_title_counts_labels_and_doubts():
    rows = [label_row(KEYS[0]), label_row(KEYS[0], "shadow", confidence=0.4), label_row(KEYS[0], "shadow", rock=8)]
    tile = contact.Tile(KEYS[0], label_table(rows), None)
    assert tile.title(0.5) == "no Sun, light off, L, 64 ms: 1 rocks, 2 shadows, 1 dashed"


def test_the_same_rows_give_the_same_bytes_and_exact_label_colours(tmp_path):
    keys = [key for key in KEYS if key.camera == "L" and key.light == "off"]
    rows = [label_row(key) for key in keys] + [label_row(key, "shadow", box=(900, 300, 1200, 500)) for key in keys]
    shown = drawn(tmp_path, "first.png", rows, keys).astype(int)
    drawn(tmp_path, "second.png", rows, keys)
    assert (tmp_path / "first.png").read_bytes() == (tmp_path / "second.png").read_bytes()
    for kind in ("rock", "shadow"):
        off = np.abs(shown - COLOURS[kind]).max(axis=-1)
        assert (off <= 2).sum() > 300


def test_a_sheet_that_is_too_large_gets_fewer_greys(tmp_path, monkeypatch, rng):
    for key in KEYS[:3]:
        png.write_png(tmp_path / f"noise/{key}.png", rng.integers(16, 4095, (1216, 1936)).astype(np.uint16))
    arguments = {"keys": KEYS[:3], "rows": [label_row(KEYS[0])], "pictures": [tmp_path / "noise"]}
    many = drawn(tmp_path, "many.png", **arguments)
    monkeypatch.setattr(contact, "MAX_BYTES", int(0.9 * (tmp_path / "many.png").stat().st_size))
    few = drawn(tmp_path, "few.png", **arguments)
    assert (tmp_path / "few.png").stat().st_size <= contact.MAX_BYTES
    assert len(np.unique(few)) < len(np.unique(many))
