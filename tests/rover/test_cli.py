"""Command `polarsim drive`: metrics, files, and errors in one line."""

import subprocess
from pathlib import Path

import pytest
import yaml

from tests.rover.drives import SMALL, configured, write_meshes

pytest.importorskip("mujoco", reason="mujoco is not installed")
pytest.importorskip("mcap_ros2", reason="mcap-ros2-support is not installed")


@pytest.fixture
def call(polarsim, monkeypatch):
    """Run `polarsim drive` on a small world with results in a folder."""
    monkeypatch.chdir(Path(__file__).parents[2])

    def drive(folder: Path, *more: object, **rover) -> subprocess.CompletedProcess:
        content = configured(**{**SMALL, **rover}) | {"run": "small", "terrains": [3]}
        (folder / "small.yaml").write_text(yaml.safe_dump(content))
        return polarsim("drive", "--configfile", folder / "small.yaml", "--results", folder, "--no-pictures", *more)

    return drive


def test_a_drive_prints_its_metrics_and_seeds_give_different_drives(call, tmp_path):
    write_meshes(tmp_path / "small/meshes/Terrain03", 3)
    short, traces = {**SMALL["drive"], "longest_s": 0.5, "spread": 1}, []
    for seed in (0, 4):
        done = call(tmp_path, "--seed", seed, drive=short)
        assert done.returncode == 0, done.stderr
        folder = tmp_path / f"small/rover/seed{seed}"
        assert done.stdout.splitlines()[-1].endswith(str(folder))
        assert "offset, RMS" in done.stdout
        assert {"drive.json", "trace.parquet", "drive.mcap", "rover.urdf"} <= {path.name for path in folder.iterdir()}
        traces.append((folder / "trace.parquet").read_bytes())
    assert traces[0] != traces[1]
    again = call(tmp_path, "--seed", 4, drive=short)
    assert again.returncode == 1
    assert str(folder) in again.stderr
    assert (folder / "trace.parquet").read_bytes() == traces[1]


def test_a_drive_stopped_by_ctrl_c_does_not_promise_to_resume(call, tmp_path, monkeypatch):
    def stopped(**_):
        raise KeyboardInterrupt

    write_meshes(tmp_path / "small/meshes/Terrain03", 3)
    monkeypatch.setattr("polarsim.rover.run.run_drive", stopped)
    done = call(tmp_path)
    assert done.returncode == 130
    assert done.stderr.splitlines()[-1] == "stopped by the user"


@pytest.mark.parametrize(
    ("rover", "reason"),
    [
        ({"drive": {"path_m": [[0, 0], [-30, 0]]}}, "the path leaves the ground"),
        ({"soil": {"soil": "cheese"}}, "cheese"),
        ({"soil": {"step_s": 0.02}}, "too large"),
        ({"drive": {"vehicle": "none.yaml"}}, "none.yaml"),
        ({}, "Terrain03"),  # no meshes
    ],
)
def test_bad_input_ends_in_one_line(call, tmp_path, rover, reason):
    if rover:
        write_meshes(tmp_path / "small/meshes/Terrain03", 3)
    done = call(tmp_path, **rover)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.startswith("error:")]
    assert len(lines) == 1
    assert reason in lines[0]
    assert "Traceback" not in done.stderr
