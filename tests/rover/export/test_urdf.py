"""The URDF is the vehicle's table, and another program reads it."""

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
    # Without this MuJoCo welds the root link to the world and forgets its mass.
    free = '<mujoco><compiler fusestatic="true"/></mujoco>'
    text = urdf(VEHICLE).replace('<robot name="viper">', f'<robot name="viper">{free}<link name="world"/>', 1)
    joint = '<joint name="floating" type="floating"><parent link="world"/><child link="base_link"/></joint>'
    return mujoco.MjModel.from_xml_string(text.replace("</robot>", f"{joint}</robot>"))


def test_mujoco_reads_twelve_joints_and_the_whole_mass(model):
    names = [f"{code}_{name}" for code in WHEELS for name in ("lift", "steer", "spin")]
    found = [model.joint(number).name for number in range(model.njnt)]
    assert set(names) <= set(found)
    assert len(found) == 12 + 1  # and the body's freedom
    assert model.body_mass.sum() == pytest.approx(430.0, abs=1e-6)


def test_limits_are_the_tables(model):
    assert model.joint("lf_steer").range == pytest.approx(np.radians([-90, 90]))
    assert model.joint("rr_lift").range == pytest.approx([-0.15, 0.15])
    assert not model.joint("lr_spin").limited[0]


def test_wheels_stand_where_the_table_has_them(model):
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    base = data.body("base_link").xpos
    for wheel in VEHICLE.wheels:
        np.testing.assert_allclose(data.body(f"{wheel.code}_wheel").xpos - base, wheel.position_m, atol=1e-9)


def test_a_positive_rotation_of_a_wheel_drives_forward(model):
    axis = model.joint("lf_spin").axis
    np.testing.assert_allclose(np.cross(axis, [0, 0, 1]), [1, 0, 0])  # the rim's top goes ahead


def test_cameras_look_where_the_table_has_them():
    root = ET.fromstring(urdf(VEHICLE))
    camera = VEHICLE.camera("hap")
    origin = root.find("joint[@name='hap_mount']/origin")
    rotation = Rotation.from_euler("xyz", [float(value) for value in origin.get("rpy").split()]).as_matrix()
    expected = base_from_camera(np.array(camera.position_m), camera.yaw_deg, camera.pitch_deg, camera.roll_deg)
    np.testing.assert_allclose(rotation, expected.rotation, atol=1e-8)
    assert rotation[0, 2] < -0.8  # an aft camera's axis points back
    assert root.find("joint[@name='CamBirdViewLeft_mount']") is None


def test_lights_shine_where_the_table_says():
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


def test_every_link_but_the_base_has_one_joint_above_it():
    root = ET.fromstring(urdf(VEHICLE))
    links = {link.get("name") for link in root.iter("link") if link in list(root)}
    children = [child.get("link") for child in root.iter("child")]
    assert sorted(children) == sorted(links - {"base_link"})


def test_the_same_table_has_the_same_bytes(tmp_path):
    for name in ("one", "two"):
        write_urdf(tmp_path / name, VEHICLE)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()
