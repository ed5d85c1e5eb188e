"""From files to files: cover photos of a known relief, a level ground and a published rock without foot."""

import json
import logging

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import npz, obj, png, tables
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.geometry.topology import open_edges
from polarsim.photo import NO_ROCK
from polarsim.relief.feet import DEPTH_M, continued_down
from polarsim.relief.heights import MEASURED
from polarsim.relief.refine import MAP, PICTURE, refine_ground
from polarsim.render.options import RenderOptions
from polarsim.rocks.folder import height_mesh, write_meshes
from polarsim.run_files.fitted_photos import GROUND_FILE
from polarsim.run_files.lamps import write_suns
from polarsim.run_files.rigs import LocalisedRig, write_localised
from polarsim.run_files.scene import FITTED, PHOTOS, PUBLISHED, SCANNED
from polarsim.run_files.walls import level_walls
from polarsim.site import polar
from tests.relief.scenes import GRID, LARGER, LENS, camera, photograph, relief, texture
from tests.support.polar_survey import SUN_LAMPS

HALF = 0.7  # metres: half width of the walls
BOX = Mesh(  # open below, 2 cm above the level ground
    np.array([[x, y, z] for z in (0.02, 0.12) for x, y in ((-0.5, 0.4), (-0.4, 0.4), (-0.4, 0.5), (-0.5, 0.5))], float),
    np.array(
        [
            [4, 5, 6],
            [4, 6, 7],
            *(t for k in range(4) for t in ([k, (k + 1) % 4, 4 + (k + 1) % 4], [k, 4 + (k + 1) % 4, 4 + k])),
        ]
    ),
)


def write_scene(folder, made_from=FITTED):
    """Write meshes with a level ground, cameras at A and C, and lamps."""
    ground = height_mesh(LARGER, np.zeros(LARGER.shape))
    walls = level_walls(HALF, 0.01)
    write_meshes(1, folder / "meshes", {7: BOX}, ground, {NO_ROCK: made_from, 7: PUBLISHED}, None, walls)
    cameras = folder / "cameras"
    cameras.mkdir()
    for position in "AC":
        rig = StereoRig(LENS, LENS, Pose(np.eye(3), np.array([0.3, 0.0, 0.0])))
        write_localised(
            cameras / f"Pos{position}.json", LocalisedRig(rig, camera(position, "L").world_from_camera, "labels")
        )
    write_suns(cameras, SUN_LAMPS)


def write_photos(folder, seeds=(0, 0)):
    """Write photos at A and C with the texture of a seed each."""
    (folder / "photos").mkdir()
    for position, seed in zip("AC", seeds, strict=True):
        picture = photograph(camera(position, "L"), relief, texture(seed))
        png.write_png(folder / "photos" / f"01_{position}_off_30_L_0256.png", np.clip(picture, 0, 240).astype(np.uint8))


def refined(folder):
    out = folder / "refined"
    refine_ground(
        site=polar(), terrain=1, meshes=folder / "meshes", cameras=folder / "cameras",
        photos=folder / "photos", refined=out, options=RenderOptions(),
    )  # fmt: skip
    return out, json.loads((out / GROUND_FILE).read_text())


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("refined")
    write_scene(folder)
    write_photos(folder)
    return refined(folder)


def test_the_mesh_has_the_measured_heights_and_its_origin(result):
    folder, summary = result
    assert summary["refined"]
    assert summary["measured_share"] > 0.6
    ground = obj.read_obj(folder / obj.ground_name(1))
    inside = (np.abs(ground.vertices[:, :2]) < 0.5).all(axis=1)
    x, y, z = ground.vertices[inside].T
    assert np.median(np.abs(z - relief(x, y))) < 0.004  # metres; the start surface is 10 mm off
    table = tables.read_csv(folder / "meshes.csv", ["mesh", "made_from"]).set_index("mesh")["made_from"]
    assert table[obj.ground_name(1)] == PHOTOS
    assert table[obj.rock_name(1, 7)] == PUBLISHED


def test_the_map_has_heights_deviations_and_kinds(result):
    folder, summary = result
    content = npz.read_arrays(folder / MAP, ("x0_y0_cell_m", "height_m", "sd_m", "kind"))
    measured = content["kind"] == MEASURED
    assert measured.mean() == pytest.approx(summary["measured_share"], abs=0.001)
    assert np.isfinite(content["sd_m"][measured]).all()
    assert png.read_png(folder / PICTURE).shape == (*content["kind"].shape, 3)


def test_the_rock_reaches_the_ground(result):
    folder, _ = result
    rock = obj.read_obj(folder / obj.rock_name(1, 7))
    assert rock.vertices[:, 2].min() < relief(-0.45, 0.45)
    assert len(rock.vertices) == len(BOX.vertices) + 4


@pytest.mark.parametrize(("made_from", "seeds"), [(FITTED, (0, 1)), (SCANNED, (0, 0)), (FITTED, None)])
def test_bad_input_leaves_the_meshes_as_they_were(tmp_path, caplog, made_from, seeds):
    """Photos of different grounds, a scanned ground, and no photos."""
    write_scene(tmp_path, made_from)
    if made_from == SCANNED:
        support = {"mesh": obj.ground_name(1), "vertex": np.arange(LARGER.shape[0] * LARGER.shape[1]), "support": 1.0}
        tables.write_parquet(tmp_path / "meshes/support.parquet", pd.DataFrame(support))
    if seeds:
        write_photos(tmp_path, seeds)
    else:
        (tmp_path / "photos").mkdir()
    with caplog.at_level(logging.WARNING, "polarsim"):
        folder, summary = refined(tmp_path)
    assert not summary["refined"]
    assert summary["reasons"]
    assert "terrain 01: the ground is not measured in photos" in caplog.text
    for path in (tmp_path / "meshes").iterdir():
        assert (folder / path.name).read_bytes() == path.read_bytes()


def test_continued_sides_face_outwards_and_end_below_the_ground():
    longer = continued_down(BOX, GRID, np.zeros(GRID.shape))
    assert longer.vertices[:, 2].min() == pytest.approx(-DEPTH_M)
    assert np.unique(open_edges(longer.faces)).min() >= len(BOX.vertices)  # only the lower edge is open
    corner = longer.vertices[longer.faces]
    normals = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    outward = corner.mean(axis=1) - [-0.45, 0.45, 0.05]
    assert ((normals * outward).sum(axis=1) > 0).all()
    assert continued_down(longer, GRID, np.zeros(GRID.shape)) is longer
