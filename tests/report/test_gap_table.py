import numpy as np
import pandas as pd
import pytest

from polarsim.formats import png
from polarsim.formats.tables import read_csv, read_parquet, write_parquet
from polarsim.report.figures.gap import draw_gap
from polarsim.report.gap_table import tabulate_gap
from polarsim.schemas.detect import CHANGE_ENDS
from polarsim.schemas.detect import CHANGES as CHANGE_COLUMNS
from polarsim.schemas.report import GAP

CHANGE_METRICS = list(CHANGE_COLUMNS)

ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
CHANGES = {"pose": -0.01, "noise": 0.02, "mesh": -0.1}  # of ipd, in the order of the configuration


def ablation(seeds=(0,), components=CHANGES):
    rows = []
    for seed in seeds:
        for component in components:
            for trained in ("hapke", "analog"):
                for kind in ("rock", "shadow"):
                    change = CHANGES[component] * (1 if kind == "rock" else -1) + 0.001 * seed
                    metrics = dict(
                        zip(CHANGE_ENDS, (0.3, 0.3 + change, change, change - 0.05, change + 0.05), strict=True)
                    )
                    row = {f"{name}{end}": value for name in CHANGE_METRICS for end, value in metrics.items()}
                    row |= {"iou_photo": 0.6, "iou_twin": 0.3, "iou": 0.3 - change, "map50_photo": 0.5}
                    row |= {
                        "false_positives_photo": 0.2,
                        "false_positive_area_photo": 0.01,
                        "seed": seed,
                        "split": "photo",
                    }
                    row |= {"component": component, "replaced": "noise: on", "model": "hapke", "trained": trained}
                    row |= {"kind": kind, "detector": "compact", "epochs": 20, "imgsz": 288, "images": 144, "units": 16}
                    rows.append(row | {"unit": "view", "pairs": 700})
    return pd.DataFrame(rows, columns=list(GAP.columns))


def tabulated(tmp_path, table):
    write_parquet(tmp_path / "ablation.parquet", table)
    tabulate_gap(ablation=tmp_path / "ablation.parquet", stem=tmp_path / "gap", origin=ORIGIN)
    return (tmp_path / "gap.md").read_text()


def test_the_component_with_the_largest_reduction_of_the_gap_is_first(tmp_path):
    text = tabulated(tmp_path, ablation())
    for form in (read_csv(tmp_path / "gap.csv", GAP.columns), read_parquet(tmp_path / "gap.parquet", GAP.columns)):
        assert list(dict.fromkeys(form["component"])) == ["mesh", "pose", "noise"]
        assert form["kind"].tolist() == ["rock"] * 6 + ["shadow"] * 6
        assert form["trained"].tolist()[:2] == ["analog", "hapke"]
    assert "| mesh | Analog | 700 | 0.300 → 0.200 | -0.100 [-0.150, -0.050] |" in text
    facts = ("compact", "20 epochs", "288 px", "by photo", "144 test photos in 16 views", "are no photos", "Hapke twin")
    assert all(part in text for part in (*facts, "Run demo, source analog"))


def test_several_seeds_are_shown_by_mean_and_standard_deviation(tmp_path):
    text = tabulated(tmp_path, ablation(seeds=(0, 2)))
    assert "| mesh | Analog | 700 ± 0 | 0.300 ± 0.000 → 0.201 ± 0.001 | -0.099 ± 0.001 |" in text
    assert "n = 2 trainings" in text


@pytest.mark.parametrize("named", [tuple(CHANGES), ("pose",)])
def test_bars_are_drawn_for_every_component(tmp_path, named):
    write_parquet(tmp_path / "l.parquet", ablation(components=named))
    draw_gap(
        ablation=tmp_path / "l.parquet", figure=tmp_path / "gap.png", origin=ORIGIN,
        width=640,
    )  # fmt: skip
    pixels = png.read_png(tmp_path / "gap.png")
    assert pixels.shape[1] == 640
    assert len(np.unique(pixels)) > 2
