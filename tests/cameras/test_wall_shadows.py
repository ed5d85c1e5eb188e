"""Lamps and walls from shadow edges of walls: synthetic edges, and photos of level sand."""

import logging

import numpy as np
import pandas as pd
import pytest

from polarsim.cameras.options import RefinementOptions
from polarsim.cameras.photos import refine_cameras
from polarsim.cameras.wall_shadows import fit_lamps, fit_walls, refine_by_wall_shadows
from polarsim.formats import obj, png
from polarsim.geometry.images import resize
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.photo import BLACK_LEVEL
from polarsim.run_files.lamps import surveyed_suns
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.run_files.wall_edges import EdgeSamples
from polarsim.run_files.walls import SIDES, Wall, Walls, level_walls, read_walls, wall_strips
from polarsim.site import polar
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import SUN_LAMPS
from tests.support.wall_photos import level_sand, shaded_sand

SIDE_OF_SUN = {"30": "+x", "350": "+x", "180": "-x", "270": "-y"}
NOMINAL = level_walls(2.05, 0.28)
RIG = LocalisedRig(default_rig(), camera_pose(np.array([3.5, -0.3, 1.5]), np.pi, np.radians(25)), "labels, photos")


def measured(face: float, top: float) -> Walls:
    along = wall_strips(face)
    return Walls(dict.fromkeys(SIDES, Wall(face, along, np.full(len(along), top), 0.9)), "scans")


def edges(walls: Walls, suns, rng, noise=0.02) -> dict[str, EdgeSamples]:
    """Return points on the shadow edges of level walls on sand at z = 0, with noise across the edge, metres."""
    samples = {}
    for azimuth, side in SIDE_OF_SUN.items():
        axis, sign = "xy".index(side[1]), -1.0 if side[0] == "-" else 1.0
        top = np.zeros((30, 3))
        top[:, axis], top[:, 1 - axis] = sign * walls.sides[side].face_m, np.linspace(-1.2, 1.2, 30)
        top[:, 2] = walls.sides[side].top_m[0]
        lamp = suns[azimuth]
        points = lamp + (top - lamp) * lamp[2] / (lamp[2] - top[:, 2:])
        points[:, axis] += rng.normal(0, noise, 30)
        samples[azimuth] = EdgeSamples(np.full(30, SIDES.index(side)), points, np.zeros(30), np.zeros(30))
    return samples


def edge_error(walls: Walls, samples: dict[str, EdgeSamples], suns) -> float:
    """Return the maximum over lamps of the median distance of edges from points, metres of height at the wall."""
    return max(abs(float(np.median(walls.clearance(part.measured, suns[sun])))) for sun, part in samples.items())


@pytest.mark.parametrize(("face", "top"), [(2.0, 0.31), (2.05, 0.33), (2.08, 0.25)])
def test_walls_are_moved_to_their_shadow_edges(rng, face, top):
    samples = edges(level_walls(face, top), SUN_LAMPS, rng)
    assert edge_error(NOMINAL, samples, SUN_LAMPS) > 0.015
    walls = fit_walls("terrain", NOMINAL, samples, SUN_LAMPS)
    assert walls.origin == "photos"
    assert edge_error(walls, samples, SUN_LAMPS) < 0.003
    for side in ("-x", "+x", "-y"):
        # A single edge does not separate face and top; both stay near the nominal wall.
        assert walls.sides[side].face_m == pytest.approx(face, abs=0.06)
        assert walls.sides[side].top_m == pytest.approx(top, abs=0.02)
        assert 0 < walls.sides[side].support <= 1
    assert walls.sides["+y"] is NOMINAL.sides["+y"]  # no lamp behind this wall


def test_edges_at_random_places_and_few_edges_keep_the_nominal_walls(rng, caplog):
    caplog.set_level(logging.INFO, "polarsim")
    samples = edges(level_walls(2.0, 0.31), SUN_LAMPS, rng, noise=0.2)
    assert fit_walls("terrain 01", NOMINAL, samples, SUN_LAMPS) is None
    few = {
        azimuth: EdgeSamples(part.side[:4], part.measured[:4], part.offset_m[:4], part.offset_px[:4])
        for azimuth, part in edges(level_walls(2.0, 0.31), SUN_LAMPS, rng).items()
    }
    assert fit_walls("terrain 01", NOMINAL, {"180": few["180"]}, SUN_LAMPS) is None
    assert fit_walls("terrain 01", NOMINAL, {}, SUN_LAMPS) is None
    assert [record.message.startswith("terrain 01") for record in caplog.records] == [True] * 3


def test_measured_sides_are_not_fitted(rng):
    whole = measured(2.0, 0.31)
    walls = Walls({**whole.sides, "-y": NOMINAL.sides["-y"]}, "scans")
    samples = edges(whole, SUN_LAMPS, rng)
    found = fit_walls("terrain", walls, samples, SUN_LAMPS)
    assert found.origin == "scans"
    assert [side for side in SIDES if found.sides[side] is not walls.sides[side]] == ["-y"]


@pytest.mark.parametrize("stretch", [0.95, 1.05])
def test_lamps_are_moved_along_the_light_to_the_edges_of_measured_walls(rng, stretch):
    walls = measured(2.0, 0.31)
    true = {azimuth: stretch * lamp for azimuth, lamp in SUN_LAMPS.items()}
    samples = edges(walls, true, rng, noise=0.005)
    lamps = fit_lamps("terrain", walls, samples, SUN_LAMPS, set(SUN_LAMPS))
    assert sorted(lamps) == sorted(SUN_LAMPS)
    for azimuth, lamp in lamps.items():
        start = SUN_LAMPS[azimuth]
        assert np.linalg.norm(lamp - true[azimuth]) < np.linalg.norm(start - true[azimuth])
        assert abs(np.median(walls.clearance(samples[azimuth].measured, lamp))) < 0.003
        across = lamp - (lamp @ start) / (start @ start) * start
        assert np.linalg.norm(across) < 0.02  # the shadows of rocks still fit


def test_lamps_over_nominal_walls_and_with_contradicting_edges_are_not_moved(rng, caplog):
    samples = edges(level_walls(2.0, 0.31), SUN_LAMPS, rng)
    assert fit_lamps("terrain", NOMINAL, samples, SUN_LAMPS, set()) == {}
    far = measured(2.0, 0.55)  # edges that only an impossible lamp explains
    assert fit_lamps("terrain", far, samples, SUN_LAMPS, set(SUN_LAMPS)) == {}
    warnings = [record.message for record in caplog.records if record.levelname == "WARNING"]
    assert len(warnings) == len(SUN_LAMPS)
    assert all("contradict" in text for text in warnings)


@pytest.fixture(scope="module")
def photographed(tmp_path_factory):
    """Write photos of terrain 1 under a lamp in a box whose walls differ from the nominal walls."""
    folder, rows = tmp_path_factory.mktemp("walls"), []
    for azimuth, camera in (("30", "L"), ("30", "R")):
        share = shaded_sand(RIG.camera(camera).scaled(0.2), level_walls(2.0, 0.31), SUN_LAMPS[azimuth])
        path = folder / f"01_A_off_{azimuth}_{camera}_0256.png"
        png.write_png(path, (BLACK_LEVEL + 2000 * resize(share, (1936, 1216))).astype(np.uint16))
        rows.append({"key": path.stem, "path": str(path)})
    pd.DataFrame(rows).to_parquet(folder / "photos.parquet")
    return folder / "photos.parquet"


def test_walls_of_photos_replace_nominal_walls(photographed):
    mesh = level_sand(walls=NOMINAL)
    lamps, walls = refine_by_wall_shadows("terrain 01", 1, mesh, photographed, {"A": RIG}, SUN_LAMPS, polar(), set())
    assert lamps == {}
    lamp = SUN_LAMPS["30"]
    edge = np.array([[lamp[0] - (lamp[0] - 2.0) * lamp[2] / (lamp[2] - 0.31), 0.0, 0.0]])
    assert abs(NOMINAL.clearance(edge, lamp)[0]) > 0.025
    assert abs(walls.clearance(edge, lamp)[0]) < 0.002  # a centimetre on the ground
    assert walls.sides["-y"] is NOMINAL.sides["-y"]


@pytest.fixture(scope="module")
def published(photographed, tmp_path_factory):
    """Write the photos with 8 bits and a tone curve, with a line along the nominal edge, and masks of the line."""
    folder = tmp_path_factory.mktemp("published")
    along = np.linspace(-0.9, 0.9, 2000)
    lamp = SUN_LAMPS["30"]
    edge = lamp[0] - (lamp[0] - 2.05) * lamp[2] / (lamp[2] - 0.28)
    line = np.column_stack([np.full(2000, edge), along, np.zeros(2000)])
    for path in sorted(photographed.parent.glob("*.png")):
        grey = 200 * np.sqrt((png.read_photo(path, (1936, 1216)).astype(float) - BLACK_LEVEL).clip(0) / 2040)
        column, row = np.floor(RIG.camera(path.stem[12]).project(line)).astype(int).T
        drawn = np.zeros(grey.shape, np.uint8)
        for shift in range(-4, 5):
            drawn[(row + shift).clip(0, grey.shape[0] - 1), column.clip(0, grey.shape[1] - 1)] = 255
        png.write_png(folder / "photos" / path.name, np.where(drawn > 0, 240, grey).astype(np.uint8))
        png.write_png(folder / "drawn" / path.name, drawn)
    return folder


def wall_error(walls: Walls, lamp: np.ndarray = SUN_LAMPS["30"]) -> float:
    """Return the error of the edge of the shadow in the photos under a lamp, metres of height at the wall."""
    sun = SUN_LAMPS["30"]
    edge = np.array([[sun[0] - (sun[0] - 2.0) * sun[2] / (sun[2] - 0.31), 0.0, 0.0]])
    return abs(float(walls.clearance(edge, lamp)[0]))


def test_walls_of_published_photos_replace_nominal_walls_whatever_the_tone_curve(published):
    mesh = level_sand(walls=NOMINAL)
    photos, drawn = published / "photos", published / "drawn"
    _, walls = refine_by_wall_shadows("terrain 01", 1, mesh, photos, {"A": RIG}, SUN_LAMPS, polar(), set(), drawn)
    assert walls.origin == "photos"
    assert wall_error(NOMINAL) > 0.025
    assert wall_error(walls) < 0.005  # the square root moves the point of half brightness
    assert [side for side in SIDES if walls.sides[side].support > 0] == ["+x"]


def test_a_terrain_without_own_photos_gets_the_walls_of_its_cover_photos(published, tmp_path):
    ground = level_sand()
    obj.write_obj(tmp_path / "meshes" / obj.ground_name(1), Mesh(ground.vertices, ground.faces), "ground")
    write_localised(tmp_path / "located" / "PosA.json", RIG)
    covers = {"covers": published / "photos", "drawn": published / "drawn"}
    for name, given in (("fitted", covers), ("nominal", {})):
        refine_cameras(
            site=polar(), terrain=1, located=tmp_path / "located", meshes=tmp_path / "meshes", photos=None,
            cameras=tmp_path / name, options=RefinementOptions(), **given,
        )  # fmt: skip
        assert (tmp_path / name / "PosA.json").read_bytes() == (tmp_path / "located" / "PosA.json").read_bytes()
    lamp = surveyed_suns({"A": RIG}, polar(), 1)["30"]  # at the height that the rig implies
    assert wall_error(read_walls(tmp_path / "fitted"), lamp) < 0.005
    assert read_walls(tmp_path / "nominal") is None


def test_published_photos_of_another_size_keep_the_nominal_walls(published, tmp_path, caplog):
    for path in (published / "photos").iterdir():
        png.write_png(tmp_path / path.name, png.read_png(path)[::2, ::2])
    mesh = level_sand(walls=NOMINAL)
    assert refine_by_wall_shadows("terrain 01", 1, mesh, tmp_path, {"A": RIG}, SUN_LAMPS, polar(), set()) == ({}, None)
    assert [record.levelname for record in caplog.records].count("WARNING") >= 1


def test_lamps_of_photos_are_moved_over_measured_walls(photographed):
    walls = measured(2.0, 0.31)
    off = {azimuth: lamp + np.array([0.0, 0.0, 0.03]) for azimuth, lamp in SUN_LAMPS.items()}
    mesh = level_sand(walls=walls)
    lamps, found = refine_by_wall_shadows("terrain 01", 1, mesh, photographed, {"A": RIG}, off, polar(), set())
    assert found is None
    assert list(lamps) == ["30"]
    assert lamps["30"][2] == pytest.approx(SUN_LAMPS["30"][2], abs=0.012)
