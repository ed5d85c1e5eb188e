import pandas as pd
import pytest

from polarsim.formats.tables import read_parquet, write_parquet
from polarsim.report.detectors import tabulate_differences
from polarsim.schemas.report import DETECTION

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
VALUES = {
    "value": 0.6,
    "other_value": 0.3,
    "difference": 0.3,
    "difference_low": 0.1,
    "difference_high": 0.5,
    "pairs": 90,
    "images": 144,
    "units": 16,
    "unit": "view",
}


def row(metric, kind, against, sides, seed=0, **values):
    names = ("trained", "evaluated", "other_trained", "other_evaluated")
    return {"split": "photo", "seed": seed, "metric": metric, "kind": kind, "against": against} | dict(
        zip(names, sides, strict=True)
    ) | VALUES | values  # fmt: skip


@pytest.fixture
def tabulated(tmp_path):
    def tabulate(rows):
        detection = {
            "trained": "real", "evaluated": "real", "kind": "rock", "split": "photo", "seed": 0, "shares_views": True,
            "detector": "compact", "start": "scratch", "epochs": 20, "imgsz": 288, "images": 144, "labels": 9,
            "map50": 0.6, "map50_95": 0.3, "iou_mean": 0.5,
        }  # fmt: skip
        write_parquet(tmp_path / "differences.parquet", pd.DataFrame(rows))
        table = pd.DataFrame([detection]).reindex(columns=list(DETECTION.columns[:-3]), fill_value=0)
        write_parquet(tmp_path / "detection.parquet", table)
        tabulate_differences(
            differences=tmp_path / "differences.parquet",
            detection=tmp_path / "detection.parquet",
            stem=tmp_path / "tables" / "differences",
            origin=ORIGIN,
        )
        text = (tmp_path / "tables" / "differences.md").read_text()
        shown = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("|")]
        return read_parquet(tmp_path / "tables" / "differences.parquet"), shown, text

    return tabulate


def test_rocks_are_first_and_each_row_names_both_sides(tabulated):
    rows = [
        row("map50", "shadow", "", ("real", "real", "real", "hapke")),
        row("ipd", "rock", "real", ("hapke", "principled", "hapke", "hapke")),
        row("map50", "rock", "", ("real", "real", "real", "hapke")),
    ]
    table, shown, _ = tabulated(rows)
    assert list(zip(table["kind"], table["metric"], strict=True)) == [
        ("rock", "map50"), ("rock", "ipd"), ("shadow", "map50"),
    ]  # fmt: skip
    assert shown[2] == [
        "rock",
        "mAP@0.5",
        "Analog on Analog",
        "Analog on Hapke",
        "0.600",
        "0.300",
        "0.300 [0.100, 0.500]",
    ]
    assert shown[3][2:4] == ["Hapke on Analog and Principled", "Hapke on Analog and Hapke"]
    assert "real" not in set(table["trained"])  # images of the analog are never named real


def test_several_trainings_are_shown_with_standard_deviation(tabulated):
    sides = ("real", "real", "real", "hapke")
    _, shown, text = tabulated(
        [row("map50", "rock", "", sides), row("map50", "rock", "", sides, seed=1, difference=0.5, value=0.8)]
    )
    assert shown[2][4:] == ["0.700 ± 0.141", "0.300 ± 0.000", "0.400 ± 0.141"]
    assert "n = 2 trainings" in text
