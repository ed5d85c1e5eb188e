import numpy as np
import trimesh

from polarsim.formats import gltf
from polarsim.geometry.meshes import Mesh

GROUND = Mesh(np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
BODY = trimesh.creation.icosphere(1, 0.1)
ROCK = Mesh(np.asarray(BODY.vertices) + np.array([0.3, 0.2, 0.05]), np.asarray(BODY.faces, np.int64))


def test_a_terrain_is_upright_and_has_named_parts(tmp_path):
    support = np.linspace(0, 1, len(ROCK.vertices))
    gltf.write_glb(tmp_path / gltf.name(7), {gltf.GROUND_NODE: GROUND, "rock4": ROCK}, {"rock4": support})
    scene = trimesh.load(tmp_path / "terrain07.glb", process=False)
    assert set(scene.graph.nodes_geometry) == {"ground", "rock4"}
    rock = scene.geometry["rock4"]
    np.testing.assert_array_equal(rock.faces, ROCK.faces)
    np.testing.assert_allclose(np.ravel(rock.vertex_attributes["_SUPPORT"]), support, atol=1e-6)
    high = scene.bounds[1][1]  # +Y is up in glTF
    assert high == np.float32(ROCK.vertices[:, 2].max())


def test_the_same_terrain_gives_the_same_bytes(tmp_path):
    for name in ("a.glb", "b.glb"):
        gltf.write_glb(tmp_path / name, {gltf.GROUND_NODE: GROUND, "rock1": ROCK}, {})
    assert (tmp_path / "a.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()
