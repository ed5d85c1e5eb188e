"""What is looked at on disk before a run."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from polarsim.config import parse_config, read_config
from polarsim.errors import PolarsimError
from polarsim.running import disk

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
    assert disk.remove_leftovers([tmp_path, tmp_path / "nowhere"]) == 3
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*names, "inner"])
    assert not list((tmp_path / "inner").iterdir())


def test_stamps_of_tomorrow_are_pulled_back_in_their_order(tmp_path):
    now = time.time()
    for name, ahead in (("older", -3600), ("c", 9000), ("a", 7200), ("b", 8000)):
        (tmp_path / name).write_text("x")
        os.utime(tmp_path / name, (now + ahead, now + ahead))
    assert disk.pull_back_stamps([tmp_path], tmp_path) == 3
    stamps = {path.name: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert sorted(stamps, key=stamps.__getitem__) == ["older", "a", "b", "c"]
    assert stamps["c"] <= time.time_ns()
    assert stamps["older"] == pytest.approx((now - 3600) * 1e9, abs=1e6)
    assert disk.pull_back_stamps([tmp_path], tmp_path) == 0


def test_files_of_others_with_stamps_of_tomorrow_are_named_and_left(tmp_path):
    (tmp_path / "own").mkdir()
    scan = tmp_path / "theirs.ply"
    scan.write_text("x")
    os.utime(scan, (4e9, 4e9))
    with pytest.raises(PolarsimError, match=r"theirs\.ply: its time stamp lies in the future"):
        disk.pull_back_stamps([tmp_path], tmp_path / "own")
    assert scan.stat().st_mtime == 4e9


def test_the_estimate_covers_the_measured_demo_and_counts_what_is_there(tmp_path):
    config = read_config(CHECKOUT / "config/config.yaml")
    measured = 1.4e9 + 1.2e9  # data and results of `make demo`, docs/stages.md
    assert measured < disk.expected_bytes(config) < 2 * measured
    (tmp_path / "there").write_bytes(bytes(1_000_000))
    (tmp_path / "further name").hardlink_to(tmp_path / "there")
    assert disk.needed_bytes(config, True, [tmp_path]) == disk.expected_bytes(config) - 1_000_000
    assert disk.needed_bytes(config, False, [tmp_path]) == 500_000_000
    release = {"terrains": [1], "source": {"kind": "release", "root": str(tmp_path)}, "render": {"models": ["hapke"]}}
    assert disk.expected_bytes(parse_config(release)) < disk.expected_bytes(config)


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    disk.refuse_unwritable(tmp_path / "not/yet/there")
    assert not list(tmp_path.iterdir())
    with pytest.raises(PolarsimError, match="/proc: cannot be written"):
        disk.refuse_unwritable(Path("/proc/here"))
