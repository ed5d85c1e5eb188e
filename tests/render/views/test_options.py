"""Views files: errors are reported in a single line with file and key."""

import re
from pathlib import Path

import pytest
import yaml

from polarsim.errors import ConfigError
from polarsim.render.views.options import read_views

VIEWS = {
    "scenes": [{"name": "one", "meshes": "meshes", "terrain": 1}],
    "cameras": [{"kind": "point", "position_m": [2, 0, 1], "look_at_m": [0, 0, 0]}],
    "lights": [{"kind": "sun", "azimuth_deg": [30], "elevation_deg": [10]}],
}
CAMERA, LIGHT = VIEWS["cameras"][0], VIEWS["lights"][0]


def test_the_example_has_1000_images_of_one_terrain():
    views = read_views(Path(__file__).parents[3] / "config/views.yaml")
    cameras = sum(section.number for section in views.cameras)
    lights = sum(
        len(getattr(light, "azimuth_deg", "1")) * len(getattr(light, "elevation_deg", "1")) for light in views.lights
    )
    each = len(views.rover_light.states) * len(views.render.models) * len(views.exposures_ms)
    assert cameras * lights * each == 1000
    assert len(views.scenes) == 1


def test_mesh_paths_are_relative_to_the_views_file_or_a_parent_folder(tmp_path, monkeypatch):
    (tmp_path / "clone/results/demo/meshes").mkdir(parents=True)
    (tmp_path / "clone/config/beside").mkdir(parents=True)
    for name, stated, wanted in (
        ("config/one.yaml", "results/demo/meshes", "clone/results/demo/meshes"),
        ("config/two.yaml", "beside", "clone/config/beside"),
    ):
        scene = {"name": "one", "meshes": stated, "terrain": 1}
        (tmp_path / "clone" / name).write_text(yaml.safe_dump(VIEWS | {"scenes": [scene]}))
        for folder in (tmp_path, tmp_path / "clone", tmp_path / "clone/config"):
            monkeypatch.chdir(folder)
            meshes = read_views(tmp_path / "clone" / name).scenes[0].meshes
            assert meshes.resolve() == (tmp_path / wanted).resolve()


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"camera": []}, "camera"),
        ({"lights": []}, "lights"),
        ({"scenes": None}, "scenes"),
        ({"cameras": [{**CAMERA, "kind": "balloon"}]}, "cameras.0"),
        ({"cameras": [{"position_m": [0, 0, 1]}]}, "cameras.0.kind"),
        ({"cameras": [{**CAMERA, "look_at": [0, 0, 0]}]}, "cameras.0.point.look_at"),
        ({"cameras": [{"kind": "orbit", "height_m": 1, "number": 3}]}, "cameras.0.orbit.radius_m"),
        ({"cameras": [{**CAMERA, "name": "a_b"}]}, "cameras.0.point.name"),
        (
            {"cameras": [{"kind": "random", "number": 1, "low_m": [0, 0, 1], "high_m": [1, 1, 0]}]},
            "cameras.0.random",
        ),
        ({"lights": [{**LIGHT, "elevation_deg": [0]}]}, "lights.0.sun.elevation_deg.0"),
        ({"lights": [{**LIGHT, "azimuth_deg": [float("nan")]}]}, "lights.0.sun.azimuth_deg.0"),
        ({"exposures_ms": [64, "rendered"]}, "exposures_ms.1"),
        ({"exposures_ms": [64, 64]}, "exposures_ms"),
        ({"scenes": VIEWS["scenes"] * 2}, "scenes: name"),
        ({"render": {"modles": ["hapke"]}}, "render.modles"),
    ],
)
def test_an_invalid_key_or_value_is_reported_in_one_line(tmp_path, change, key):
    path = tmp_path / "views.yaml"
    path.write_text(yaml.safe_dump(VIEWS | change))
    with pytest.raises(ConfigError, match=re.escape(key)) as error:
        read_views(path)
    assert error.value.path == path
    assert "\n" not in str(error.value)
