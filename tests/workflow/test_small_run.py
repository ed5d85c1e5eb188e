"""A small run of the pipeline is complete, a second call plans no job, and a second build has equal bytes."""

import hashlib
import json
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest

from polarsim.formats import yolo
from polarsim.photo import PhotoKey
from tests.support.polar_photos import SIZE

pytestmark = pytest.mark.slow


def digests(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of every reproducible output."""
    parts = ("cameras", "rocks", "meshes", "labels", "renders")
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for part in parts
        for path in sorted((folder / part).rglob("*"))
        if path.is_file()
    }


def test_a_small_run_ends(small, snakemake):
    results = small / "results/small"
    keys = [PhotoKey.parse(path.stem) for path in sorted((results / "labels/boxes/Terrain01").glob("*.txt"))]
    assert len(keys) == 2 * 2 * 2  # positions, azimuths, cameras
    assert {path.stem for path in (results / "renders/hapke/Terrain01").glob("*.png")} == set(map(str, keys))
    rocks, _ = yolo.read_boxes(results / "labels/boxes/Terrain01/01_A_off_30_R_0256.txt", size=SIZE)
    assert len(rocks) > 5
    detection = pd.read_parquet(results / "detect/detection.parquet")
    assert set(zip(detection["split"], detection["trained"], detection["evaluated"], strict=True)) == {
        ("position", trained, evaluated)
        for trained in ("analog", "hapke", "mixed")
        for evaluated in ("analog", "hapke")
    }
    assert not detection["shares_views"].any()
    for name in ("detection", "ipd", "gap", "evaluation", "appearance"):
        for form in ("csv", "md", "tex", "parquet"):
            assert (results / f"tables/{name}.{form}").stat().st_size

    appearance = pd.read_parquet(results / "tables/appearance.parquet").set_index(["group", "value"]).loc["all", "all"]
    assert (appearance["model"], appearance["relation"]) == ("hapke", "not fitted")
    assert (appearance["photos"], appearance["views"], appearance["controlled"]) == (8, 4, 0)  # a single terrain
    assert appearance["ssim_low"] <= appearance["ssim"] <= appearance["ssim_high"]

    ablation = pd.read_parquet(results / "gap/ablation.parquet").set_index("component")
    assert len(ablation) == 2 * 2 * 2  # components, detectors, kinds
    scene = ablation.loc["scene"].query("kind == 'rock'")
    assert (scene["pairs"] > 5).all()  # true rocks have the ids of the run
    assert (results / "figures/gap.png").stat().st_size

    again = snakemake(small, "--cores", "2", "--configfile", "config/small.yaml")
    assert "Nothing to be done" in again.stdout + again.stderr


def test_a_build_of_another_name_from_moved_data_has_the_same_bytes(small, checkout, snakemake):
    """Starts with meshes; `tests/cameras/` and `tests/rocks/` test the reproducibility of earlier stages."""
    (checkout / "data").symlink_to(small / "data")  # of the copied tables of photos
    (checkout / "moved").symlink_to(small / "data/analog")
    done, built = small / "results/small", checkout / "results/other"
    for part in ("acquire", "cameras/located", "rocks", "meshes", "evaluation"):
        shutil.copytree(done / part, built / part, symlinks=True)
    tables = [f"results/other/tables/{name}.csv" for name in ("cameras", "rocks", "evaluation")]
    made = ("refine_cameras", "propagate_labels", "draw_masks", "merge_labels", "render_twins", "write_reflectance",
            "merge_twin_labels", "tabulate_geometry", "tabulate_evaluation")  # fmt: skip
    call = ["labels", "render", *tables, "--rerun-triggers", "mtime", "--allowed-rules", "labels", "render", *made]
    call += ["--configfile", "config/small.yaml", "--config", "run=other", "source={kind: analog, root: moved}"]
    ended = snakemake(checkout, *call, PYTHONHASHSEED="1")  # other order of sets
    assert ended.returncode == 0, ended.stderr[-3000:]
    assert digests(built) == digests(done)

    def without_run(table: Path) -> list[str]:
        return [line.partition(",")[2] for line in table.read_text().splitlines()]

    for table in tables:
        own = checkout / table
        assert own.read_text().startswith("run,")
        assert without_run(own) == without_run(done / "tables" / own.name)


def test_the_target_publish_runs_no_other_job(small, snakemake):
    call = ("publish", "--cores", "2", "--configfile", "config/small.yaml", "--config", "publish={forms: [coco, gltf]}")
    done = snakemake(small, *call)
    assert done.returncode == 0, done.stderr[-3000:]
    assert set(re.findall(r"^(?:local)?rule (\w+):", done.stdout + done.stderr, re.MULTILINE)) == {
        "publish_run",
        "publish",
    }
    published = small / "results/small/publish"
    pictures = json.loads((published / "coco.json").read_text())["pictures"]
    assert pictures == {"analog": 8, "hapke": 8}
    assert len(list((published / "coco/images/hapke").glob("*.png"))) == 8
    assert (published / "gltf/terrain01.glb").stat().st_size > 10_000
    again = snakemake(small, *call)
    assert "Nothing to be done" in again.stdout + again.stderr
