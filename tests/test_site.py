"""Sites: NASA's is a file, and another one has other terrains, lamps, exposures and images."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from polarsim.config import parse_config
from polarsim.errors import ConfigError, LabelError
from polarsim.formats.files import resolve_packaged
from polarsim.formats.yaml_files import read_yaml
from polarsim.photo import PhotoKey
from polarsim.render.lamps import first_tripod
from polarsim.rover.world.options import WorldOptions
from polarsim.site import Site, polar, read_site, site_of
from tests.support.other_site import CONTENT, one_camera, other_rig, other_site

CHECKOUT = Path(__file__).parents[1]


def test_photos_of_another_site_have_its_names():
    site = other_site()
    keys = [str(key) for key in site.photos_of("yard-b")]
    assert len(keys) == 2 * 2 * 2 * (2 * 3 + 1)  # positions, lights, cameras; lamps with exposures, and without lamp
    assert keys[0] == "yard-b_gate_off_no_L_0640"
    assert "yard-b_mast_on_135_R_0160" in keys
    assert [site.key(key) for key in keys] == list(site.photos_of("yard-b"))


def test_a_site_with_one_camera_has_half_the_photos():
    keys = list(one_camera().photos_of("yard-a"))
    assert {key.camera for key in keys} == {"L"}
    assert 2 * len(keys) == len(list(other_site().photos_of("yard-a")))


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("01_A_off_30_L_0256", ("terrain", "position", "azimuth", "exposure")),
        ("yard-a_gate_off_45_R_0020", ("exposure",)),
        ("yard-a_gate_off_45_R_40", ("exposure",)),
        ("yard-c_gate_off_45_R_0040", ("terrain",)),
    ],
)
def test_wrong_fields_of_a_key_are_named_with_the_names_of_the_site(text, named):
    with pytest.raises(LabelError) as caught:
        other_site().key(text)
    assert [
        field for field in ("terrain", "position", "azimuth", "exposure") if f"{field} '" in caught.value.reason
    ] == [*named]


def test_a_run_of_another_site_selects_all_that_the_site_has():
    config = parse_config({"site": CONTENT, "source": {"kind": "analog", "root": "data"}})
    assert (config.terrains, config.positions) == (("yard-a", "yard-b"), ("gate", "mast"))
    assert config.grid.azimuths == ("no", "45", "135")
    assert config.labels.seeds.azimuths == ("45", "135")
    with pytest.raises(ConfigError, match="azimuths: '30'"):
        parse_config({"site": CONTENT, "source": {"kind": "analog", "root": "data"}, "grid": {"azimuths": [30]}})


def test_the_ground_of_drives_is_that_of_the_site():
    source = {"source": {"kind": "analog", "root": "data"}}
    world = parse_config(source | {"site": CONTENT}).rover.world
    assert (world.terrain_m, world.width_m, world.terrains) == (2.5, 7.0, ("yard-a", "yard-b"))
    asked = {"world": {"terrain_m": 2.0, "terrains": ["yard-b"]}}
    world = parse_config(source | {"site": CONTENT, "rover": asked}).rover.world
    assert (world.terrain_m, world.width_m, world.terrains) == (2.0, 7.0, ("yard-b",))
    assert parse_config(source).rover.world == WorldOptions()


def test_an_overlay_of_polars_drives_needs_the_terrains_of_the_site_and_null_selects_all():
    overlay = read_yaml(resolve_packaged("config/overlays/rover.yaml"))["rover"]
    source = {"kind": "files", "root": "data"}
    with pytest.raises(ConfigError, match=r"rover\.world\.terrains: 3, expected yard-a or yard-b"):
        parse_config({"site": CONTENT, "source": source, "rover": overlay})
    world = overlay["world"] | {"terrains": None}
    drive = parse_config({"site": CONTENT, "source": source, "rover": overlay | {"world": world}}).rover
    assert drive.world.terrains == ("yard-a", "yard-b")


@pytest.mark.parametrize("factor", [0.5, 1.0, 10.0])
def test_a_site_without_surveyed_positions_is_seen_under_the_same_angle_at_any_size(factor):
    sandbox = CONTENT["sandbox"] | {"half_width_m": [2.0 * factor, factor]}
    site = other_site(tripods={}, sandbox=sandbox)
    np.testing.assert_allclose(first_tripod(site).camera_m, np.multiply(factor, [3.5, 0, 1.5]))


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"terrains": ["yard-a", 1]}, "terrains:"),
        ({"terrains": ["yard_a"]}, "terrains"),
        ({"lamps": {}, "rig_lamp": None}, "lamps:"),
        ({"cameras": {"stereo": True}}, "cameras"),
        ({"exposures_no_sun_ms": []}, "exposures_no_sun_ms"),
        ({"images": {"width": 640, "height": 480, "bits": 8, "black": 300}}, "images"),
        ({"tripods": {"roof": {"camera_m": [0, 0, 1], "yaw_deg": 0}}}, "tripods:"),
    ],
)
def test_an_impossible_site_is_a_one_line_error(changes, named):
    with pytest.raises(ConfigError) as caught:
        parse_config({"site": CONTENT | changes, "source": {"kind": "analog", "root": "data"}})
    assert named in caught.value.reason
    assert "\n" not in str(caught.value)


def test_the_default_site_is_that_of_nasa():
    assert parse_config({"source": {"kind": "analog", "root": "data"}}).site == polar()
    assert Site.model_validate(polar().model_dump(mode="json")) == polar()


def test_the_rig_of_the_other_site_has_the_size_of_its_images():
    site, rig = other_site(), other_rig()
    assert (rig.left.width, rig.left.height) == site.images.size
    low, high = site.cameras.baseline_m
    assert low < rig.left_from_right.translation[0] < high


def test_a_key_of_the_form_is_parsed_without_a_site():
    assert PhotoKey.parse("yard-a_gate_on_45_R_0040") == PhotoKey("yard-a", "gate", "on", "45", "R", 40)


@pytest.mark.parametrize("name", ["NA", "nan", "None", "null"])
def test_a_name_that_tables_read_as_a_missing_value_is_refused(name):
    with pytest.raises(ValidationError, match="missing value"):
        other_site(positions=["gate", "mast", name])


def test_content_with_a_base_differs_from_this_site_only_where_stated():
    base = read_site("yard")
    changes = {"base": "yard", "images": {"bits": 14, "black": 64}, "cameras": {"stereo": False, "baseline_m": None}}
    site = Site.model_validate(site_of(changes))
    assert (site.images.bits, site.images.black, site.images.size) == (14, 64, base.images.size)
    assert site.cameras.sides == ("L",)
    assert site.model_copy(update={"images": base.images, "cameras": base.cameras}) == base


@pytest.mark.parametrize("name", ["scenes", "scanned", "tripods_m", "lamp_output"])
def test_the_simulated_sandbox_has_only_terrains_positions_and_lamps_of_the_site(name):
    values = {"scenes": {"yard-z": 3}, "scanned": ["roof"], "tripods_m": {"roof": [0, 0, 1]}, "lamp_output": {"90": 1}}
    with pytest.raises(ValueError, match=f"analog.{name}"):
        other_site(analog={name: values[name]})


@pytest.mark.parametrize("value", [".nan", ".inf", "-.inf"])
@pytest.mark.parametrize("key", ["yaw_deg: 180", "half_width_m: [1.5", "share: 0.035"])
def test_numbers_of_a_site_file_are_finite(tmp_path, key, value):
    name, _, number = key.partition(": ")
    text = (CHECKOUT / "config/sites/yard.yaml").read_text()
    changed = text.replace(key, f"{name}: {'[' if number.startswith('[') else ''}{value}", 1)
    assert changed != text
    (tmp_path / "a.yaml").write_text(changed)
    with pytest.raises(ConfigError, match=name):
        read_site(tmp_path / "a.yaml")


def test_an_unknown_site_is_an_error_with_the_names_of_the_shipped_sites():
    with pytest.raises(ConfigError, match=r"nowhere.*polar-traverse.*yard"):
        read_site("nowhere")


def test_errors_of_a_site_in_a_configuration_name_the_section():
    content = {"source": {"kind": "analog"}, "site": {"base": "yard", "cameras": {"baseline_m": [0.2, 0.1]}}}
    with pytest.raises(ConfigError, match=r"site\.cameras"):
        parse_config(content)
