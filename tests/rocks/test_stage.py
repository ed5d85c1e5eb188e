"""The rocks stage from scans to files: detected rocks, closed outward meshes, and ground without holes."""

from pathlib import Path

import numpy as np
import pytest

from polarsim.formats import nasa, obj, tables
from polarsim.geometry.stereo import StereoRig, default_rig, rectified_left
from polarsim.geometry.topology import is_watertight, part_of_face
from polarsim.rocks.adopt import adopt_rocks
from polarsim.rocks.find import find_rocks
from polarsim.rocks.mesh import mesh_rocks
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.solids import volume
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.run_files.scene import read_terrain

from .conftest import TRIPODS, Scene

TERRAIN = 1
FULL = default_rig()
RIG = StereoRig(FULL.left.scaled(0.5), FULL.right.scaled(0.5), FULL.left_from_right)  # to save time


def reconstruct(scene: Scene, folder: Path, noise: float) -> Path:
    """Write scans of a scene and run the stage on them."""
    rng = np.random.default_rng(3)
    grid = rectified_left(RIG)
    maps = {}
    for position, sandbox_from_rectified in TRIPODS.items():
        maps[position] = str(folder / f"Pos{position}_org-XYZ.tif")
        nasa.write_range_map(maps[position], scene.range_map(sandbox_from_rectified, grid.lens, noise, rng))
        sandbox_from_left = sandbox_from_rectified @ grid.left_from_rectified.inverse()
        write_localised(folder / f"cameras/Pos{position}.json", LocalisedRig(RIG, sandbox_from_left))
    write_inventory(folder / "inventory.json", Inventory(TERRAIN, "polar", range_maps=maps))
    (folder / "seeds").mkdir()
    options = RocksOptions(rock_cell_mm=3, ground_mesh_cell_mm=20)
    find_rocks(
        terrain=TERRAIN,
        inventory=folder / "inventory.json",
        cameras=folder / "cameras",
        seeds=folder / "seeds",
        overrides=None,
        rocks=folder / "rocks.parquet",
        cuboids=folder / "cuboids.yaml",
        ids=folder / "ids.yaml",
        clouds=folder / "clouds",
        options=options,
    )
    mesh_rocks(
        terrain=TERRAIN,
        rocks=folder / "rocks.parquet",
        clouds=folder / "clouds",
        meshes=folder / "meshes",
        options=options,
    )
    return folder


@pytest.fixture(scope="module")
def three_rocks_on_disk(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Scene]:
    from .conftest import angular_rock, hilly

    rng = np.random.default_rng(5)
    rocks = [
        angular_rock(rng, (x, y, float(hilly(np.array(x), np.array(y))) + 0.1 * size), size)
        for x, y, size in ((0.9, 0.6, 0.25), (-0.2, -0.9, 0.12), (1.1, -0.5, 0.08))
    ]
    scene = Scene(hilly, rocks)
    return reconstruct(scene, tmp_path_factory.mktemp("scans"), noise=0.002), scene


def test_all_rocks_are_detected_at_their_positions(three_rocks_on_disk):
    folder, scene = three_rocks_on_disk
    found = tables.read_parquet(folder / "rocks.parquet")[["x", "y"]].to_numpy()
    true = np.array([rock.points.mean(axis=0)[:2] for rock in scene.rocks])
    assert len(found) == len(true)
    nearest = np.linalg.norm(found[:, None] - true[None], axis=2).min(axis=0)
    assert nearest.max() < 0.04  # metres


def test_rock_meshes_are_closed_outward_and_connected(three_rocks_on_disk):
    folder, _ = three_rocks_on_disk
    files = obj.rock_files(folder / "meshes")
    assert len(files) == 3
    for path in files.values():
        mesh = obj.read_obj(path)
        assert is_watertight(mesh.faces)
        assert volume(mesh) > 0  # outward
        assert len(np.unique(part_of_face(mesh.faces))) == 1
        assert path.with_stem(path.stem + "_decimate-005").exists()


def test_the_visible_surface_of_the_rocks_is_accurate(three_rocks_on_disk):
    folder, scene = three_rocks_on_disk
    for path in obj.rock_files(folder / "meshes").values():
        vertices = obj.read_obj(path).vertices
        rock = min(scene.rocks, key=lambda r: np.linalg.norm(r.points.mean(axis=0)[:2] - vertices.mean(axis=0)[:2]))
        facing = vertices[:, 0] - rock.points[:, 0].mean() > 0.01  # towards tripod A
        above = vertices[:, 2] > rock.points[:, 2].max() - 0.3 * np.ptp(rock.points[:, 2])
        depth = (vertices @ rock.equations[:, :3].T + rock.equations[:, 3]).max(axis=1)  # signed distance, inside < 0
        assert np.median(np.abs(depth[facing & above])) < 0.003


def test_the_ground_covers_the_sand_and_follows_it(three_rocks_on_disk):
    folder, scene = three_rocks_on_disk
    ground = obj.read_obj(folder / "meshes" / obj.ground_name(TERRAIN)).vertices
    assert (ground[:, :2].min(axis=0) < -1.95).all()
    assert (ground[:, :2].max(axis=0) > 1.95).all()
    inner = ground[(np.abs(ground[:, :2]) < 1.6).all(axis=1)]
    error = np.abs(inner[:, 2] - scene.ground(inner[:, 0], inner[:, 1]))
    assert np.median(error) < 0.002
    assert np.percentile(error, 99) < 0.03  # filled under and behind rocks


def test_bare_ground_has_no_rock(tmp_path):
    folder = reconstruct(Scene(), tmp_path, noise=0.002)
    assert len(tables.read_parquet(folder / "rocks.parquet")) == 0
    assert read_terrain(folder / "meshes", TERRAIN).rocks == []


def test_published_meshes_keep_their_ids_and_get_a_ground_at_their_feet(release_root, tmp_path):
    meshes = obj.rock_files(release_root / "TerrainMeshes" / "Terrain11")
    write_inventory(
        tmp_path / "inventory.json", Inventory(11, "release", meshes={str(k): str(p) for k, p in meshes.items()})
    )
    adopt_rocks(
        terrain=11,
        inventory=tmp_path / "inventory.json",
        cameras=tmp_path / "cameras",
        rocks=tmp_path / "rocks.parquet",
        cuboids=tmp_path / "cuboids.yaml",
        meshes=tmp_path / "meshes",
    )
    scene = read_terrain(tmp_path / "meshes", 11)
    assert scene.rocks == sorted(meshes)
    ground = scene.vertices[np.unique(scene.faces[scene.rock_of_face == -1])]
    for rock, path in obj.rock_files(tmp_path / "meshes").items():
        mesh = obj.read_obj(path)
        assert len(np.unique(part_of_face(mesh.faces))) == 1
        centre, foot = mesh.vertices[:, :2].mean(axis=0), mesh.vertices[:, 2].min()
        near = ground[np.linalg.norm(ground[:, :2] - centre, axis=1) < 0.5 * np.ptp(mesh.vertices[:, 0])]
        assert abs(np.median(near[:, 2]) - foot) < 0.03, rock
