import numpy as np
import pandas as pd
import pytest
import trimesh

from polarsim.errors import FormatError
from polarsim.formats import obj
from polarsim.formats.inventory import Inventory, write_inventory
from polarsim.formats.obj import Mesh
from polarsim.rocks.adopt import adopt_rocks, volume_above
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.rims import fit_ground, rim
from polarsim.rocks.scans import Extent
from polarsim.rocks.solids import compacted

GRID = FloorGrid(Extent(-2.1, -2.1, 2.1, 2.1), 0.02)


def adopt(folder, terrain, meshes, **inventory):
    write_inventory(folder / "inventory.json", Inventory(terrain, "release", meshes=meshes, **inventory))
    adopt_rocks(
        terrain=terrain,
        inventory=folder / "inventory.json",
        cameras=folder / "cameras",
        rocks=folder / "rocks.parquet",
        cuboids=folder / "cuboids.yaml",
        meshes=folder / "meshes",
        options=RocksOptions(fitted_ground_cell_mm=20),
    )
    return pd.read_parquet(folder / "rocks.parquet"), pd.read_csv(folder / "meshes" / "meshes.csv").set_index("mesh")


def half_ball(x, y, z, radius=0.06):
    """The upper half of a ball, open at z."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    vertices = np.array(ball.vertices)
    faces = np.array(ball.faces)[(vertices[ball.faces][:, :, 2] >= -1e-9).all(axis=1)]
    return compacted(vertices + np.array([x, y, z]), faces)


@pytest.mark.release
@pytest.mark.parametrize("terrain", [4, 11])
def test_published_rocks_are_taken_over_cleaned_on_a_ground_that_meets_them(release_root, tmp_path, terrain):
    paths = obj.rock_files(release_root / "TerrainMeshes" / f"Terrain{terrain:02d}")
    table, figures = adopt(tmp_path, terrain, {str(rock): str(path) for rock, path in paths.items()})
    assert table["rock"].tolist() == list(paths)
    assert set(table["source"]) == {"published"}
    assert (figures["islands"] == 1).all()
    assert (table["volume_m3"] > 0).all()
    ground = obj.read(tmp_path / "meshes" / obj.ground_name(terrain))
    heights = ground.vertices[:, 2].reshape(FloorGrid(GRID.extent, 0.02).shape)
    for rock, path in paths.items():
        adopted = obj.read(tmp_path / "meshes" / obj.rock_name(terrain, rock))
        published = obj.read(path)
        assert np.isin(np.round(adopted.vertices[:50], 6), np.round(published.vertices, 6)).all()  # the same frame
        foot = rim(adopted)
        assert np.median(np.abs(foot[:, 2] - GRID.sample(heights, foot))) < 0.010
        assert np.quantile(np.abs(foot[:, 2] - GRID.sample(heights, foot)), 0.8) < 0.015


def test_a_terrain_without_meshes_is_level_ground_and_an_empty_table(tmp_path):
    table, figures = adopt(tmp_path, 6, {})
    assert len(table) == 0
    assert list(figures.index) == ["terrain06_ground.obj"]
    assert not obj.read(tmp_path / "meshes" / "terrain06_ground.obj").vertices[:, 2].any()


def test_a_published_ground_is_used(tmp_path):
    obj.write(
        tmp_path / "ground.obj", Mesh(np.array([[-2, -2, 1], [2, -2, 1], [0, 2, 1.0]]), np.array([[0, 1, 2]])), "g"
    )
    _, figures = adopt(tmp_path, 4, {}, ground=str(tmp_path / "ground.obj"))
    assert figures.loc["terrain04_ground.obj", "faces"] == 1


def test_ids_that_are_no_numbers_are_refused(tmp_path):
    with pytest.raises(FormatError, match=r"inventory.json: meshes are named by rock ids, found 'x'"):
        adopt(tmp_path, 4, {"x": "somewhere.obj"})


def test_the_ground_runs_through_rims_on_a_slope_and_ignores_one_that_is_off():
    places = np.array([[x, y] for x in (-1.2, -0.4, 0.4, 1.2) for y in (-1.0, 0.2, 1.1)])
    heights = 0.03 * places[:, 0] - 0.02 * places[:, 1] + 0.1
    heights[5] += 0.15  # a rock on another
    rims = [rim(half_ball(x, y, z)) for (x, y), z in zip(places, heights, strict=True)]
    ground = fit_ground(rims, GRID)
    sloping = 0.03 * GRID.places()[..., 0] - 0.02 * GRID.places()[..., 1] + 0.1
    far = (np.linalg.norm(GRID.places()[:, :, None] - places, axis=-1) > 0.6).all(axis=-1)
    assert np.abs(ground - sloping)[far].max() < 0.004
    for number, foot in enumerate(rims):
        assert np.abs(foot[:, 2] - GRID.sample(ground, foot)).max() < 0.008, number


def test_a_rim_is_the_foot_of_a_rock():
    foot = rim(half_ball(0.3, -0.2, 0.05))
    assert len(foot) == 24
    np.testing.assert_allclose(foot[:, 2], 0.05, atol=0.004)
    assert (np.linalg.norm(foot[:, :2] - [0.3, -0.2], axis=1) > 0.045).all()


def test_volume_above_level_ground_is_that_of_the_half_ball():
    volume = volume_above(half_ball(0, 0, 0, 0.1), GRID, np.zeros(GRID.shape))
    assert volume == pytest.approx(2 / 3 * np.pi * 0.1**3, rel=0.02)
