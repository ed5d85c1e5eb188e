"""Command `polarsim drive`: errors in one line, and current drives are kept."""

import subprocess
from pathlib import Path

import pytest
import yaml

from polarsim.render.options import RenderOptions
from polarsim.rover import run
from polarsim.rover.drive import ride
from polarsim.rover.drive.ride import drive_to_end
from polarsim.rover.options import RoverOptions
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
        return polarsim("drive", "--config", folder / "small.yaml", "--results", folder, "--no-pictures", *more)

    return drive


def test_a_drive_prints_its_metrics_and_a_second_call_keeps_its_files(call, tmp_path):
    write_meshes(tmp_path / "small/meshes/Terrain03", 3)
    short = {**SMALL["drive"], "longest_s": 1.0}
    done = call(tmp_path, drive=short)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "small/rover/seed0"
    assert done.stdout.splitlines()[-1].endswith(str(folder))
    assert "offset, RMS" in done.stdout
    before = {path.name: (path.stat().st_mtime_ns, path.read_bytes()) for path in folder.glob("*.*")}
    assert {"drive.json", "trace.parquet", "drive.mcap", "rover.urdf"} <= set(before)
    again = call(tmp_path, drive=short)
    assert again.stdout == done.stdout
    assert (folder / "trace.parquet").stat().st_mtime_ns == before["trace.parquet"][0]  # not driven again
    assert (folder / "drive.mcap").stat().st_mtime_ns == before["drive.mcap"][0]  # nor written again
    call(tmp_path, drive=short, bag={**SMALL["bag"], "height_hz": 1})
    changed = folder / "drive.mcap"
    assert changed.read_bytes() != before["drive.mcap"][1]
    changed.unlink()
    (folder / ".drive.mcap.identity").write_text("broken")
    call(tmp_path, drive=short)
    assert changed.read_bytes() == before["drive.mcap"][1]


def test_seeds_give_different_drives(call, tmp_path):
    write_meshes(tmp_path / "small/meshes/Terrain03", 3)
    short = {**SMALL["drive"], "longest_s": 0.5, "spread": 1}
    for seed in (0, 4):
        assert call(tmp_path, "--seed", seed, drive=short).returncode == 0
    first, second = (tmp_path / f"small/rover/seed{seed}/trace.parquet" for seed in (0, 4))
    assert first.read_bytes() != second.read_bytes()


@pytest.mark.parametrize(
    ("rover", "reason"),
    [
        ({"drive": {"path_m": [[0, 0], [-30, 0]]}}, "the path leaves the ground"),
        ({"soil": {"soil": "cheese"}}, "cheese"),
        ({"soil": {"step_s": 0.02}}, "too large"),
        ({"drive": {"vehicle": "none.yaml"}}, "none.yaml"),
    ],
)
def test_bad_input_ends_in_one_line(call, tmp_path, rover, reason):
    write_meshes(tmp_path / "small/meshes/Terrain03", 3)
    done = call(tmp_path, **rover)
    assert done.returncode == 1
    lines = [line for line in done.stderr.splitlines() if line.startswith("error:")]
    assert len(lines) == 1
    assert reason in lines[0]
    assert "Traceback" not in done.stderr


def test_the_error_of_a_run_without_meshes_has_its_path(call, tmp_path):
    done = call(tmp_path)
    assert done.returncode == 1
    assert "Terrain03" in done.stderr


def test_a_drive_of_other_code_is_repeated(tmp_path, monkeypatch):
    """Without this, an old drive was kept after a fix of the code."""
    monkeypatch.chdir(Path(__file__).parents[2])
    write_meshes(tmp_path / "meshes/Terrain03", 3)
    options = RoverOptions(**{**SMALL, "drive": {**SMALL["drive"], "longest_s": 0.2}})
    driven_now = []
    monkeypatch.setattr(run, "drive_to_end", lambda *given: driven_now.append(1) or drive_to_end(*given))

    def drive():
        run.run_drive_pipeline(
            meshes=tmp_path / "meshes", folder=tmp_path / "drive", options=options,
            render=RenderOptions(), detector=None, seed=0, pictures=False,
        )  # fmt: skip
        return len(driven_now)

    assert [drive(), drive()] == [1, 1]
    before = (tmp_path / "drive/drive.mcap").stat().st_mtime_ns
    monkeypatch.setattr(ride, "identity", lambda *_: "other")
    assert [drive(), drive()] == [2, 2]
    assert (tmp_path / "drive/drive.mcap").stat().st_mtime_ns == before  # the content is the same
