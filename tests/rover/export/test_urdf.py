"""The URDF agrees with the vehicle's table and is readable by MuJoCo."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from polarsim.rover.export.urdf import urdf, write_urdf
from polarsim.rover.vehicle.mounts import base_from_camera
from polarsim.rover.vehicle.table import WHEELS, read_vehicle

VEHICLE = read_vehicle(Path(__file__).parents[3] / "config/viper.yaml")


@pytest.fixture(scope="module")
def model():
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    # Without this, MuJoCo merges the root link with the world and ignores its mass.
    free = '<mujoco><compiler fusestatic="true"/></mujoco>'
    text = urdf(VEHICLE).replace('<robot name="viper">', f'<robot name="viper">{free}<link name="world"/>', 1)
    joint = '<joint name="floating" type="floating"><parent link="world"/><child link="base_link"/></joint>'
    return mujoco.MjModel.from_xml_string(text.replace("</robot>", f"{joint}</robot>"))


def test_joints_masses_limits_and_positions_in_mujoco_are_those_of_the_table(model):
    import mujoco

    joints = [model.joint(number).name for number in range(model.njnt)]
    assert {f"{code}_{name}" for code in WHEELS for name in ("lift", "steer", "spin")} <= set(joints)
    assert len(joints) == 12 + 1  # and the free joint of the body
    assert model.body_mass.sum() == pytest.approx(430.0, abs=1e-6)
    assert model.joint("lf_steer").range == pytest.approx(np.radians([-90, 90]))
    assert model.joint("rr_lift").range == pytest.approx([-0.15, 0.15])
    assert not model.joint("lr_spin").limited[0]
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    base = data.body("base_link").xpos
    for wheel in VEHICLE.wheels:
        np.testing.assert_allclose(data.body(f"{wheel.code}_wheel").xpos - base, wheel.position_m, atol=1e-9)
    # The top of the rim moves forward if the angle grows.
    np.testing.assert_allclose(np.cross(model.joint("lf_spin").axis, [0, 0, 1]), [1, 0, 0])


def mounted(root: ET.Element, name: str) -> tuple[list[float], np.ndarray]:
    """Return position and rotation (3, 3) of a part."""
    origin = root.find(f"joint[@name='{name}_mount']/origin")
    xyz, rpy = ([float(value) for value in origin.get(key).split()] for key in ("xyz", "rpy"))
    return xyz, Rotation.from_euler("xyz", rpy).as_matrix()


def test_poses_of_cameras_and_lights_are_those_of_the_table():
    root = ET.fromstring(urdf(VEHICLE))
    camera, (_, rotation) = VEHICLE.camera("hap"), mounted(root, "hap")
    expected = base_from_camera(np.array(camera.position_m), camera.yaw_deg, camera.pitch_deg, camera.roll_deg)
    np.testing.assert_allclose(rotation, expected.rotation, atol=1e-8)
    assert rotation[0, 2] < -0.8  # the axis of an aft camera points backwards
    assert root.find("joint[@name='CamBirdViewLeft_mount']") is None
    beams = {}
    for light in VEHICLE.lights:
        position, rotation = mounted(root, light.name)
        assert position == pytest.approx(light.position_m)
        beams[light.name] = rotation[:, 0]
    assert len(beams) == 8
    down = np.radians(25)
    np.testing.assert_allclose(beams["hazlight_fore_port"], [np.cos(down), 0, -np.sin(down)], atol=1e-8)
    np.testing.assert_allclose(beams["hazlight_centre_port"], [0, np.cos(down), -np.sin(down)], atol=1e-8)


def test_all_links_except_the_base_have_a_parent_joint():
    root = ET.fromstring(urdf(VEHICLE))
    links = {link.get("name") for link in root.iter("link") if link in list(root)}
    children = [child.get("link") for child in root.iter("child")]
    assert sorted(children) == sorted(links - {"base_link"})


def test_equal_tables_have_equal_bytes(tmp_path):
    for name in ("one", "two"):
        write_urdf(tmp_path / name, VEHICLE)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
