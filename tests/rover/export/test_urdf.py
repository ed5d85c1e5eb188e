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


def test_mujoco_finds_twelve_joints_and_the_total_mass(model):
    names = [f"{code}_{name}" for code in WHEELS for name in ("lift", "steer", "spin")]
    joints = [model.joint(number).name for number in range(model.njnt)]
    assert set(names) <= set(joints)
    assert len(joints) == 12 + 1  # and the free joint of the body
    assert model.body_mass.sum() == pytest.approx(430.0, abs=1e-6)


def test_limits_are_those_of_the_table(model):
    assert model.joint("lf_steer").range == pytest.approx(np.radians([-90, 90]))
    assert model.joint("rr_lift").range == pytest.approx([-0.15, 0.15])
    assert not model.joint("lr_spin").limited[0]


def test_wheel_positions_are_those_of_the_table(model):
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    base = data.body("base_link").xpos
    for wheel in VEHICLE.wheels:
        np.testing.assert_allclose(data.body(f"{wheel.code}_wheel").xpos - base, wheel.position_m, atol=1e-9)


def test_a_positive_rotation_of_a_wheel_drives_forward(model):
    axis = model.joint("lf_spin").axis
    np.testing.assert_allclose(np.cross(axis, [0, 0, 1]), [1, 0, 0])  # the top of the rim moves forward


def test_camera_poses_are_those_of_the_table():
    root = ET.fromstring(urdf(VEHICLE))
    camera = VEHICLE.camera("hap")
    origin = root.find("joint[@name='hap_mount']/origin")
    rotation = Rotation.from_euler("xyz", [float(value) for value in origin.get("rpy").split()]).as_matrix()
    expected = base_from_camera(np.array(camera.position_m), camera.yaw_deg, camera.pitch_deg, camera.roll_deg)
    np.testing.assert_allclose(rotation, expected.rotation, atol=1e-8)
    assert rotation[0, 2] < -0.8  # the axis of an aft camera points backwards
    assert root.find("joint[@name='CamBirdViewLeft_mount']") is None


def test_light_poses_are_those_of_the_table():
    root = ET.fromstring(urdf(VEHICLE))
    beams = {}
    for light in VEHICLE.lights:
        origin = root.find(f"joint[@name='{light.name}_mount']/origin")
        rotation = Rotation.from_euler("xyz", [float(value) for value in origin.get("rpy").split()]).as_matrix()
        beams[light.name] = rotation[:, 0]
        assert [float(value) for value in origin.get("xyz").split()] == pytest.approx(light.position_m)
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
