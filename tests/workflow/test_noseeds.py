"""Labels without seeds: `labels.seeds: none`."""

import shutil

import pandas as pd
import pytest
import yaml


@pytest.mark.slow
def test_rocks_and_shadows_are_labelled_without_reading_annotated_files(small, checkout, snakemake):
    shutil.copytree(small / "data", checkout / "data")
    annotated = sorted((checkout / "data/analog/Labels").rglob("*.txt"))
    assert annotated
    for path in annotated:
        path.write_text("invalid line: reading this file is an error\n")
    files = ("--configfile", "config/small.yaml", "config/overlays/noseeds.yaml")
    few = ["positions=[A]", "grid={azimuths: ['180'], lights: ['off'], exposures_ms: [256]}"]  # two photos
    few += ["cameras={refinement: {scales: [0.25]}}"]  # fits lamps and walls to shadows; fewer scales are faster
    done = snakemake(checkout, "results/noseeds/tables/labels.csv", "labels", *files, "--config", *few)
    assert done.returncode == 0, done.stderr[-3000:]
    results = checkout / "results/noseeds"
    assert list((results / "acquire/Terrain01/seeds").glob("*.txt")) == []
    labels = pd.read_parquet(results / "labels/labels.parquet")
    assert set(labels["source"]) == {"projected", "cast"}
    table = pd.read_csv(results / "tables/labels.csv")
    assert set(table["seeds"]) == {"none"}
    total = table[(table["task"] == "all but seeds") & (table["group"] == "all")].set_index("kind")
    assert total.loc["rock", "truth_boxes"] > 25
    assert total.loc["rock", "f1"] > 0.85
    assert total.loc["shadow", "f1"] > 0.75


def test_annotated_files_are_no_input_of_a_run_without_seeds(checkout, snakemake, tmp_path):
    """Use NASA's layout with two scans and an annotated file in the folder of seeds."""
    root = tmp_path / "polar"
    annotated = root / "Labels/Terrain01/01_A_off_30_L_0256.txt"
    scans = [root / f"GroundTruth_RectifiedRangeMaps/Terrain01/Pos{position}_org-XYZ.tif" for position in "AC"]
    for path in (annotated, *scans):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("0 0.5 0.5 0.1 0.1\n")
    content = {"run": "own", "terrains": [1], "positions": ["A", "C"], "source": {"kind": "files", "root": str(root)}}
    (checkout / "config/own.yaml").write_text(yaml.safe_dump(content))
    files = ("--configfile", "config/own.yaml", "config/overlays/noseeds.yaml")
    done = snakemake(checkout, "labels", "tables", "--dry-run", *files)
    assert done.returncode == 0, done.stdout + done.stderr
    assert str(annotated) not in done.stdout + done.stderr
    assert "score_labels" in done.stdout + done.stderr  # labels are still scored against annotated files


def test_the_overlay_makes_a_run_of_its_own_from_the_same_data(dry_run):
    files = ("--configfile", "config/config.yaml", "config/overlays/noseeds.yaml")
    done = dry_run("labels", *files)
    assert done.returncode == 0, done.stdout + done.stderr
    text = done.stdout + done.stderr
    assert "results/noseeds/labels/labels.parquet" in text
    assert "data/analog/receipts/Terrain03.json" in text
    assert "results/demo" not in text
