import json
import struct

import numpy as np
import pytest
import trimesh

from polarsim.formats import obj
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose

PLACES = np.array([[0.2, 0.1, 0.05], [-0.3, -0.2, 0.1], [0.6, -0.5, 0.0]])
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])  # glTF from the sandbox


def tree_of(path):
    content = path.read_bytes()
    size, kind = struct.unpack("<I4s", content[12:20])
    assert kind == b"JSON"
    return json.loads(content[20 : 20 + size])


def test_gltf_keeps_meshes_names_and_ids(published, catalogue):
    scene = trimesh.load(published("gltf") / "terrain01.glb")
    terrain = catalogue.terrains[1]
    assert set(scene.geometry) == {"ground", "rock4", "rock7"}
    for rock, path in terrain.meshes.items():
        name = "ground" if rock == -1 else f"rock{rock}"
        body = scene.geometry[name]
        assert body.metadata["rock_id"] == rock
        assert body.metadata["class"] == ("ground" if rock == -1 else "rock")
        wanted = obj.read_obj(path)
        np.testing.assert_array_equal(body.faces, wanted.faces)
        matrix = scene.graph.get(name)[0][:3, :3]
        np.testing.assert_allclose(body.vertices @ matrix.T, wanted.vertices @ Y_UP.T, atol=1e-6)
    support = scene.geometry["rock4"].vertex_attributes["_SUPPORT"].ravel()
    np.testing.assert_allclose(support, np.linspace(0, 1, 162), atol=1e-6)  # values of the run's table


def test_added_nodes_conform_to_the_error_rules_of_the_validator(published):
    """Khronos' validator: used extensions, a tree of nodes, clipping distances. trimesh writes the meshes."""
    tree = tree_of(published("gltf") / "terrain01.glb")
    assert set(tree.get("extensionsUsed", [])) == set(tree.get("extensions", {})) == {"KHR_lights_punctual"}
    children = [child for one in tree["nodes"] for child in one.get("children", [])]
    roots = tree["scenes"][tree["scene"]]["nodes"]
    assert len(set(children)) == len(children)
    assert sorted([*children, *roots]) == list(range(len(tree["nodes"])))
    assert all(camera["perspective"]["zfar"] > camera["perspective"]["znear"] > 0 for camera in tree["cameras"])


def test_gltf_cameras_project_points_correctly_and_lamps_have_the_true_positions(published, catalogue):
    tree = tree_of(published("gltf") / "terrain01.glb")
    terrain = catalogue.terrains[1]
    nodes = {one["name"]: one for one in tree["nodes"]}
    for side in "LR":
        node = nodes[f"PosA_Cam{side}"]
        stated = tree["cameras"][node["camera"]]["extras"]
        gltf_from_camera = np.array(node["matrix"]).reshape(4, 4).T
        local = (np.linalg.inv(gltf_from_camera) @ np.c_[PLACES @ Y_UP.T, np.ones(3)].T)[:3].T * [1, -1, -1]
        lens = Lens(
            *(stated[name] for name in ("fx_px", "fy_px", "cx_px", "cy_px")),
            tuple(stated[name] for name in ("k1", "k2", "p1", "p2", "k3")),
            width=stated["width_px"],
            height=stated["height_px"],
        )
        np.testing.assert_allclose(lens.project(local), terrain.rigs["A"].project(side, PLACES), atol=1e-3)
    np.testing.assert_allclose(nodes["sun_180"]["translation"], Y_UP @ terrain.suns["180"], atol=1e-9)
    assert nodes["sun_180"]["extras"]["origin"] == "fitted"
    assert nodes["sun_30"]["extras"]["origin"] == "synthetic"


@pytest.fixture
def stage(published):
    pytest.importorskip("pxr")
    from pxr import Usd

    return Usd.Stage.Open(str(published("usd") / "terrain01.usdc"))


def test_usd_passes_every_validator(stage):
    from pxr import UsdValidation

    registry = UsdValidation.ValidationRegistry()
    validators = registry.GetOrLoadAllValidators()
    assert len(validators) > 10
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [error.GetMessage() for error in found if error.GetType() == UsdValidation.ValidationErrorType.Error] == []


def test_usd_keeps_meshes_with_semantics(stage, catalogue):
    from pxr import UsdGeom, UsdSemantics

    for rock, path in catalogue.terrains[1].meshes.items():
        prim = stage.GetPrimAtPath("/World/ground" if rock == -1 else f"/World/rock{rock}")
        mesh, wanted = UsdGeom.Mesh(prim), obj.read_obj(path)
        np.testing.assert_array_equal(np.array(mesh.GetPointsAttr().Get()), wanted.vertices.astype(np.float32))
        np.testing.assert_array_equal(np.array(mesh.GetFaceVertexIndicesAttr().Get()), wanted.faces.ravel())
        labels = {name: UsdSemantics.LabelsAPI(prim, name).GetLabelsAttr().Get() for name in ("class", "rock_id")}
        assert list(labels["class"]) == ["ground" if rock == -1 else "rock"]
        assert rock == -1 or list(labels["rock_id"]) == [str(rock)]


def test_usd_cameras_project_points_like_a_pinhole_camera(stage, catalogue):
    from pxr import Gf, UsdGeom

    localised = catalogue.terrains[1].rigs["A"]
    for side in "LR":
        camera, lens = UsdGeom.Camera(stage.GetPrimAtPath(f"/World/PosA_Cam{side}")), localised.rig.lens(side)
        frustum = camera.GetCamera().frustum
        both = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
        pinhole = Lens(lens.fx, lens.fy, lens.cx, lens.cy, width=lens.width, height=lens.height)
        wanted = Camera(localised.sandbox_from(side), pinhole).project(PLACES)
        for place, pixel in zip(PLACES, wanted, strict=True):
            x, y, _ = both.Transform(Gf.Vec3d(*place))
            found = [(x + 1) / 2 * lens.width, (1 - y) / 2 * lens.height]
            np.testing.assert_allclose(found, pixel, atol=1e-3, rtol=0)
        terms = [camera.GetPrim().GetAttribute(f"polarsim:{name}").Get() for name in ("k1", "k2", "p1", "p2", "k3")]
        assert tuple(terms) == lens.distortion
        found = UsdGeom.Xformable(camera).ComputeLocalToWorldTransform(0)
        pose = Pose.from_matrix(np.array(found).T @ np.diag([1, -1, -1, 1]))
        np.testing.assert_allclose(pose.matrix, localised.sandbox_from(side).matrix, atol=1e-12)
