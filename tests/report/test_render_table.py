import numpy as np
import pandas as pd
import pytest

from polarsim.formats.tables import key_columns, read_csv, typed, write_csv, write_parquet
from polarsim.photo import PhotoKey
from polarsim.report.render_table import brightness_rows, tabulate_render
from polarsim.schemas.evaluation import APPEARANCE_PAIRS
from polarsim.scoring.metrics import Metric, metrics_table

ORIGIN = {"run": "test", "source": "analog", "config": "0123"}


@pytest.fixture
def pairs():
    """Two positions and two lamps: twins at B are 1 stop too bright, twins under lamp 180 differ more."""
    keys = [PhotoKey(3, position, "off", azimuth, "L", 256) for position in "AB" for azimuth in ("30", "180")]
    rows = [
        {
            **key_columns(key),
            "model": "hapke",
            "relation": "not fitted",
            "lit_px": 1000,
            "log2_twin_over_photo": float(key.position == "B"),
            "log2_difference": 0.5 if key.azimuth == "180" else 0.25,
        }
        for key in keys
    ]
    table = pd.DataFrame(rows, columns=list(APPEARANCE_PAIRS.dtypes))
    counts = [name for name, dtype in APPEARANCE_PAIRS.dtypes.items() if dtype in ("int64", "terrain")]
    return typed(table.fillna(dict.fromkeys(counts, 0)), APPEARANCE_PAIRS)


def test_medians_are_grouped_by_position_azimuth_and_terrain(pairs):
    rows = brightness_rows(pairs).set_index(["group", "value"])
    assert rows.loc[("all", "all"), "log2_twin_over_photo"] == 0.5
    assert rows.loc[("position", "B"), "log2_twin_over_photo"] == 1
    assert rows.loc[("azimuth", "180"), "log2_difference"] == 0.5
    assert rows.loc[("terrain", "03"), "n"] == 4


def test_photos_in_place_and_held_out_are_separate_and_photos_without_brightness_are_not_counted(pairs):
    pairs.loc[pairs["azimuth"] == "180", "relation"] = "held out"
    pairs.loc[pairs["azimuth"] == "30", "relation"] = "in place"
    pairs.loc[0, "lit_px"] = 0
    rows = brightness_rows(pairs)
    counts = rows[rows["group"] == "all"].set_index("subject")["n"]
    assert counts.to_dict() == {"hapke, held out": 2, "hapke, in place": 1}


def test_the_table_contains_images_and_boxes(tmp_path, pairs):
    write_parquet(tmp_path / "pairs.parquet", pairs)
    metrics = [
        Metric("rendered rock: all", name, value, "1", 7, "truth") for name, value in (("f1", 0.8), ("miou", 0.6))
    ]
    write_csv(tmp_path / "q.csv", metrics_table("render", 3, metrics))
    tabulate_render(
        pairs=[tmp_path / "pairs.parquet"], evaluation=[tmp_path / "q.csv"], table=tmp_path / "render", origin=ORIGIN
    )
    rows = read_csv(tmp_path / "render.csv").set_index(["subject", "group"])
    assert rows.loc[("rendered rock", "terrain"), ["n", "f1", "miou"]].tolist() == [7, 0.8, 0.6]
    assert np.isnan(rows.loc[("rendered rock", "terrain"), "log2_difference"])
    text = (tmp_path / "render.md").read_text()
    assert "+0.50 / 0.38" in text
    assert "0.800 / 0.600" in text


def test_a_run_without_photos_and_truth_has_an_empty_table(tmp_path, pairs):
    write_parquet(tmp_path / "pairs.parquet", pairs[:0])
    write_csv(tmp_path / "q.csv", metrics_table("render", 3, []))
    tabulate_render(
        pairs=[tmp_path / "pairs.parquet"], evaluation=[tmp_path / "q.csv"], table=tmp_path / "render", origin=ORIGIN
    )
    assert len(read_csv(tmp_path / "render.csv")) == 0
    assert "no photos" in (tmp_path / "render.md").read_text()
