"""Refinement of cameras on photos of a rough ground with blocks, rendered from the true poses."""

import logging
from dataclasses import replace
from itertools import product

import numpy as np
import pandas as pd
import pycolmap
import pytest
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from polarsim.cameras.options import RefinementOptions
from polarsim.cameras.photos import refine_cameras
from polarsim.cameras.shading import cast_view, surface_of
from polarsim.formats import obj, png
from polarsim.formats.colmap import CAMERA_ID
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.poses import Pose, angle_between, camera_pose
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.run_files.lamps import FILE, read_suns, surveyed_suns
from polarsim.run_files.rigs import STEREO, SURVEYED, LocalisedRig, read_all_localised, write_localised
from polarsim.run_files.scene import read_terrain
from polarsim.site import polar
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import lamp_position

TRUE = LocalisedRig(
    default_rig(), camera_pose(np.array([3.6, -0.4, 1.5]), np.pi, np.radians(27)), "scans", {"rmse_mm": 2.0}
)
OFF = Pose.from_rotvec(np.radians([0.08, -0.06, 0.05]), np.array([0.002, -0.001, 0.002]))  # error of a registration
LOCATED = replace(TRUE, sandbox_from_left=TRUE.sandbox_from_left @ OFF)
SUNS = {"30": np.array([-0.02, 0.1, 0.05]), "270": np.array([0.08, 0.03, -0.06])}  # offsets from the survey, metres
EXPOSURES = {64: 0.4, 256: 1.0}  # ms -> share of the exposure that fills the range


def rough_ground(cells=260):
    x, y = np.meshgrid(*2 * [np.linspace(-2, 2, cells)])
    rng = np.random.default_rng(1)
    height = sum(size * gaussian_filter(rng.normal(size=x.shape), width) for size, width in ((0.1, 3), (0.5, 10)))
    for cx, cy in ((-1, 0.3), (0, -0.8), (0.6, 0.5), (1.2, -0.4)):  # boulders with steep sides
        height = np.maximum(height, 0.2 - 1.5 * np.maximum(np.hypot(x - cx, y - cy) - 0.12, 0) ** 0.7)
    return grid_mesh(x, y, height)


def photograph(folder, position, rig, suns=SUNS, exposures=EXPOSURES, cameras="LR"):
    """Render photos at a position, and return rows of `photos.parquet`."""
    mesh = read_terrain(folder / "meshes", 13, polar().sandbox_of(13))
    surface, rng, rows = surface_of(mesh), np.random.default_rng(2), []
    for camera in cameras:
        seen = cast_view(surface, rig.camera(camera))
        for azimuth, off in suns.items():
            image = seen.shade(lamp_position(azimuth) + off)
            for ms, share in exposures.items():
                grey = share * 2500 * image / np.percentile(image, 98)
                grey = BLACK_LEVEL + grey + rng.normal(0, 2 + 0.5 * np.sqrt(grey))
                path = folder / "photos" / f"13_{position}_off_{azimuth}_{camera}_{ms:04d}.png"
                png.write_png(path, np.clip(np.rint(grey), 0, WHITE_LEVEL).astype(np.uint16))
                rows.append({"key": path.stem, "path": str(path)})
    return rows


@pytest.fixture(scope="module")
def photographed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photographed")
    obj.write_obj(folder / "meshes" / obj.ground_name(13), rough_ground(), "ground")
    rows = photograph(folder, "A", TRUE)
    broken = folder / "photos" / "13_A_off_180_L_0256.png"
    broken.write_bytes(b"no picture")
    rows.append({"key": broken.stem, "path": str(broken)})
    pd.DataFrame(rows).to_parquet(folder / "photos.parquet")
    return folder


def located(folder, rigs):
    for position, rig in rigs.items():
        write_localised(folder / "located" / f"Pos{position}.json", rig)
    (folder / "located" / "alignment.csv").write_text("pair\nA-C\n")
    return folder / "located"


def refine(photographed, tmp_path, rigs, **changes):
    asked = {"photos": photographed / "photos.parquet", "options": RefinementOptions()}
    refine_cameras(
        site=polar(), terrain=13, located=located(tmp_path, rigs), meshes=photographed / "meshes",
        cameras=tmp_path / "cameras",
        **{**asked, **changes},
    )  # fmt: skip
    return read_all_localised(tmp_path / "cameras")


def assert_same_files(folder):
    assert not (folder / "cameras" / FILE).exists()
    for path in (folder / "located").glob("*.*"):
        assert path.read_bytes() == (folder / "cameras" / path.name).read_bytes()


@pytest.fixture(scope="module")
def refined(photographed, tmp_path_factory):
    folder = tmp_path_factory.mktemp("refined")
    far = replace(TRUE, sandbox_from_left=camera_pose(np.array([6.0, -0.4, 1.5]), np.pi, np.radians(20)))
    return refine(photographed, folder, {"A": LOCATED, "B": far}), folder


@pytest.mark.slow
def test_photos_correct_a_pose(refined):
    found, true = refined[0]["A"].sandbox_from_left, TRUE.sandbox_from_left
    assert np.linalg.norm(LOCATED.sandbox_from_left.translation - true.translation) > 0.0025
    assert np.linalg.norm(found.translation - true.translation) < 0.001
    assert np.degrees(angle_between(found, true)) < 0.015  # the principal point's prior leaves as much open
    points = np.array([[x, y, 0.0] for x in (-1, 0, 1) for y in (-1, 0, 1)])
    for camera in "LR":
        off = refined[0]["A"].project(camera, points) - TRUE.project(camera, points)
        assert np.abs(off).max() < 0.3


def test_lamps_are_corrected_across_the_line_to_the_centre(refined):
    suns = read_suns(refined[1] / "cameras", refined[0], polar(), 13)
    for azimuth, off in SUNS.items():
        line = lamp_position(azimuth) / np.linalg.norm(lamp_position(azimuth))
        wrong = suns[azimuth] - lamp_position(azimuth) - off
        assert np.linalg.norm(wrong - (wrong @ line) * line) < 0.03
    np.testing.assert_allclose(suns["180"], surveyed_suns(refined[0], polar(), 13)["180"])  # no valid photo


def test_offsets_between_photos_and_meshes_are_metrics(refined):
    rig = refined[0]["A"]
    assert rig.method == "scans, photos"
    assert rig.metrics["rmse_mm"] == 2.0
    assert rig.metrics["median_off_px"] < 1 < 2 < rig.metrics["median_off_before_px"]
    assert rig.metrics["windows"] > 500
    assert 0 < rig.metrics["sd_mm"] < 3


def test_a_position_without_photos_gets_the_lenses_and_keeps_its_pose(refined):
    localised = refined[0]
    assert localised["B"].method == "scans"
    assert (localised["B"].rig.left, localised["B"].rig.right) == (localised["A"].rig.left, localised["A"].rig.right)
    np.testing.assert_allclose(localised["B"].sandbox_from_left.translation, [6.0, -0.4, 1.5], atol=1e-9)


def test_tables_and_a_colmap_model_are_written(refined):
    folder = refined[1] / "cameras"
    assert (folder / "alignment.csv").read_text() == (refined[1] / "located" / "alignment.csv").read_text()
    model = pycolmap.Reconstruction(str(folder / "colmap"))
    names = {image.name for image in model.images.values()}
    assert {"PosB_CamL", "PosB_CamR"} < names  # no photos there
    shown = [folder / "colmap" / name for name in names if not name.startswith("PosB")]
    assert len(shown) == 2
    assert all(path.is_file() for path in shown)
    (left,) = (
        image for image in model.images.values() if image.camera_id == CAMERA_ID["L"] and "PosB" not in image.name
    )
    expected = refined[0]["A"].sandbox_from_left.inverse().matrix
    np.testing.assert_allclose(left.cam_from_world().matrix(), expected[:3], atol=1e-9)


def test_a_colmap_model_has_points_of_the_meshes(refined, photographed):
    model = pycolmap.Reconstruction(str(refined[1] / "cameras" / "colmap"))
    points = np.array([point.xyz for point in model.points3D.values()])
    vertices = read_terrain(photographed / "meshes", 13, polar().sandbox_of(13)).vertices
    assert 10_000 < len(points) <= 20_000
    assert cKDTree(vertices).query(points)[0].max() < 1e-6
    assert np.ptp(points[:, :2], axis=0).min() > 3.9  # across the sandbox


def test_shaded_views_move_poses_from_stereo_photos_less_than_poses_from_scans(photographed, refined, tmp_path):
    coarse = RefinementOptions(scales=(0.25,))
    stereo = refine(photographed, tmp_path, {"A": replace(LOCATED, method=STEREO)}, options=coarse)["A"]
    assert stereo.method == "stereo, photos"
    assert 0 < stereo.metrics["moved_mm"] < 0.85 * refined[0]["A"].metrics["moved_mm"]


def test_without_photos_poses_are_not_changed(photographed, tmp_path):
    off = RefinementOptions(scales=())
    for name, changes in {"none": {"photos": None}, "switched off": {"options": off}}.items():
        localised = refine(photographed, tmp_path / name, {"A": LOCATED}, **changes)
        assert localised["A"].method == "scans"
        assert_same_files(tmp_path / name)


@pytest.mark.parametrize("grey", [WHITE_LEVEL, BLACK_LEVEL], ids=["saturated", "black"])
def test_photos_without_a_well_exposed_pixel_change_no_pose_and_the_reason_is_a_warning(
    photographed, tmp_path, caplog, grey
):
    lens = TRUE.rig.left
    paths = [tmp_path / "photos" / f"13_A_off_30_{camera}_0256.png" for camera in "LR"]
    for path in paths:
        png.write_png(path, np.full((lens.height, lens.width), grey, np.uint16))
    rows = [{"key": path.stem, "path": str(path)} for path in paths]
    pd.DataFrame(rows).to_parquet(tmp_path / "photos.parquet")
    with caplog.at_level(logging.WARNING):
        localised = refine(photographed, tmp_path, {"A": LOCATED}, photos=tmp_path / "photos.parquet")
    assert localised["A"].method == "scans"
    assert_same_files(tmp_path)
    assert "13_A_off_30_L_0256" in caplog.text
    assert "not refined" in caplog.text


def test_a_surveyed_pose_is_not_refined(photographed, tmp_path):
    localised = refine(photographed, tmp_path, {"A": replace(LOCATED, method="survey")})
    assert localised["A"].method == "survey"


def test_photos_of_another_position_do_not_change_poses(photographed, tmp_path, caplog):
    elsewhere = replace(
        TRUE, sandbox_from_left=camera_pose(np.array([0.8, -3.6, 1.5]), np.radians(103), np.radians(27))
    )
    with caplog.at_level(logging.WARNING):
        localised = refine(photographed, tmp_path, {"A": elsewhere})
    assert localised["A"].method == "scans"
    assert_same_files(tmp_path)
    assert "terrain 13: the photos" in caplog.text
    assert "13_A_off_180_L_0256.png" in caplog.text  # the broken photo


@pytest.mark.slow
def test_photos_under_another_lamp_than_named_change_no_pose_and_no_lamp(photographed, tmp_path, caplog):
    """Photos under Sun 30 have the names of Sun 180, or of all Suns."""
    rows = pd.read_parquet(photographed / "photos.parquet").to_dict("records")
    renamed = [{**row, "key": row["key"].replace("_30_", "_180_")} for row in rows if "_30_" in row["key"]]
    kept = [row for row in rows if "_270_" in row["key"]]
    for name, chosen in {"one": kept + renamed, "all": renamed}.items():
        pd.DataFrame(chosen).to_parquet(tmp_path / f"{name}.parquet")
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            found = refine(photographed, tmp_path / name, {"A": LOCATED}, photos=tmp_path / f"{name}.parquet")
        assert "azimuth 180" in caplog.text
        assert "azimuth 270" not in caplog.text
        if name == "all":
            assert_same_files(tmp_path / name)
        else:
            off = found["A"].sandbox_from_left.translation - TRUE.sandbox_from_left.translation
            assert np.linalg.norm(off) < 0.0015
            suns = read_suns(tmp_path / name / "cameras", found, polar(), 13)
            np.testing.assert_allclose(suns["180"], surveyed_suns(found, polar(), 13)["180"])


def test_photos_that_resemble_the_meshes_under_no_lamp_do_not_show_another_lamp(photographed, tmp_path, caplog):
    """As smooth sand, whose shadows match by chance only."""
    rng, lens, rows = np.random.default_rng(0), TRUE.rig.left, []
    for azimuth, camera in product(("30", "180"), "LR"):
        path = tmp_path / f"13_A_off_{azimuth}_{camera}_0256.png"
        png.write_png(path, rng.integers(900, 1100, (lens.height, lens.width)).astype(np.uint16))
        rows.append({"key": path.stem, "path": str(path)})
    pd.DataFrame(rows).to_parquet(tmp_path / "photos.parquet")
    with caplog.at_level(logging.WARNING):
        localised = refine(photographed, tmp_path, {"A": LOCATED}, photos=tmp_path / "photos.parquet")
    assert localised["A"].method == "scans"
    assert "another lamp" not in caplog.text


@pytest.mark.slow
def test_shared_features_localise_positions(photographed, tmp_path, caplog):
    """As D to G of terrain 13: no scan, no survey, photos from nearly the same place; E only has a wrong survey."""
    stands = {
        "D": camera_pose(np.array([3.7, -0.25, 1.42]), np.pi + 0.02, np.radians(26)),
        "E": camera_pose(np.array([3.45, -0.5, 1.55]), np.pi - 0.03, np.radians(28)),
        "C": camera_pose(np.array([0.6, -3.6, 1.5]), np.radians(100), np.radians(26)),  # too far from A
    }
    true = {position: replace(TRUE, sandbox_from_left=pose) for position, pose in stands.items()}
    lit = {"30": SUNS["30"]}, {256: 1.0}, "L"
    rows = [row for position, rig in true.items() for row in photograph(photographed, position, rig, *lit)]
    known = pd.read_parquet(photographed / "photos.parquet")
    pd.concat([known, pd.DataFrame(rows)]).to_parquet(tmp_path / "photos.parquet")
    guessed = LocalisedRig(TRUE.rig, camera_pose(np.array([3.0, 0.5, 1.5]), np.pi, 0.4), SURVEYED)
    found = refine(
        photographed, tmp_path, {"A": LOCATED, "E": guessed}, photos=tmp_path / "photos.parquet",
        options=RefinementOptions(scales=(0.25,)),
    )  # fmt: skip
    assert sorted(found) == ["A", "D", "E"]
    for position in "DE":
        pose = found[position].sandbox_from_left
        assert np.linalg.norm(pose.translation - stands[position].translation) < 0.002
        assert np.degrees(angle_between(pose, stands[position])) < 0.03
        assert found[position].method == "features, photos"
    assert "position C" in caplog.text
