"""Cameras of a yard of 3 m x 6 m with an open side, a point lamp and a directional lamp, photographed by one camera."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter

from polarsim.cameras.locate import locate_cameras
from polarsim.cameras.options import LocalisationOptions, RefinementOptions
from polarsim.cameras.photos import refine_cameras
from polarsim.cameras.scans import register_scans
from polarsim.cameras.search import SearchRanges
from polarsim.cameras.search_area import SearchArea
from polarsim.cameras.shading import cast_view, surface_of
from polarsim.errors import RegistrationError
from polarsim.formats import obj, png
from polarsim.formats.clouds import write_cloud
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.geometry.poses import angle_between, camera_pose, yaw_pitch_roll
from polarsim.geometry.stereo import StereoRig, rectified_left
from polarsim.photo import BLACK_LEVEL, NO_ROCK, WHITE_LEVEL
from polarsim.run_files.inventory import Inventory, read_inventory, write_inventory
from polarsim.run_files.lamps import read_localised_suns
from polarsim.run_files.rigs import SURVEYED, read_all_localised, write_localised, write_rig
from polarsim.run_files.scans import read_scan
from polarsim.run_files.scene import TerrainMesh
from tests.support.other_site import one_camera, other_rig
from tests.support.scans import caster_of, range_map

from .conftest import box, rocks

TERRAIN = "yard-a"
RIG = StereoRig.single(other_rig().left)
TRUE = {  # decimetres and degrees off the survey
    "gate": camera_pose(np.array([2.75, 0.15, 1.25]), np.radians(178.0), np.radians(27.0), np.radians(1.0)),
    "mast": camera_pose(np.array([-0.25, -3.75, 1.35]), np.radians(86.0), np.radians(21.0), np.radians(-0.5)),
}
LAMPS = {"45": np.array([2.97, 2.83, 0.95]), "135": 1000 * np.array([-0.68, 0.72, 0.135])}  # off by 2 to 3 cm, 1.7 deg
pytestmark = pytest.mark.usefixtures("coarse_scans")


def wall(axis: int, sign: int) -> Mesh:
    low, high = np.array([-1.55, -3.0, -0.4]), np.array([1.55, 3.05, 0.2])
    low[axis], high[axis] = sorted((sign * (1.5, 3.0)[axis], sign * ((1.5, 3.0)[axis] + 0.05)))
    return box(low, high)


@pytest.fixture(scope="module")
def ground() -> Mesh:
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 240), np.linspace(-3, 3, 480))
    height = sum(
        size * gaussian_filter(rng.standard_normal(x.shape), width) * width for size, width in ((0.05, 16), (0.02, 5))
    )
    stones = [Mesh(stone.vertices * [0.9, 1.9, 1], stone.faces) for stone in rocks(rng, 14).values()]
    return join_meshes([grid_mesh(x, y, height), *stones])


@pytest.fixture(scope="module")
def yard(ground, tmp_path_factory):
    """A terrain with the scan of each position, and its true mesh."""
    folder, rng = tmp_path_factory.mktemp("yard"), np.random.default_rng(4)
    obj.write_obj(folder / "meshes" / obj.ground_name(TERRAIN), ground, "ground")
    around = [wall(0, -1), wall(0, 1), wall(1, 1), box(np.array([-9, -9, -0.6]), np.array([9, 9, -0.5]))]
    scene, grid, clouds = caster_of([ground, *around]), rectified_left(RIG), {}
    for position, pose in TRUE.items():
        points = range_map(scene, pose, grid.lens.scaled(0.8), rng, 0.0015)  # shows the far wall
        points = points[np.isfinite(points).all(axis=-1)]
        clouds[position] = str(folder / f"{position}.xyz")
        write_cloud(clouds[position], points, np.ones(len(points)), "m")
    write_inventory(folder / "inventory.json", Inventory(TERRAIN, "files", clouds=clouds))
    write_rig(folder / "calibration.json", RIG, "test")
    return folder


def locate(yard, folder, site):
    locate_cameras(
        site=site,
        terrain=TERRAIN,
        positions=["gate", "mast"],
        inventory=yard / "inventory.json",
        calibration=yard / "calibration.json",
        seeds=yard / "seeds",
        cameras=folder,
        options=LocalisationOptions(),
    )
    return read_all_localised(folder)


def errors(localised):
    """Return the errors of the poses, metres and degrees."""
    pairs = [(localised[position].sandbox_from_left, true) for position, true in TRUE.items()]
    return (
        max(np.linalg.norm(found.translation - true.translation) for found, true in pairs),
        max(np.degrees(angle_between(found, true)) for found, true in pairs),
    )


@pytest.fixture(scope="module")
def located(yard, tmp_path_factory):
    return locate(yard, tmp_path_factory.mktemp("located") / "cameras", one_camera()), yard


def test_scans_of_a_rectangle_with_an_open_side_are_placed_by_its_walls(located):
    metres, degrees = errors(located[0])
    assert metres < 0.02
    assert degrees < 0.4
    assert {rig.method for rig in located[0].values()} == {"scans"}
    assert not located[0]["gate"].rig.is_stereo


def test_a_yard_without_walls_is_placed_by_its_tripods(yard, tmp_path, located):
    bare = one_camera(sandbox={"half_width_m": [1.5, 3.0]})
    placed = locate(yard, tmp_path / "cameras", bare)
    assert {rig.method for rig in placed.values()} == {"scans, tripods"}
    assert errors(placed)[0] < 0.35  # the tripods are off by 0.2 m
    relative = [
        rigs["gate"].sandbox_from_left.inverse() @ rigs["mast"].sandbox_from_left for rigs in (placed, located[0])
    ]
    np.testing.assert_allclose(relative[0].matrix, relative[1].matrix, atol=1e-5)


@pytest.mark.slow
def test_photos_of_one_camera_refine_poses_and_both_kinds_of_lamps(located, ground, tmp_path):
    rigs, yard = located
    surface = surface_of(TerrainMesh(ground.vertices, ground.faces, np.full(len(ground.faces), NO_ROCK)))
    rows, rng = [], np.random.default_rng(5)
    for position, pose in TRUE.items():
        seen = cast_view(surface, replace(rigs[position], sandbox_from_left=pose).camera("L"))
        for name, lamp in LAMPS.items():
            image = seen.shade(lamp)
            grey = BLACK_LEVEL + 2500 * image / np.percentile(image, 98)
            grey += rng.normal(0, 2 + 0.5 * np.sqrt(grey))
            path = tmp_path / f"{TERRAIN}_{position}_off_{name}_L_0040.png"
            png.write_png(path, np.clip(np.rint(grey), 0, WHITE_LEVEL).astype(np.uint16))
            rows.append({"key": path.stem, "path": str(path)})
    pd.DataFrame(rows).to_parquet(tmp_path / "photos.parquet")
    for position, rig in rigs.items():
        write_localised(tmp_path / "located" / f"Pos{position}.json", rig)
    refine_cameras(
        site=one_camera(),
        terrain=TERRAIN,
        located=tmp_path / "located",
        meshes=yard / "meshes",
        photos=tmp_path / "photos.parquet",
        cameras=tmp_path / "cameras",
        options=RefinementOptions(),
    )
    refined, suns = read_all_localised(tmp_path / "cameras"), read_localised_suns(tmp_path / "cameras")
    assert {rig.method for rig in refined.values()} == {"scans, photos"}
    assert not refined["mast"].rig.is_stereo
    assert refined["mast"].rig.right == refined["gate"].rig.left
    metres, degrees = errors(refined)
    assert metres < 0.002
    assert degrees < 0.08
    for name, lamp in LAMPS.items():  # only directions can be estimated
        cosine = suns[name] @ lamp / np.linalg.norm(suns[name]) / np.linalg.norm(lamp)
        assert np.degrees(np.arccos(cosine)) < 0.25
        surveyed = np.array(one_camera().lamps[name].point)
        assert surveyed @ lamp / np.linalg.norm(surveyed) / np.linalg.norm(lamp) < np.cos(np.radians(0.5))


def test_search_ranges_follow_the_size_of_the_yard():
    site = one_camera()
    area, ranges = SearchArea.of(site, TERRAIN), SearchRanges.of(site.sandbox, site.tripods)
    np.testing.assert_allclose(area.radius, [2.7, 4.2])
    np.testing.assert_allclose(area.sand, [1.2, 2.4])
    assert ranges.distance[1] == 8.0
    far = one_camera(tripods={"mast": {"camera_m": [0.0, -12.0, 4.0], "yaw_deg": 90, "pitch_deg": 20}})
    ranges = SearchRanges.of(far.sandbox, far.tripods)
    assert ranges.distance[0] == 1.0
    assert ranges.distance[1] == 12.5
    assert ranges.height == (0.8, 4.45)
    assert SearchArea.of(far, TERRAIN).depths[1] > np.hypot(12 + 3, 4)


def test_scans_from_different_sides_need_the_tripods_of_the_site(yard):
    inventory, site = read_inventory(yard / "inventory.json"), one_camera()
    scans = {position: read_scan(inventory, position, RIG, site.files) for position in TRUE}
    with pytest.raises(RegistrationError, match="tripods"):
        register_scans(scans, {}, SearchArea.of(site, TERRAIN))


def test_a_single_camera_without_scans_is_at_its_tripods(tmp_path):
    write_inventory(tmp_path / "inventory.json", Inventory(TERRAIN, "files"))
    write_rig(tmp_path / "calibration.json", RIG, "test")
    (tmp_path / "seeds").mkdir()
    placed = locate(tmp_path, tmp_path / "cameras", one_camera())
    assert {rig.method for rig in placed.values()} == {SURVEYED}
    np.testing.assert_allclose(placed["mast"].sandbox_from_left.translation, [-0.4, -3.9, 1.4])
    np.testing.assert_allclose(np.degrees(yaw_pitch_roll(placed["mast"].sandbox_from_left)), [84, 20, 0], atol=1e-5)
    with pytest.raises(RegistrationError, match="gate, mast"):
        locate(tmp_path, tmp_path / "nowhere", one_camera(tripods={}))
