import numpy as np
import pandas as pd
import pytest

from polarsim.formats.tables import read_csv, write_csv, write_parquet
from polarsim.geometry.poses import camera_pose
from polarsim.report.stage_tables import tabulate_cameras, tabulate_rocks
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.scoring.mesh_scores import mesh_table
from polarsim.scoring.metrics import Metric, write_metrics
from tests.support.polar_rig import default_rig

ORIGIN = {"run": "here", "source": "analog", "config": "abc"}
POSE = camera_pose(np.array([3.5, -0.3, 1.5]), np.radians(178), np.radians(25), np.radians(1))


def tabulated(folder):
    tabulate_cameras(
        cameras={1: folder / "cameras"},
        evaluation=[folder / "evaluation.csv"],
        table=folder / "tables/cameras",
        alignment=folder / "tables/alignment",
        origin=ORIGIN,
    )
    return read_csv(folder / "tables/cameras.csv"), read_csv(folder / "tables/alignment.csv")


def test_a_camera_localised_by_scans_is_listed_with_errors(tmp_path):
    write_localised(tmp_path / "cameras/PosA.json", LocalisedRig(default_rig(), POSE, "scans", {"sd_mm": 0.3}))
    write_csv(tmp_path / "cameras/alignment.csv", pd.DataFrame([{"pair": "A-C", "fitness": 0.8, "rmse_mm": 1.2}]))
    metrics = [
        Metric("A", "position_error_aligned", 1.25, "mm", 1, "truth"),
        Metric("A R", "reprojection_median", 0.4, "px", 9, "truth"),
    ]
    write_metrics(tmp_path / "evaluation.csv", "cameras", 1, metrics)
    cameras, alignment = tabulated(tmp_path)
    row = cameras.iloc[0]
    assert (row["run"], row["terrain"], row["position"], row["method"]) == ("here", 1, "A", "scans")
    assert row["yaw_deg"] == pytest.approx(178)
    assert (row["sd_mm"], row["error_mm"], row["reprojection_r_px"]) == (0.3, 1.25, 0.4)
    assert np.isnan(row["error_deg"])
    assert alignment.iloc[0][["evidence", "between", "rmse_mm"]].tolist() == ["scans", "A-C", 1.2]


def test_a_camera_localised_by_labels_is_aligned_with_its_boxes(tmp_path):
    evaluation = {"matched": 9.0, "mean_iou": 0.8, "median_dx_px": 1.0, "median_dy_px": 0.9}
    write_localised(tmp_path / "cameras/PosB.json", LocalisedRig(default_rig(), POSE, "labels", evaluation))
    write_metrics(tmp_path / "evaluation.csv", "cameras", 1, [])
    _, alignment = tabulated(tmp_path)
    assert alignment.iloc[0][["evidence", "between", "mean_iou"]].tolist() == ["labels", "B and its boxes", 0.8]


def test_rocks_and_meshes_of_all_terrains_are_concatenated(tmp_path):
    for terrain in (1, 11):
        rocks = pd.DataFrame({"rock": [1, 2], "size_m": [0.1, 0.2], "source": ["scan", "override"]})
        write_parquet(tmp_path / f"rocks{terrain}.parquet", rocks)
        rows = [
            {"mesh": f"m{k}", "rock": k, "vertices": 4, "faces": 4, "watertight": True, "islands": 1} for k in (1, 2)
        ]
        write_csv(tmp_path / f"scores{terrain}.csv", mesh_table(rows))
    tabulate_rocks(
        rocks={t: tmp_path / f"rocks{t}.parquet" for t in (1, 11)},
        scores={t: tmp_path / f"scores{t}.csv" for t in (1, 11)},
        table=tmp_path / "tables/rocks",
        meshes=tmp_path / "tables/meshes",
        origin=ORIGIN,
    )
    rocks, meshes = (read_csv(tmp_path / f"tables/{name}.csv") for name in ("rocks", "meshes"))
    assert rocks["terrain"].tolist() == meshes["terrain"].tolist() == [1, 1, 11, 11]
    assert rocks["source"].unique().tolist() == ["analog"]
    assert rocks["found_by"].tolist() == ["scan", "override"] * 2
    shown = (tmp_path / "tables/meshes.md").read_text()
    assert "m2" in shown
    assert "hausdorff" not in shown  # empty columns are not shown
