from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import obj, ply
from polarsim.formats.clouds import write_cloud
from polarsim.geometry.stereo import rectified_left
from polarsim.geometry.topology import hull_faces, is_watertight
from polarsim.rocks import find
from polarsim.rocks.find import find_rocks
from polarsim.rocks.ground import GROUND_CELL
from polarsim.rocks.mesh import mesh_rocks
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.overrides import read_overrides
from polarsim.rocks.solids import volume
from polarsim.run_files import rigs
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.rigs import LocalisedRig
from polarsim.site import polar
from tests.rocks.conftest import SIZES, Scene, angular_rock, hilly
from tests.support.polar_rig import default_rig

pytestmark = pytest.mark.slow
OPTIONS = RocksOptions(ground_mesh_cell_mm=40)


@pytest.fixture(autouse=True, scope="module")
def coarse():
    """Use cells of 1 cm and fewer interpolated points, to save time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("polarsim.run_files.scans.FINER", 1.5)
        for module in ("find", "mesh"):
            patch.setattr(f"polarsim.rocks.{module}.GROUND_CELL", 0.01)
        yield


def write_scene(folder, scene, tripods, reduction=0.5):
    """Write cameras, clouds and an inventory, as earlier stages do; clouds are a fast form of scans."""
    rng, rig, clouds = np.random.default_rng(9), default_rig(), {}
    grid = rectified_left(rig)
    for position, sandbox_from_rectified in tripods.items():
        sandbox_from_left = sandbox_from_rectified @ grid.left_from_rectified.inverse()
        rigs.write_localised(folder / "cameras" / f"Pos{position}.json", LocalisedRig(rig, sandbox_from_left, "truth"))
        points = scene.range_map(sandbox_from_rectified, grid.lens.scaled(reduction), 0.002, rng).reshape(-1, 3)
        points = points[np.isfinite(points).all(axis=1)]
        clouds[position] = str(folder / f"Pos{position}.xyz")
        write_cloud(clouds[position], points, np.zeros(len(points)))
    (folder / "seeds").mkdir()
    write_inventory(folder / "inventory.json", Inventory(1, "files", clouds=clouds))


def hilly_below(x0, y0):
    """Return hills with height 0 at a point."""
    return lambda x, y: hilly(x, y) - hilly(np.array(x0), np.array(y0))


def given(folder, **changed):
    """Return the arguments of `find_rocks` in a folder."""
    return {
        "site": polar(),
        "terrain": 1,
        "inventory": folder / "inventory.json",
        "cameras": folder / "cameras",
        "seeds": folder / "seeds",
        "overrides": None,
        "rocks": folder / "rocks.parquet",
        "cuboids": folder / "cuboids.yaml",
        "ids": folder / "ids.yaml",
        "clouds": folder / "clouds",
        "options": OPTIONS,
        **changed,
    }


def run(folder, **changed):
    arguments = given(folder, **changed)
    find_rocks(**arguments)
    mesh_rocks(
        site=polar(),
        terrain=1,
        rocks=arguments["rocks"],
        clouds=arguments["clouds"],
        meshes=folder / "meshes",
        options=OPTIONS,
    )


@pytest.fixture(scope="module")
def worked(three_rocks, tripods, tmp_path_factory):
    folder = tmp_path_factory.mktemp("rocks")
    write_scene(folder, three_rocks, tripods, reduction=0.35)
    run(folder)
    return folder


def side_above_sand(rock):
    """Return the longest horizontal side of the part of a convex rock above the hills, metres."""
    corners = rock.points[hull_faces(rock.points)]
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], 200)
    points = np.einsum("bk,fkd->fbd", weights, corners).reshape(-1, 3)
    return np.ptp(points[points[:, 2] > hilly(*points[:, :2].T)], axis=0)[:2].max()


def test_scans_become_a_table_of_rocks(worked, three_rocks):
    table = pd.read_parquet(worked / "rocks.parquet")
    points = read_overrides(worked / "ids.yaml").positions
    columns, rows = np.floor((np.array(list(points.values())) + 2) / 0.25).astype(int).T
    assert table["rock"].tolist() == list(points) == (1 + columns + 16 * rows).tolist()
    assert set(table["source"]) == {"scan"}
    for (x, y), rock in zip(SIZES, three_rocks.rocks, strict=True):
        near = table.loc[np.hypot(table["x"] - x, table["y"] - y).idxmin()]
        assert np.hypot(near["x"] - x, near["y"] - y) < 0.04
        assert near["size_m"] == pytest.approx(side_above_sand(rock), abs=0.02)
    assert (table["points"] > 100).all()
    assert table["points_by_scan"].str.fullmatch(r"A:\d+ C:\d+").all()
    counts = table["points_by_scan"].str.findall(r"\d+").map(lambda each: sum(map(int, each)))
    assert counts.tolist() == table["points"].tolist()
    assert table["visible_share"].between(0.3, 1).all()
    inside = (table["x0"] < table["x"]) & (table["x"] < table["x1"]) & (table["z0"] < table["z1"])
    assert inside.all()


def test_every_rock_has_a_cloud_with_unit_normals_inside_its_cuboid(worked):
    for row in pd.read_parquet(worked / "rocks.parquet").itertuples():
        cloud = ply.read_ply(worked / "clouds" / f"rock{row.rock}.ply")
        np.testing.assert_allclose(np.linalg.norm(cloud.normals, axis=1), 1, atol=1e-6)
        assert (cloud.points >= np.array([row.x0, row.y0, row.z0]) - 0.005).all()
        assert (cloud.points <= np.array([row.x1, row.y1, row.z1]) + 0.005).all()


def test_every_rock_gets_a_closed_mesh_and_a_small_copy(worked):
    meshes = pd.read_csv(worked / "meshes" / "meshes.csv").set_index("mesh")
    assert len(meshes) == 7
    assert meshes.drop("terrain01_ground.obj")["watertight"].all()
    assert (meshes["islands"] == 1).all()
    for rock in pd.read_parquet(worked / "rocks.parquet")["rock"]:
        full, copy = (
            obj.read_obj(worked / "meshes" / obj.rock_name(1, rock, decimated=small)) for small in (False, True)
        )
        assert is_watertight(full.faces)
        assert volume(full) > 0  # outward
        assert len(copy.vertices) < 0.1 * len(full.vertices)


def test_the_ground_covers_the_sand(worked):
    ground = obj.read_obj(worked / "meshes" / "terrain01_ground.obj").vertices
    assert (ground[:, :2].min(axis=0) < -2.0).all()
    assert (ground[:, :2].max(axis=0) > 2.0).all()


def test_a_rock_of_7_cm_and_17_mm_height_is_detected_without_boxes(tripods, tmp_path, monkeypatch):
    monkeypatch.setattr("polarsim.rocks.find.GROUND_CELL", GROUND_CELL)
    low = angular_rock(np.random.default_rng(8), (0.9, 0.3, -0.008), 0.07)
    write_scene(tmp_path, Scene(hilly_below(0.9, 0.3), [low]), tripods)
    find_rocks(**given(tmp_path, options=RocksOptions()))
    table = pd.read_parquet(tmp_path / "rocks.parquet")
    np.testing.assert_allclose(table[["x", "y"]], [[0.9, 0.3]], atol=0.015)
    assert table["size_m"].between(0.045, 0.080).all()


def test_a_second_run_writes_the_same_bytes(worked, tmp_path):
    outputs = ("rocks.parquet", "cuboids.yaml", "ids.yaml", "clouds")
    find_rocks(**given(worked, **{name.split(".")[0]: tmp_path / name for name in outputs}))
    clouds = [f"clouds/{path.name}" for path in (worked / "clouds").glob("*.ply")]
    assert len(clouds) == 4
    for name in ("rocks.parquet", "cuboids.yaml", "ids.yaml", *clouds):
        assert (tmp_path / name).read_bytes() == (worked / name).read_bytes(), name


def test_ranges_of_photos_give_no_walls_and_only_rocks_with_seed_boxes(worked, tmp_path, monkeypatch):
    monkeypatch.setattr("polarsim.rocks.find.measure_walls", lambda *_: pytest.fail("walls were measured"))
    outputs = ("rocks.parquet", "cuboids.yaml", "ids.yaml", "clouds")
    find_rocks(**given(worked, **{name.split(".")[0]: tmp_path / name for name in outputs}, from_photos=True))
    assert len(pd.read_parquet(tmp_path / "rocks.parquet")) == 0
    assert {path.name for path in (tmp_path / "clouds").iterdir()} == {"ground.ply", "scanners.csv"}


def test_a_terrain_without_scans_is_level_ground_without_rocks(tmp_path, caplog):
    (tmp_path / "seeds").mkdir()
    (tmp_path / "cameras").mkdir()
    write_inventory(tmp_path / "inventory.json", Inventory(1, "files"))
    run(tmp_path)
    assert "terrain 01 has no scan" in caplog.text
    assert len(pd.read_parquet(tmp_path / "rocks.parquet")) == 0
    assert np.abs(obj.read_obj(tmp_path / "meshes" / "terrain01_ground.obj").vertices[:, 2]).max() < 1e-3
    assert [path.name for path in (tmp_path / "meshes").glob("*.obj")] == ["terrain01_ground.obj"]


@pytest.mark.parametrize("method", [None, "survey"], ids=["no pose", "unconfirmed pose"])
def test_a_scan_without_a_confirmed_pose_is_excluded(three_rocks, tripods, tmp_path, method, caplog):
    write_scene(tmp_path, three_rocks, tripods, reduction=0.1)
    inventory = find.read_inventory(tmp_path / "inventory.json")
    localised = rigs.read_all_localised(tmp_path / "cameras")
    both = find.read_scans(inventory, localised, polar().files, polar().sandbox)
    lost = {} if method is None else {"C": replace(localised["C"], method=method)}
    one = find.read_scans(inventory, {"A": localised["A"], **lost}, polar().files, polar().sandbox)
    assert "the scan at C" in caplog.text
    assert 0 < len(one) < len(both)
