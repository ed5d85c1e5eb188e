"""Table of the rover's parts."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from polarsim.errors import ConfigError
from polarsim.rover.vehicle.table import WHEELS, read_vehicle

VIPER = Path(__file__).parents[3] / "config" / "viper.yaml"


def test_viper_is_as_published():
    viper = read_vehicle(VIPER)
    assert viper.mass == pytest.approx(430)
    assert viper.wheelbase == pytest.approx(1.284)
    assert {"ncl", "ncr", "acl", "acr", "hfp", "hfs", "hap", "has"} <= {camera.name for camera in viper.cameras}
    assert len(viper.lights) == 8
    # Chrono's wheels are at +-0.6418, +-0.6098 m.
    signs = [[1 if code[1] == "f" else -1, 1 if code[0] == "l" else -1] for code in WHEELS]
    np.testing.assert_allclose(viper.wheel_centres[:, :2], [0.6418, 0.6098] * np.array(signs), atol=5e-4)
    assert viper.camera("ncl").position_m[1] > viper.camera("ncr").position_m[1]
    assert viper.camera("acl").position_m[1] < viper.camera("acr").position_m[1]  # they look backwards
    assert viper.camera("CamBirdViewLeft").focal == pytest.approx(960)  # 1920 px, 90 degrees
    assert viper.camera("ncl").focal == pytest.approx(1024 / math.tan(math.radians(35)))


def changed(tmp_path, change):
    content = yaml.safe_load(VIPER.read_text())
    change(content)
    path = tmp_path / "rover.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize(
    ("change", "key"),
    [
        (lambda c: c["wheels"].pop(), "wheels"),
        (lambda c: c["wheels"][1].update(grousers=0), "wheel rf: grousers 0"),
        (lambda c: c["wheels"][1].update(grouser_height_m=0), "wheel rf: grousers 24"),
        (lambda c: c["chassis"].update(mass_kg=-1), "chassis.mass_kg"),
        (lambda c: c.update(wings=2), "wings"),
        (lambda c: c["cameras"][0].update(link="tail"), "camera ncl"),
        (lambda c: c["cameras"][0].update(focal_px=1000), "focal_px"),
        (lambda c: c["lights"].append(c["lights"][0]), "light navlight_left"),
    ],
)
def test_the_error_of_an_invalid_table_has_file_and_key(tmp_path, change, key):
    with pytest.raises(ConfigError, match=rf"rover\.yaml: .*{key}"):
        read_vehicle(changed(tmp_path, change))


def test_a_missing_table_and_an_unknown_camera_are_errors(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.yaml"):
        read_vehicle(tmp_path / "none.yaml")
    with pytest.raises(ConfigError, match="tail"):
        read_vehicle(VIPER).camera("tail")
