import numpy as np
import pandas as pd
import pytest
import trimesh

from polarsim.errors import FormatError
from polarsim.formats import obj
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.outlines import rim
from polarsim.geometry.topology import remove_unused_vertices
from polarsim.rocks.adopt import adopt_rocks
from polarsim.rocks.fitted_ground import FOOT_SD
from polarsim.rocks.heights import FloorGrid
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.repair import repair_rocks
from polarsim.rocks.scans import Extent
from polarsim.rover.world.hulls import DEVIATION_M, convex_parts
from polarsim.rover.world.stitch import read_terrain_meshes
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.scene import mesh_origins
from polarsim.site import polar

GRID = FloorGrid(Extent(-2.1, -2.1, 2.1, 2.1), 0.02)


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Use cells of 2 cm for the fitted ground, to save time."""
    monkeypatch.setattr("polarsim.rocks.adopt.FITTED_GROUND_CELL", 0.02)


def adopt(folder, terrain, meshes, **inventory):
    write_inventory(folder / "inventory.json", Inventory(terrain, "release", meshes=meshes, **inventory))
    adopt_rocks(
        site=polar(),
        terrain=terrain,
        inventory=folder / "inventory.json",
        cameras=folder / "cameras",
        rocks=folder / "rocks.parquet",
        cuboids=folder / "cuboids.yaml",
        meshes=folder / "meshes",
    )
    return pd.read_parquet(folder / "rocks.parquet"), pd.read_csv(folder / "meshes" / "meshes.csv").set_index("mesh")


def half_ball(x, y, z, radius=0.06):
    """Return the upper half of a ball, open at z."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    vertices = np.array(ball.vertices)
    faces = np.array(ball.faces)[(vertices[ball.faces][:, :, 2] >= -1e-9).all(axis=1)]
    return remove_unused_vertices(vertices + np.array([x, y, z]), faces)


@pytest.mark.release
@pytest.mark.parametrize("terrain", [11])
def test_published_rocks_are_cleaned_and_get_a_ground_at_their_feet(release_root, tmp_path, terrain):
    paths = obj.rock_files(release_root / "TerrainMeshes" / f"Terrain{terrain:02d}")
    table, shape_metrics = adopt(tmp_path, terrain, {str(rock): str(path) for rock, path in paths.items()})
    assert table["rock"].tolist() == list(paths)
    assert set(table["source"]) == {"published"}
    assert (shape_metrics["islands"] == 1).all()
    assert (table["volume_m3"] > 0).all()
    ground = obj.read_obj(tmp_path / "meshes" / obj.ground_name(terrain))
    heights = ground.vertices[:, 2].reshape(FloorGrid(GRID.extent, 0.02).shape)
    for rock, path in paths.items():
        adopted = obj.read_obj(tmp_path / "meshes" / obj.rock_name(terrain, rock))
        published = obj.read_obj(path)
        assert np.isin(np.round(adopted.vertices[:50], 6), np.round(published.vertices, 6)).all()  # the same frame
        foot = rim(adopted)
        assert np.median(np.abs(foot[:, 2] - GRID.sample(heights, foot))) < FOOT_SD


def test_a_terrain_without_meshes_is_level_ground_and_an_empty_table(tmp_path):
    table, shape_metrics = adopt(tmp_path, 6, {})
    assert len(table) == 0
    assert list(shape_metrics.index) == ["terrain06_ground.obj"]
    assert not obj.read_obj(tmp_path / "meshes" / "terrain06_ground.obj").vertices[:, 2].any()


def wavy_ground(lift=0.0, half=2.0, step=0.05):
    """Return a published ground with a pit of 12 cm in its centre and waves of 2 cm."""
    x, y = np.meshgrid(np.arange(-half, half + step / 2, step), np.arange(-half, half + step / 2, step))
    return grid_mesh(x, y, wavy(x, y) + lift)


def wavy(x, y):
    return 0.1 + 0.02 * np.sin(3 * x) - 0.12 * np.exp(-(x**2 + y**2) / 0.4**2)


PLACES = {3: (0.9, 0.8), 5: (-1.1, 0.4), 8: (0.2, -1.3)}


def adopt_on(folder, ground):
    """Adopt three half balls on the wavy ground, published with a given ground."""
    obj.write_obj(folder / "terrain04_ground.obj", ground, "ground")
    paths = {}
    for rock, (x, y) in PLACES.items():
        paths[str(rock)] = str(folder / f"rock{rock}.obj")
        obj.write_obj(paths[str(rock)], half_ball(x, y, wavy(x, y)), "rock")
    return adopt(folder, 4, paths, ground=str(folder / "terrain04_ground.obj"))


def test_tables_state_the_published_ground(tmp_path):
    table, shape_metrics = adopt_on(tmp_path, wavy_ground())
    assert shape_metrics.loc["terrain04_ground.obj", "made_from"] == "published"
    assert mesh_origins(tmp_path / "meshes")["terrain04_rock3.obj"] == "published"
    np.testing.assert_allclose(table["height_m"], 0.06, atol=0.008)  # of a half ball, on waves of up to 3.4 degrees
    ground = obj.read_obj(tmp_path / "meshes" / "terrain04_ground.obj")
    centre = np.linalg.norm(ground.vertices[:, :2], axis=1).argmin()
    assert ground.vertices[centre, 2] == pytest.approx(wavy(0, 0), abs=1e-5)  # including the pit


def test_tables_distinguish_fitted_and_published_ground(tmp_path):
    obj.write_obj(tmp_path / "rock.obj", half_ball(0, 0, 0.2), "rock")
    _, shape_metrics = adopt(tmp_path, 4, {"2": str(tmp_path / "rock.obj")})
    assert shape_metrics["made_from"].to_dict() == {
        "terrain04_ground.obj": "fitted",
        "terrain04_rock2.obj": "published",
        "terrain04_rock2_decimate-005.obj": "published",
    }


def test_a_published_ground_that_faces_down_is_flipped(tmp_path):
    ground = wavy_ground()
    adopt_on(tmp_path, Mesh(ground.vertices, ground.faces[:, ::-1]))
    assert obj.read_obj(tmp_path / "meshes" / "terrain04_ground.obj").normals()[:, 2].min() > 0.5


@pytest.mark.parametrize(
    ("ground", "number"),
    [
        (wavy_ground(lift=-0.2), "+20"),  # millimetres
        (wavy_ground(half=1.2), "rock 8"),
        (Mesh(1000 * wavy_ground().vertices, wavy_ground().faces), "4000"),
    ],
    ids=["other frame", "part of the sand", "millimetres"],
)
def test_a_ground_of_other_rocks_is_refused(tmp_path, ground, number):
    with pytest.raises(FormatError) as refused:
        adopt_on(tmp_path, ground)
    assert refused.value.path.name == "terrain04_ground.obj"
    assert number in refused.value.reason
    assert not (tmp_path / "rocks.parquet").exists()


def test_drives_get_closed_rocks_on_the_published_ground(tmp_path, caplog):
    adopt_on(tmp_path, wavy_ground())
    (tmp_path / "cameras").mkdir()  # without positions
    read_terrain_meshes(tmp_path / "meshes", 4)
    assert "3 rocks with holes, which the physics fills and images show: 3, 5, 8" in caplog.text
    caplog.clear()
    repair_rocks(
        site=polar(),
        terrain=4,
        inventory=tmp_path / "inventory.json",
        cameras=tmp_path / "cameras",
        meshes=tmp_path / "meshes",
        copies=tmp_path / "repaired",
        options=RocksOptions(rock_cell_mm=4),
    )
    closed = read_terrain_meshes(tmp_path / "repaired", 4)
    assert not caplog.text
    assert sorted(closed.rocks) == sorted(PLACES)
    assert all(len(rock.faces) < 3000 for rock in closed.rocks.values())  # decimated
    for rock, (x, y) in PLACES.items():
        assert closed.rocks[rock].vertices[:, 2].max() == pytest.approx(wavy(x, y) + 0.06, abs=0.002)
        parts = convex_parts(closed.rocks[rock].vertices, closed.rocks[rock].faces)
        assert max(deviation for _, deviation in parts) <= DEVIATION_M
    np.testing.assert_array_equal(
        closed.ground.vertices, obj.read_obj(tmp_path / "meshes" / "terrain04_ground.obj").vertices
    )


def test_invalid_ids_are_refused(tmp_path):
    with pytest.raises(FormatError, match=r"inventory.json: .*'x'"):
        adopt(tmp_path, 4, {"x": "somewhere.obj"})


def test_a_rim_is_the_foot_of_a_rock():
    foot = rim(half_ball(0.3, -0.2, 0.05))
    assert len(foot) == 24
    np.testing.assert_allclose(foot[:, 2], 0.05, atol=0.004)
    assert (np.linalg.norm(foot[:, :2] - [0.3, -0.2], axis=1) > 0.045).all()
