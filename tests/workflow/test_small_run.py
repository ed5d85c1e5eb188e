"""A small run of the whole pipeline: it ends, a second call does nothing, and another build has the same bytes."""

import hashlib
from pathlib import Path

import pandas as pd
import pytest
import yaml

from polarsim.formats import yolo
from polarsim.photo import PhotoKey

SMALL = {
    "run": "small",
    "terrains": [1],
    "positions": ["A", "C"],
    "source": {"kind": "analog", "root": "data/analog"},
    "rocks": {"rock_cell_mm": 3, "ground_mesh_cell_mm": 10},
    "grid": {"azimuths": ["30"], "lights": ["off"], "exposures_ms": [64, 128, 256, 512]},
    "render": {"models": ["hapke"]},
    "detect": {
        "training": {"model": "compact", "epochs": 1},  # starts in a tenth of the time of a YOLO detector
        "pictures": {"imgsz": 96},
        "splits": ["photo", "position"],
        "mixes": {"mixed": {"analog": 0.5, "hapke": 1}},
    },
    "gap": {
        "trained_on": ["hapke"],
        "components": {
            "nothing": {"render": {"seed": 0}},
            "scene": {"cameras": "truth", "lamps": "truth", "meshes": "truth"},
            "labels": {"labels": "propagated"},
        },
    },
}


def digests(folder: Path) -> dict[str, str]:
    """sha256 of every output that must be the same in every build."""
    parts = ("cameras", "rocks", "meshes", "labels", "renders")
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for part in parts
        for path in sorted((folder / part).rglob("*"))
        if path.is_file()
    }


@pytest.mark.slow
def test_a_small_run_ends_and_repeats(checkout, snakemake, tmp_path):
    (checkout / "config/small.yaml").write_text(yaml.safe_dump(SMALL))
    done = snakemake(checkout, "--cores", "2", "--configfile", "config/small.yaml")
    assert done.returncode == 0, done.stderr[-3000:]
    results = checkout / "results/small"

    keys = [PhotoKey.parse(path.stem) for path in sorted((results / "labels/boxes/Terrain01").glob("*.txt"))]
    assert len(keys) == 2 * 2 * 4  # positions, cameras, exposures
    assert {path.stem for path in (results / "renders/hapke/Terrain01").glob("*.png")} == set(map(str, keys))
    rocks, _ = yolo.read_boxes(results / "labels/boxes/Terrain01/01_A_off_30_R_0064.txt")
    assert len(rocks) > 5
    detection = pd.read_parquet(results / "detect/detection.parquet")
    assert set(zip(detection["split"], detection["trained"], detection["evaluated"], strict=True)) == {
        (split, trained, evaluated)
        for split in ("photo", "position")
        for trained in ("analog", "hapke", "mixed")
        for evaluated in ("analog", "hapke")
    }
    assert detection.groupby("split")["leaks_views"].all().to_dict() == {"photo": True, "position": False}
    for name in ("detection", "ipd", "gap", "evaluation"):
        for form in ("csv", "md", "tex", "parquet"):
            assert (results / f"tables/{name}.{form}").stat().st_size

    ablation = pd.read_parquet(results / "gap/ablation.parquet").set_index("component")
    assert len(ablation) == 3 * 2 * 2  # components, splits, kinds
    changes = ablation.loc["nothing", [name for name in ablation.columns if "_change" in name]]
    assert (changes.fillna(0) == 0).all(axis=None)
    scene = ablation.loc["scene"].query("kind == 'rock'")
    assert (scene["pairs"] > 5).all()  # true rocks have the run's numbers
    assert (results / "figures/gap.png").stat().st_size

    again = snakemake(checkout, "--cores", "2", "--configfile", "config/small.yaml")
    assert "Nothing to be done" in again.stdout + again.stderr

    first = digests(results)
    for folder in ("results", "data", ".snakemake"):
        (checkout / folder).rename(tmp_path / f"first_{folder}")
    built = snakemake(checkout, "labels", "render", "--configfile", "config/small.yaml")
    assert built.returncode == 0, built.stderr[-3000:]
    assert digests(results) == first
