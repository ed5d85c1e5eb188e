"""Rerun recordings; row numbers differ between calls, so entities and counts are compared, not bytes."""

import subprocess
import sys

import pytest

from polarsim.errors import ConfigError
from polarsim.explore import recording
from polarsim.run_files.run import Run

from .made_run import KEYS


def entities(path) -> str:
    told = subprocess.run([sys.executable, "-m", "rerun_cli", "rrd", "print", path], capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    return told.stdout


def test_a_station_is_recorded_with_all_its_entities(polarsim, made, tmp_path):
    pytest.importorskip("rerun", reason="needs Rerun: pip install polarsim[rerun]")
    done = polarsim("rerun", "made", "03_A", "--results", made.parent, "--out", tmp_path / "a.rrd")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"{len({key.bracket for key in KEYS}) * 3} pictures")
    verified = subprocess.run(
        [sys.executable, "-m", "rerun_cli", "rrd", "verify", tmp_path / "a.rrd"], capture_output=True
    )
    assert verified.returncode == 0, verified.stderr
    told = entities(tmp_path / "a.rrd")
    wanted = ["/world/terrain", "/world/rocks", "/world/lamps", "/photo"]
    for side in "LR":
        wanted += [f"/world/{side}", *(f"/world/{side}/{domain}" for domain in ("photo", "hapke", "principled"))]
        wanted += [f"/world/{side}/photo/boxes", f"/world/{side}/photo/masks"]
    assert [name for name in wanted if name not in told] == []
    assert (tmp_path / "a.rrd").stat().st_size < 20e6


def test_the_viewer_is_paused_on_the_timeline_of_lamps(made):
    pytest.importorskip("rerun", reason="needs Rerun: pip install polarsim[rerun]")
    panel = recording._blueprint(Run.at(made)).time_panel
    assert panel.timeline == "lamp"
    assert panel.play_state == "paused"


def test_an_unknown_station_is_an_error(made, tmp_path):
    pytest.importorskip("rerun", reason="needs Rerun: pip install polarsim[rerun]")
    with pytest.raises(ConfigError):
        recording.write_recording(Run.at(made), 3, "C", tmp_path / "c.rrd")
    assert not (tmp_path / "c.rrd").exists()


@pytest.mark.parametrize("station", ["03", "A_03", "x", ""])
def test_an_invalid_station_is_an_error_of_one_line(polarsim, made, station):
    done = polarsim("rerun", "made", station, "--results", made.parent)
    assert done.returncode == 1
    assert f"station {station!r}" in done.stderr
    assert done.stderr.count("\n") == 1


def test_without_rerun_the_message_names_the_extra(polarsim, made, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    done = polarsim("rerun", "made", "03_A", "--results", made.parent)
    assert (done.returncode, done.stderr) == (1, "error: Rerun is not installed: pip install polarsim[rerun]\n")
