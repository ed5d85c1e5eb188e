import numpy as np
import pytest

from polarsim.formats import obj
from polarsim.formats.files import read_json, write_json
from polarsim.formats.tables import read_parquet, write_parquet
from polarsim.geometry.poses import Pose, angle_between
from polarsim.run_files import walls
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.lamps import read_localised_suns
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.walls import level_walls, write_walls
from polarsim.scoring.true_scene import thin_meshes, write_true_scene
from polarsim.site import polar

SANDBOX_FROM_TRUTH = Pose.from_rotvec(np.array([0.01, -0.02, 0.05]), np.array([0.1, -0.05, 0.02]))


@pytest.fixture
def laid(world, tmp_path):
    """Truth in the frame of a run with correct results in a different frame and a single rock of two."""
    world.write(tmp_path / "truth")
    write_json(tmp_path / "truth/lamps.json", {"rover_A": [0.0, 0.0, 1.0], **read_json(tmp_path / "truth/lamps.json")})
    world.write(tmp_path / "run", SANDBOX_FROM_TRUTH, rocks=(2,))
    meshes = tmp_path / "run/meshes"  # runs have independent rock ids
    (meshes / obj.rock_name(world.terrain, 2)).rename(meshes / obj.rock_name(world.terrain, 9))
    write_parquet(tmp_path / "run/rocks.parquet", read_parquet(tmp_path / "run/rocks.parquet").assign(rock=9))
    write_walls(tmp_path / "run/meshes", level_walls(2.02, 0.31, "scans"))
    write_inventory(tmp_path / "inventory.json", Inventory(world.terrain, "analog"))
    write_true_scene(
        site=polar(),
        terrain=world.terrain,
        rocks=tmp_path / "run/rocks.parquet",
        meshes=tmp_path / "run/meshes",
        located=tmp_path / "run/cameras",
        inventory=tmp_path / "inventory.json",
        truth=tmp_path / "truth",
        true_cameras=tmp_path / "laid/cameras",
        true_meshes=tmp_path / "laid/meshes",
    )
    return tmp_path


def test_true_cameras_and_lamps_are_in_the_frame_of_the_run(laid, sun_lamps):
    found, ours = read_all_localised(laid / "laid/cameras"), read_all_localised(laid / "run/cameras")
    assert sorted(found) == sorted(ours)
    for position, rig in found.items():
        pose, own = rig.sandbox_from_left, ours[position].sandbox_from_left
        assert np.linalg.norm(pose.translation - own.translation) < 1e-4
        assert angle_between(pose, own) < 1e-4
    lamps = read_localised_suns(laid / "laid/cameras")
    assert sorted(lamps) == sorted(sun_lamps)  # the rover light is on the rig
    for name, lamp_position in lamps.items():
        np.testing.assert_allclose(lamp_position, SANDBOX_FROM_TRUTH.apply(np.array(sun_lamps[name])), atol=5e-4)


def test_true_meshes_match_the_meshes_and_ids_of_the_run(laid, world):
    names = sorted(path.name for path in (laid / "laid/meshes").iterdir())
    ground, rock, unknown = obj.ground_name(world.terrain), obj.rock_name(world.terrain, 9), 10
    # A rock that the run did not find; the walls are those of the run.
    assert names == sorted([ground, rock, obj.rock_name(world.terrain, unknown), walls.FILE])
    assert (laid / "laid/meshes" / walls.FILE).read_bytes() == (laid / "run/meshes" / walls.FILE).read_bytes()
    for name in (ground, rock):
        true, own = (obj.read_obj(laid / folder / "meshes" / name) for folder in ("laid", "run"))
        np.testing.assert_allclose(true.vertices, own.vertices, atol=5e-4)


def test_thinned_meshes_are_decimated_meshes_if_available(world, tmp_path, cube):
    world.write(tmp_path)
    thin = obj.rock_name(world.terrain, 1, decimated=True)
    obj.write_obj(tmp_path / "meshes" / thin, cube((0.5, 0.4, 0.05), 0.19), "thin")
    write_walls(tmp_path / "meshes", level_walls(2.02, 0.31, "scans"))
    thin_meshes(terrain=world.terrain, meshes=tmp_path / "meshes", thinned=tmp_path / "thinned")
    expected = {obj.ground_name(world.terrain), thin, obj.rock_name(world.terrain, 2), walls.FILE}
    assert {path.name for path in (tmp_path / "thinned").iterdir()} == expected
    assert (tmp_path / "thinned" / thin).read_bytes() == (tmp_path / "meshes" / thin).read_bytes()
