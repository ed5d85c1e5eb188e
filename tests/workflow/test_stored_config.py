"""Every run stores its configuration, and commands use the stored configuration."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from polarsim.config import Config, parse_config, read_config
from polarsim.errors import ConfigError
from polarsim.running.configuration import (
    STORED,
    base_configuration,
    config_of_module,
    config_of_run,
    read_configs,
    store_config,
)

CONFIGURATIONS = Path(__file__).parents[2] / "config"
FIGURE = "results/mine/figures/reflectance.png"  # fastest output of a run, without data
SEED = "03_A_off_350_R_0256"


@pytest.fixture
def clone(checkout: Path, monkeypatch) -> Path:
    """Working folder: a checkout with the overlay `mine.yaml`."""
    (checkout / "mine.yaml").write_text("run: mine\nterrains: [3]\nlabels: {min_contrast_dn: 20}\n")
    monkeypatch.chdir(checkout)
    monkeypatch.setenv("PYTHONPATH", str(CONFIGURATIONS.parent))
    return checkout


def polarsim_run(*words: str) -> subprocess.CompletedProcess:
    """Run `polarsim run` in a separate process, because it ends all child processes."""
    call = [sys.executable, "-c", "from polarsim.cli import main; main()", "run", "--min-free", "0", *words]
    return subprocess.run(call, capture_output=True, text=True)


@pytest.mark.slow
@pytest.mark.usefixtures("snakemake_of_commands")
def test_a_run_stores_its_configuration_once_and_its_report_reads_it(clone, snakemake, polarsim):
    settings = ["positions=[A]", "labels={excluded_annotations: [03_A_off_180_L_0256]}"]
    call = (FIGURE, "--configfile", "mine.yaml", "--config", *settings)
    stored = clone / "results/mine" / STORED
    done = snakemake(clone, *call)
    assert done.returncode == 0, done.stderr
    expected = read_configs([clone / "mine.yaml"], settings)
    assert config_of_run(Path("results/mine")) == read_config(stored) == expected
    assert (expected.terrains, expected.labels.min_contrast_dn, expected.positions) == ((3,), 20, ("A",))
    assert expected.rocks.rock_cell_mm == 4  # of config/config.yaml

    # A complete run without stored configuration.
    stored.unlink()
    assert polarsim_run(FIGURE, "--configfile", "mine.yaml").returncode == 0
    assert config_of_run(Path("results/mine")) == read_configs([Path("mine.yaml")])

    (clone / "results/demo/tables").mkdir(parents=True)
    (clone / "results/demo/tables/labels.csv").write_text("run,config\n")
    done = polarsim("report", "mine")
    assert done.returncode == 0, done.stderr
    page = (clone / "results/mine/report.html").read_text(errors="replace")
    assert FIGURE in page
    assert "results/demo" not in page
    for words in (("report", "demo"), ("report", "mine", "--configfile", "config/config.yaml")):
        refused = polarsim(*words)
        assert refused.returncode == 1
        assert len(refused.stderr.splitlines()) == 1
    assert not (clone / "results/demo/report.html").exists()


@pytest.fixture
def stored(tmp_path, monkeypatch) -> Callable[..., Path]:
    """Return a function that stores the configuration of a run below the working folder."""
    monkeypatch.chdir(tmp_path)

    def store(run: str, **content) -> Path:
        folder = Path("results") / run
        folder.mkdir(parents=True, exist_ok=True)
        store_config(parse_config({"run": run, "source": {"kind": "analog"}, **content}), folder)
        return folder

    return store


@pytest.mark.parametrize("command", [("undo", SEED, "--run"), ("drive",), ("report",)], ids=lambda call: call[0])
def test_the_configuration_of_another_run_is_an_error(stored, polarsim, command):
    stored("mine")
    Path("other.yaml").write_text("run: other\nsource: {kind: analog}\n")
    Path("Snakefile").touch()
    for folder in ("tables", "meshes"):
        Path("results/mine", folder).mkdir()
    Path("results/mine/tables/labels.csv").write_text("run,config\n")
    refused = polarsim(*command, "mine", "--configfile", "other.yaml")
    assert refused.returncode == 1
    (line,) = refused.stderr.splitlines()
    assert "other.yaml" in line
    assert "'mine'" in line
    Path("results/mine").rename("results/copy")  # the stored configuration contains the name of the run
    refused = polarsim(*command, "copy")
    assert refused.returncode == 1
    assert f"results/copy/{STORED}" in refused.stderr
    Path("results/copy", STORED).unlink()
    missing = polarsim(*command, "copy")
    assert missing.returncode == 1
    (line,) = missing.stderr.splitlines()
    assert f"results/copy/{STORED}" in line
    assert "--configfile" in line


def test_undo_takes_overlays_and_the_stored_configuration(stored, polarsim):
    folder = stored("mine", labels={"corrections": "corrections"})
    corrections = Path("corrections")
    corrections.mkdir()
    (corrections / f"{SEED}.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    (corrections / "classes.txt").write_text("rock\nshadow\n")
    found = polarsim("undo", SEED, "--run", "mine")
    assert "no seed and no correction" not in found.stderr  # the photo is a correction, but the run has no photos
    assert str(folder / "acquire") in found.stderr
    Path("overlay.yaml").write_text("run: mine\n")
    Path("config").mkdir()
    Path("config/config.yaml").write_text("run: demo\nsource: {kind: analog}\nlabels: {corrections: corrections}\n")
    assert str(folder / "acquire") in polarsim("undo", SEED, "--configfile", "overlay.yaml").stderr
    away = Path("elsewhere")
    away.mkdir()
    os.chdir(away)
    assert "no seed and no correction" not in polarsim("undo", SEED, "--run", "mine", "--results", "../results").stderr


def test_drive_reads_the_rover_of_the_run(stored, polarsim):
    stored("mine", terrains=[3], rover={"run": True, "world": {"terrains": [3]}, "seeds": [7]})
    done = polarsim("drive", "mine", "--no-pictures")
    assert done.returncode == 1
    assert "results/mine/meshes" in done.stderr
    stored("plain")
    refused = polarsim("drive", "plain")
    assert refused.returncode == 1
    assert "rover.run" in refused.stderr


BASES = [path.name for path in CONFIGURATIONS.glob("*.yaml") if path.name not in ("viper.yaml", "views.yaml")]
OVERLAYS = [f"overlays/{path.name}" for path in (CONFIGURATIONS / "overlays").glob("*.yaml")]


def test_base_configurations_define_the_source_and_overlays_do_not():
    defining = {name for name in (*BASES, *OVERLAYS) if base_configuration([CONFIGURATIONS / name]) == []}
    assert defining == set(BASES)


@pytest.mark.parametrize("name", sorted([*BASES, *OVERLAYS]))
def test_a_stored_configuration_reads_back_the_same(tmp_path, monkeypatch, name):
    monkeypatch.chdir(CONFIGURATIONS.parent)
    base = [CONFIGURATIONS / "overlays/rover.yaml"] if name == "overlays/rover_autonomy.yaml" else []
    files = [*base, CONFIGURATIONS / name]
    config = read_configs(files)
    store_config(config, tmp_path / config.run)
    text = (tmp_path / config.run / STORED).read_text()
    again = read_config(tmp_path / config.run / STORED)
    assert again == config
    store_config(again, tmp_path / config.run)
    assert (tmp_path / config.run / STORED).read_text() == text


def test_any_text_reads_back_from_the_stored_configuration(tmp_path):
    config = Config.model_validate({"run": "any", "source": {"kind": "files", "root": "/ aé ü#:'\"\\~- "}})
    store_config(config, tmp_path)
    written = (tmp_path / STORED).stat().st_mtime_ns
    store_config(config, tmp_path)
    assert (tmp_path / STORED).stat().st_mtime_ns == written
    assert read_config(tmp_path / STORED) == config


def test_overlays_apply_to_the_demo_unless_a_file_defines_the_source(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, content in {
        "config/config.yaml": {"source": {"kind": "analog"}, "rocks": {"rock_cell_mm": 3}},
        "overlay.yaml": {"run": "mine", "rocks": {"ground_mesh_cell_mm": 9}},
        "whole.yaml": {"run": "whole", "source": {"kind": "analog"}},
        "noscan.yaml": {"run": "noscan", "source": {"scans": False}},
    }.items():
        Path(name).parent.mkdir(exist_ok=True)
        Path(name).write_text(yaml.safe_dump(content))
    overlay, whole = Path("overlay.yaml"), Path("whole.yaml")
    assert read_configs([]).rocks.rock_cell_mm == read_configs([overlay]).rocks.rock_cell_mm == 3
    assert read_configs([overlay]).rocks.ground_mesh_cell_mm == 9
    assert read_configs([whole, overlay]).rocks.rock_cell_mm == Config(source={"kind": "analog"}).rocks.rock_cell_mm
    assert (read_configs([whole, overlay]).run, read_configs([overlay, whole]).run) == ("mine", "whole")
    assert base_configuration([overlay, whole]) == []
    without_scans = read_configs([Path("noscan.yaml")])  # an overlay of the demo, not another photo grid
    assert (without_scans.rocks.rock_cell_mm, without_scans.source.scans) == (3, False)
    assert config_of_module({"source": {"scans": False}}, str).terrains == config_of_module({}, str).terrains


@pytest.mark.parametrize(
    ("overlay", "setting", "named"),
    [
        ("terains: [1]", (), ["overlay.yaml"]),
        ("rocks: {rock_cell_mm: -1}", (), ["overlay.yaml"]),
        ("rocks: {ground_mesh_cell_mm: 9}", ("rocks={rock_cell_mm: wide}",), ["--config"]),
        ("positions: [D]", (), ["config/config.yaml", "overlay.yaml"]),
    ],
)
def test_an_error_names_the_file_of_the_key(tmp_path, monkeypatch, overlay, setting, named):
    monkeypatch.chdir(tmp_path)
    Path("config").mkdir()
    Path("config/config.yaml").write_text("source: {kind: analog}\nrocks: {rock_cell_mm: 3}\n")
    Path("overlay.yaml").write_text(overlay)
    with pytest.raises(ConfigError) as caught:
        read_configs([Path("overlay.yaml")], setting)
    assert {name for name in ("config/config.yaml", "overlay.yaml", "--config") if name in str(caught.value)} == set(
        named
    )
