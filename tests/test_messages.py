"""Messages about missing folders, unknown names and invalid values."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from polarsim.errors import ConfigError
from polarsim.formats import png, yolo
from polarsim.running.configuration import check_config
from tests.support.polar_photos import SIZE

KEY = "01_A_off_30_L_0256"
WORDS_OF_LIBRARIES = re.compile(
    r"Tuple|dictionary|instance of|valid (integer|number|tuple|boolean|string)|[Pp]ydantic|function-"
)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    yolo.write_boxes(Path("boxes") / f"{KEY}.txt", np.array([0]), np.array([[5.0, 5, 50, 60]]), size=SIZE)
    for folder in ("empty", "results/demo/renders/hapke/Terrain01", "results/demo/labels/boxes/Terrain01"):
        Path(folder).mkdir(parents=True)
    png.write_png(Path(f"results/demo/renders/hapke/Terrain01/{KEY}.png"), np.zeros((1216, 1936), np.uint16))
    return tmp_path


@pytest.mark.parametrize(
    "call",
    [
        ("render", "FOLDER", "out.png"),
        ("validate", "FOLDER"),
        ("masks", "FOLDER", "out"),
        ("score", "FOLDER", "boxes"),
        ("score", "boxes", "FOLDER"),
        ("import", "FOLDER", "out"),
        ("detect", "FOLDER", "--out", "out"),
        ("ipd", "FOLDER", "boxes", "boxes", "boxes"),
        ("ipd", "boxes", "FOLDER", "boxes", "boxes"),
        ("explore", "demo", "--results", "FOLDER"),
        ("drive", "--results", "FOLDER"),
        ("undo", KEY, "--results", "FOLDER"),
    ],
    ids=" ".join,
)
def test_missing_and_empty_folders_are_distinguished(polarsim, here, call):
    lines = {}
    for folder in ("nosuch", "empty"):
        done = polarsim(*(folder if word == "FOLDER" else word for word in call))
        assert done.returncode == 1
        (lines[folder],) = done.stderr.splitlines()
        assert folder in lines[folder]
    assert "no such" in lines["nosuch"]
    assert "no such" not in lines["empty"]


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (("show", KEY, "--domain", "hapki"), ["hapki", "photo, hapke"]),
        (("export", "out", "--domain", "nope"), ["nope", "photo, hapke"]),
        (("export", "out", "--terrain", "4"), ["terrain 4", "1"]),
        (("export", "out", "--terrain", "1", "--terrain", "4"), ["terrain 4", "1"]),
        (("show", "3_A_on_350_R_256"), ["terrain '3'", "exposure '256'"]),
        (("undo", "01_G_on_350_R_0256", "--configfile", "config/config.yaml"), ["position 'G'", "A, B or C"]),
    ],
    ids=lambda value: " ".join(value),
)
def test_an_unknown_name_is_listed_with_valid_names(polarsim, here, call, named):
    Path("results/demo/meshes/Terrain01").mkdir(parents=True)
    done = polarsim(*call)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert all(name in line for name in named)
    assert not Path("out").exists()


WRONG = [
    ({"terrains": ["three"]}, "terrains.0"),
    ({"terrains": []}, "terrains"),
    ({"terrains": 3}, "terrains"),
    ({"terrains": [1.5]}, "terrains.0"),
    ({"positions": [3]}, "positions.0"),
    ({"run": 3}, "run"),
    ({"render": 5}, "render"),
    ({"render": {"models": "hapke"}}, "render.models"),
    (
        {"render": {"materials": {"default": {"principled": {"roughness": "x"}}}}},
        "render.materials.default.principled.roughness",
    ),
    ({"render": {"materials_from_photos": "maybe"}}, "render.materials_from_photos"),
    ({"detect": {"training": {"pretrained": 3}}}, "detect.training.pretrained"),
    ({"detect": {"mixes": {"a": {"b": "x"}}}}, "detect.mixes.a.b"),
    ({"detect": {"views": 3}}, "detect.views"),
    ({"labels": {"seeds": {"exposure": "good"}}}, "labels.seeds.exposure"),
    ({"labels": {"min_shadow_exposure_ms_by_terrain": {"x": 1}}}, "labels.min_shadow_exposure_ms_by_terrain.x"),
    ({"rover": {"cameras": {"onboard": {"weights": 4}}}}, "rover.cameras.onboard.weights"),
    ({"rover": {"world": {"dem": {"centre_m": [1, 2, 3]}}}}, "rover.world.dem.centre_m"),
    ({"gap": {"components": {"a": 3}}}, "gap.components.a"),
]


@pytest.mark.parametrize(("content", "key"), WRONG, ids=[f"{key}-{number}" for number, (_, key) in enumerate(WRONG)])
def test_an_invalid_value_is_described_once_by_its_key(content, key):
    with pytest.raises(ConfigError) as caught:
        check_config({"source": {"kind": "analog"}, **content}, [])
    message = str(caught.value)
    assert message[0].isalpha()
    assert len(re.findall(rf"(?:^|[ ;]){re.escape(key)}:", message)) == 1
    assert not WORDS_OF_LIBRARIES.search(message)
