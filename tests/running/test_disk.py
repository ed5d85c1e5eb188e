"""Checks of the disk before a run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from polarsim.config import parse_config, read_config
from polarsim.errors import PolarsimError
from polarsim.running import disk
from polarsim.running.configuration import read_configs

CHECKOUT = Path(__file__).parents[2]


def ended_pid() -> int:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_leftovers_of_dead_processes_go_and_all_else_stays(tmp_path):
    dead = ended_pid()
    names = [f".Terrain01.{os.getpid()}", ".snakemake_timestamp", "Terrain01.12", ".hidden.txt", "photo.1.png"]
    for name in (f".photos.{dead}.parquet", f".labels.{dead}", *names):
        (tmp_path / name).write_text("x")
    (tmp_path / f"inner/.Terrain02.{dead}").mkdir(parents=True)
    (tmp_path / f"inner/.Terrain02.{dead}/1.png").write_text("x")
    assert disk.remove_leftovers(tmp_path) == 3
    assert disk.remove_leftovers(tmp_path / "nowhere") == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "inner"])
    assert not list((tmp_path / "inner").iterdir())


@pytest.mark.parametrize(
    ("overlays", "measured"), [([], 0.85e9 + 0.61e9), (["config/overlays/large.yaml"], 1.4e9 + 1.2e9)]
)
def test_the_estimate_covers_measured_data_and_results(overlays, measured):
    config = read_configs([CHECKOUT / name for name in overlays], [])
    assert measured < disk.expected_bytes(config) < 2 * measured


def test_the_needed_space_counts_what_is_there(tmp_path):
    config = read_config(CHECKOUT / "config/config.yaml")
    (tmp_path / "there").write_bytes(bytes(1_000_000))
    (tmp_path / "further name").hardlink_to(tmp_path / "there")
    assert disk.needed_bytes(config, True, [tmp_path]) == disk.expected_bytes(config) - 1_000_000
    assert disk.needed_bytes(config, False, [tmp_path]) == 500_000_000
    release = {"terrains": [1], "source": {"kind": "release", "root": str(tmp_path)}, "render": {"models": ["hapke"]}}
    assert disk.expected_bytes(parse_config(release)) < disk.expected_bytes(config)


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    disk.refuse_unwritable(tmp_path / "not/yet/there")
    assert not list(tmp_path.iterdir())
    with pytest.raises(PolarsimError, match="/proc"):
        disk.refuse_unwritable(Path("/proc/here"))
