"""An edit of the library repeats only the stages that use it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import polarsim

pytestmark = pytest.mark.slow
TOUCH = """
from snakemake.cli import main
from snakemake.executors.touch import Executor

Executor.SLEEPING_TIME = 0.001  # instead of 0.1 s per job
main(["--cores", "1", "--quiet", "all", "--touch"])
"""


@pytest.fixture(scope="module")
def untouched(tmp_path_factory, make_checkout, snakemake) -> Path:
    """A checkout with empty outputs of all jobs and the metadata of Snakemake, as after a complete run."""
    folder = make_checkout(tmp_path_factory.mktemp("finished"))
    shutil.copytree(Path(polarsim.__file__).parent, folder / "polarsim", ignore=shutil.ignore_patterns("kernels-*"))
    summary = snakemake(folder, "--summary")
    assert summary.returncode == 0, summary.stderr
    names = [line.split("\t")[0] for line in summary.stdout.splitlines()[1:] if "\t" in line]
    assert len(names) > 50
    for name in names:
        path = folder / name
        if path.suffix:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch()
        else:
            path.mkdir(parents=True, exist_ok=True)
    subprocess.run([sys.executable, "-c", TOUCH], cwd=folder, env=os.environ | {"PYTHONPATH": str(folder)}, check=True)
    return folder


@pytest.fixture
def finished(untouched: Path, tmp_path: Path) -> Path:
    """A writable copy of this checkout with the library."""
    return Path(shutil.copytree(untouched, tmp_path / "finished"))


def stale_rules(snakemake, folder: Path) -> set[str]:
    done = snakemake(folder, "--dry-run", "--quiet", "host")
    assert done.returncode == 0, done.stderr
    return set(re.findall(r"^(?:local)?rule (\w+):$", done.stdout + done.stderr, re.MULTILINE)) - {"all"}


def edit(path: Path, line: str) -> None:
    path.write_text(path.read_text() + line)


def test_an_edit_repeats_only_jobs_that_use_the_module(finished, snakemake):
    edit(finished / "polarsim/render/brdf.py", "\nCHANGED = 1\n")
    stale = stale_rules(snakemake, finished)
    assert {"render_twins", "convert_pictures", "train_detector", "evaluate", "report_detectors"} <= stale
    assert not stale & {"generate_analog", "index_terrain", "locate_cameras", "find_rocks", "mesh_rocks"}
    assert not stale & {"propagate_labels", "draw_masks"}

    edit(finished / "polarsim/grid.py", "\nCHANGED = 1\n")  # imported by scripts only
    stale = stale_rules(snakemake, finished)
    assert {"propagate_labels", "draw_masks", "render_twins", "score_labels"} <= stale


def test_added_trainings_and_other_options_of_the_comparison_do_not_repeat_trainings(finished, snakemake):
    content = yaml.safe_load((finished / "config/config.yaml").read_text())
    split = content["detect"].get("splits", ["photo"])[0]
    more = {"seeds": [0, 1], "splits": [split, "terrain"], "mixes": {"mixed": {"analog": 1, "hapke": 1}}}
    content["detect"] |= more | {"comparison": {"iou_confidence": 0.3}, "stereo": {"run": True}}
    (finished / "config/config.yaml").write_text(yaml.safe_dump(content))
    done = snakemake(finished, "--dry-run", "detect", "tables")
    assert done.returncode == 0, done.stderr
    text = done.stdout + done.stderr
    jobs = set(re.findall(r"^(?:local)?rule (\w+):$", text, re.MULTILINE))
    assert {"evaluate", "measure_stereo", "compare_stereo"} <= jobs
    assert "convert_pictures" not in jobs
    made = {path for line in re.findall(r"^ +output: (.*)", text, re.MULTILINE) for path in line.split(", ")}
    folder = f"results/demo/detect/{split}"
    new = {f"{folder}/seed1/detectors/analog.pt", f"{folder}/seed0/detectors/mixed.pt"}
    assert new | {"results/demo/detect/terrain/seed0/detectors/hapke.pt"} <= made
    former = ("datasets/analog", "seed0/detectors/analog", "seed0/predictions/analog_on")
    assert not [path for path in made if path.startswith(tuple(f"{folder}/{name}" for name in former))]
