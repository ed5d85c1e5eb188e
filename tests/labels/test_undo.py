"""Labels derived from an annotation disappear when the annotation is excluded."""

import shlex
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError

from polarsim.config import parse_config
from polarsim.errors import ConfigError, LabelError
from polarsim.formats.tables import read_parquet
from polarsim.labels import undo
from polarsim.labels.label import Label
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import propagate_labels
from polarsim.labels.undo import derived_labels, label_changes
from polarsim.photo import PhotoKey
from polarsim.running.configuration import read_configs, store_config
from polarsim.site import polar

from .conftest import TERRAIN

SEED = PhotoKey.parse("03_A_off_180_L_0256")
KEYS = [
    key
    for key in polar().photos_of(TERRAIN)
    if key.position == "A" and key.exposure_ms in (128, 1024) and key.azimuth in ("30", "180")
]
OPTIONS = LabelsOptions(ray_step_px=4, visibility="annotator")


def label(x0: float, kind: str = "rock", rock: int = 4) -> Label:
    return Label(kind, rock, "fused", 0.9, np.array([x0, 0.0, x0 + 20, 30]))


def test_changed_labels_are_gone_moved_or_new():
    key = KEYS[0]
    now = {key: [label(0), label(50, rock=5), label(80, "shadow"), label(100, rock=6)]}
    then = {key: [label(0.4), label(53, rock=5), label(80, "shadow"), label(200, rock=7)]}
    found = label_changes(now, then)
    assert found[["rock", "change"]].to_numpy().tolist() == [[5, "moved"], [6, "gone"], [7, "new"]]
    assert found["moved_px"].tolist()[0] == 3
    assert label_changes(then, now)["change"].tolist() == ["moved", "new", "gone"]
    assert label_changes(now, now).empty


def test_two_labels_of_one_rock_are_compared_in_their_order():
    found = label_changes({KEYS[0]: [label(0), label(300)]}, {KEYS[0]: [label(310), label(0)]})
    assert found["moved_px"].tolist() == [10]


def test_derived_labels_are_missing_in_a_run_without_the_seed(scene, tmp_path):
    found = derived_labels(drawing=SEED, inputs=scene.inputs(KEYS), options=OPTIONS, out=tmp_path / "undone.parquet")
    assert read_parquet(tmp_path / "undone.parquet").equals(found)
    assert "03_A_on_180_L_0128" in set(found["key"])  # another light of the same lamp

    def table(name, **options):
        chosen = OPTIONS.model_copy(update=options)
        out = {"boxes": tmp_path / name, "table": tmp_path / f"{name}.parquet"}
        propagate_labels(scene.inputs(KEYS), options=chosen, **out)
        return read_parquet(tmp_path / f"{name}.parquet")

    undone = table("undone", excluded_annotations=(str(SEED),))
    (scene.seeds / f"{SEED}.txt").unlink()
    never = table("never")
    assert undone.equals(never)


def test_only_annotated_photos_can_be_excluded(scene, tmp_path):
    options = OPTIONS.model_copy(update={"excluded_annotations": (str(SEED),)})
    with pytest.raises(LabelError, match=str(SEED)):
        derived_labels(
            drawing=SEED,
            inputs=scene.inputs(KEYS),
            options=options,
            out=tmp_path / "a.parquet",
        )


def test_an_invalid_photo_key_cannot_be_excluded():
    with pytest.raises(ValidationError, match="03_A_off_30_L_256"):
        LabelsOptions(excluded_annotations=("03_A_off_30_L_256",))
    with pytest.raises(ConfigError, match=r"03_A_off_99_L_0256.* azimuth '99'"):  # not a lamp of the site
        parse_config({"source": {"kind": "analog"}, "labels": {"excluded_annotations": ["03_A_off_99_L_0256"]}})


def test_undo_reports_a_photo_without_annotation(polarsim, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "config.yaml").write_text("source: {kind: analog}\n")
    (tmp_path / "results/demo").mkdir(parents=True)
    done = polarsim("undo", SEED, "--configfile", "config.yaml")
    assert done.returncode == 1
    assert done.stderr.endswith(f"seeds: no seed and no correction of {SEED}\n")


@pytest.mark.parametrize("files", [(), ("base.yaml", "my overlay.yaml")], ids=["stored", "overlays"])
def test_undo_prints_the_command_of_the_run_with_its_configuration(polarsim, tmp_path, monkeypatch, files):
    """The command is read by a shell and by the workflow, and excludes the annotation from the same configuration."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "base.yaml").write_text("{run: mine, source: {kind: analog}, labels: {corrections: edited}}\n")
    (tmp_path / "my overlay.yaml").write_text("labels: {excluded_annotations: [03_B_off_30_L_0256]}\n")
    config = read_configs([Path("base.yaml"), Path("my overlay.yaml")])
    store_config(config, tmp_path / "results/mine")
    seeds = tmp_path / "results/mine/acquire/Terrain03/seeds"
    seeds.mkdir(parents=True)
    (seeds / f"{SEED}.txt").write_text("0 0.5 0.5 0.1 0.1\n")
    changed = pd.DataFrame([(str(SEED), "rock", 1, "gone", np.nan)], columns=list(undo.COLUMNS))
    monkeypatch.setattr(undo, "derived_labels", lambda **_: changed)
    done = polarsim("undo", SEED, "--run", "mine", *(word for file in files for word in ("--configfile", file)))
    assert done.returncode == 0, done.stderr
    assert f"1 photo with labels derived from {SEED}" in done.stdout
    program, command, *words = shlex.split(done.stdout.splitlines()[-1])
    assert (program, command) == ("polarsim", "run")
    values = {option: [second for first, second in pairwise(words) if first == option] for option in words[::2]}
    repeated = read_configs([Path(file) for file in values["--configfile"]], values["--config"])
    assert repeated.labels.excluded_annotations == ("03_B_off_30_L_0256", str(SEED))
    assert repeated.labels.corrections == config.labels.corrections
    assert repeated.run == "mine"
