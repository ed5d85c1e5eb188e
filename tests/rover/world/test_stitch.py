"""Terrains side by side."""

import numpy as np
import pytest

from polarsim.errors import FormatError, RoverError
from polarsim.formats import obj
from polarsim.geometry.meshes import Mesh
from polarsim.rover.drive.job import job_of
from polarsim.rover.drive.options import DriveOptions
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.options import WorldOptions
from polarsim.rover.world.stitch import TerrainSolids, fill_holes, read_terrain_meshes, stitch, terrain_centres
from tests.rover.made_world import SMALL, ball, plane


def test_the_first_terrain_is_in_the_east():
    np.testing.assert_allclose(terrain_centres(SMALL), [1.75, -1.75])
    world = stitch(
        [TerrainSolids(4, plane(0.0), {7: ball(0.1, 0.2, 0)}), TerrainSolids(1, plane(0.0), {3: ball(0, 0, 0)})], SMALL
    )
    assert list(world.rocks["terrain"]) == [4, 1]
    assert list(world.rocks["rock_in_terrain"]) == [7, 3]
    np.testing.assert_allclose(world.rocks[["x_m", "y_m"]], [[1.85, 0.2], [-1.75, 0.0]], atol=1e-3)
    np.testing.assert_allclose(world.rocks["height_m"], 0.1, atol=1e-3)
    np.testing.assert_allclose(world.rocks["width_m"], 0.2, atol=5e-3)


def test_grounds_of_equal_slope_join_without_a_seam_at_any_level():
    world = stitch([TerrainSolids(4, plane(-0.2, 0.1), {}), TerrainSolids(1, plane(0.05, 0.1), {})], SMALL)
    centre = np.abs(world.y) < 1.9
    inside = np.abs(world.x) < 3.4
    expected = np.broadcast_to(0.1 * world.y[:, None], world.level.shape)
    np.testing.assert_allclose(world.level[np.ix_(centre, inside)], expected[np.ix_(centre, inside)], atol=1e-6)
    assert np.abs(world.level[:, [0, -1]]).max() < 0.02  # filler ground
    assert np.isfinite(world.level).all()


def test_a_hole_under_a_rock_is_filled_from_its_edge():
    y, x = np.meshgrid(np.arange(12.0), np.arange(15.0), indexing="ij")
    level = 0.1 * x - 0.2 * y
    holed = level.copy()
    holed[3:7, 4:9] = np.nan
    # The membrane over a hole in a plane is the plane.
    np.testing.assert_allclose(fill_holes(holed, np.ones(level.shape, bool)), level, atol=1e-9)


def test_decimated_rocks_are_preferred(tmp_path):
    obj.write_obj(tmp_path / "terrain04_ground.obj", plane(0.0), "ground")
    obj.write_obj(tmp_path / "terrain04_rock1.obj", ball(0, 0, 0, 0.2), "rock")
    obj.write_obj(tmp_path / "terrain04_rock1_decimate-005.obj", ball(0, 0, 0, 0.1), "rock")
    obj.write_obj(tmp_path / "terrain04_rock2.obj", ball(0.3, 0, 0, 0.05), "rock")
    rocks = read_terrain_meshes(tmp_path, 4).rocks
    assert rocks[1].vertices.max() == pytest.approx(0.1, abs=2e-3)
    assert sorted(rocks) == [1, 2]


@pytest.mark.parametrize(
    ("ground", "error", "name"), [(True, RoverError, r"terrain04_rock1\.obj"), (False, FormatError, r"_ground\.obj")]
)
def test_the_error_of_a_flat_rock_or_a_missing_ground_has_the_file(tmp_path, ground, error, name):
    if ground:
        obj.write_obj(tmp_path / "terrain04_ground.obj", plane(0.0), "ground")
        obj.write_obj(tmp_path / "terrain04_rock1.obj", plane(0.1, half=0.1), "rock")
    with pytest.raises(error, match=name):
        read_terrain_meshes(tmp_path, 4)


def test_a_ground_outside_its_part_is_an_error():
    far = Mesh(plane(0.0).vertices + np.array([9.0, 0.0, 0.0]), plane(0.0).faces)
    with pytest.raises(RoverError, match="terrain 4"):
        stitch([TerrainSolids(4, far, {}), TerrainSolids(1, plane(0.0), {})], SMALL)


def test_terrains_with_names_form_a_strip(tmp_path):
    """Sites name their terrains; `WorldOptions` and the names of mesh files have no fixed list."""
    for name, rock in (("yard-a", 3), ("yard-b", 5)):
        folder = tmp_path / f"Terrain{name}"
        obj.write_obj(folder / f"terrain{name}_ground.obj", plane(0.0), "ground")
        obj.write_obj(folder / f"terrain{name}_rock{rock}.obj", ball(0, 0, 0), "rock")
    options = WorldOptions(terrains=("yard-b", "yard-a"), margin_m=1.0, cell_m=0.05)
    job = job_of(meshes=tmp_path, world=options, soil=SoilOptions(), drive=DriveOptions(), seed=0)
    assert list(job.world.rocks["terrain"]) == ["yard-b", "yard-a"]
    assert list(job.world.rocks["rock_in_terrain"]) == [5, 3]
