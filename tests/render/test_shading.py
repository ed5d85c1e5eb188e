"""Shadows compared with brute force: separate rays for every rock, the relief and the walls."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import camera_pose
from polarsim.photo import NO_ROCK
from polarsim.render.hits import STRIP_ROWS, cast_strip
from polarsim.render.lamps import Lamp
from polarsim.render.lighting import lighting, rotations, to_disc
from polarsim.render.maps import compute_maps
from polarsim.render.options import RenderOptions
from polarsim.render.shadows import BY_RELIEF, BY_WALL, FACES_AWAY, LIT, NOTHING
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files.instances import BACKGROUND, GROUND, ROCK_IDS, SHADOW_IDS
from polarsim.run_files.scene import TerrainMesh

from .conftest import block, walled

LENS = Lens(420.0, 420.0, 200.0, 140.0, (-0.1, 0.15, 0.0005, -0.001, 0.0), width=400, height=280)
CAMERA = camera_pose(np.array([2.4, -1.2, 1.7]), 2.7, 0.6)
ROCKS, PLACES = (3, 4, 8, 9), ((0.2, 0.3), (0.5, 0.75), (-0.7, -0.6), (-0.1, -1.0))
OPTIONS = RenderOptions(bounce=0)
LOW = Lamp(np.array([1.0, 3.6, 0.9]))
BEHIND = Lamp(np.array([-0.32, 3.6, 0.8]))  # the mound is between this lamp and block 8


def hills():
    """Return vertices and faces of ground with a mound."""
    x, y = np.meshgrid(np.linspace(-2, 2, 81), np.linspace(-2, 2, 81))
    mound = 0.25 * np.exp(-((x + 0.6) ** 2 + (y - 0.5) ** 2) / 0.08)
    ground = grid_mesh(x, y, mound + 0.01 * np.sin(4 * x) * np.cos(3 * y))
    return ground.vertices, ground.faces


@pytest.fixture(scope="module")
def mesh():
    """A mound, an L-shaped rock with self shadow, three blocks (two in line), and walls."""
    vertices, faces = hills()
    rocks = block(ROCKS, PLACES)
    tower = block((3,), ((0.4, 0.1),))  # with block 3 it makes an L
    upper = tower.vertices * [0.5, 0.5, 2] + [0.3, 0.25, 0]
    parts = [(vertices, faces, np.full(len(faces), NO_ROCK))]
    for own, points in ((rocks, rocks.vertices), (tower, upper)):
        stone = own.rock_of_face != NO_ROCK
        parts.append((points - [0, 0, 0.02], own.faces[stone], own.rock_of_face[stone]))
    starts = np.cumsum([0, *(len(part[0]) for part in parts)])
    vertices = np.concatenate([part[0] for part in parts])
    faces = np.concatenate([part[1] + start for part, start in zip(parts, starts, strict=False)])
    return walled(TerrainMesh(vertices, faces, np.concatenate([part[2] for part in parts])), 1.5, 0.25)


@pytest.fixture(scope="module")
def surfaces(mesh):
    return build_surfaces(mesh, OPTIONS)


@pytest.fixture(scope="module")
def hits(surfaces):
    return cast_strip(surfaces, Camera(CAMERA, LENS), slice(0, LENS.height))


def of(surfaces, ids):
    """Return only the surfaces with the given ids."""
    some = np.isin(surfaces.id_of_face, list(ids))
    return replace(surfaces, faces=surfaces.faces[some], id_of_face=surfaces.id_of_face[some])


def without(surfaces, *rocks):
    return of(surfaces, set(surfaces.id_of_face.tolist()) - {ROCK_IDS + rock for rock in rocks})


def lit(surfaces, hits, lamp):
    """Return which hits (n,) the lamp lights in a scene of these surfaces."""
    is_lit = np.zeros(len(hits.pixel), bool)
    is_lit[lighting(surfaces, hits, lamp, falloff=False)[0]] = True
    return is_lit


def shading_of(surfaces, hits, lamp):
    """Return the shading code (n,) of each hit."""
    maps = compute_maps(surfaces, Camera(CAMERA, LENS), {"sun": lamp}, OPTIONS)
    return maps.by_lamp["sun"].shading.reshape(-1)[hits.pixel]


def iou(first, second):
    return (first & second).sum() / (first | second).sum()


@pytest.mark.parametrize("lamp", [LOW, Lamp(np.array([-1.2, 3.4, 1.1])), Lamp(np.array([3.5, -1.4, 0.8]))])
def test_cast_shadows_are_ground_that_is_lit_without_the_rock(surfaces, hits, ids_of, lamp):
    """Ground shaded by several rocks is tested only against all rocks together, because the first rock decides.

    Ground that is dark without any rock (grains facing away) is excluded, because it belongs to the rock shadow.
    """
    ids = ids_of(surfaces, CAMERA, LENS, {"sun": lamp})["sun"].reshape(-1)[hits.pixel]
    ground = surfaces.id_of_face[hits.face] == GROUND
    without_any = lit(without(surfaces, *ROCKS), hits, lamp)
    by_any = ground & without_any & ~lit(surfaces, hits, lamp)
    by_one = {rock: by_any & lit(without(surfaces, rock), hits, lamp) for rock in ROCKS}
    by_several = by_any & ~np.any(list(by_one.values()), axis=0)
    assert iou(ids >= SHADOW_IDS, by_any) >= 0.99
    for rock, expected in by_one.items():
        assert expected.sum() > 100
        assert iou((ids == SHADOW_IDS + rock) & without_any & ~by_several, expected) >= 0.99


def blocking(surfaces, hits, towards):
    """Return, by object id, whether only this object occludes the hits (n,) along `towards`."""
    return {
        number: of(surfaces, [number]).all.occluded(hits.point, towards, 1.0)
        for number in np.unique(surfaces.id_of_face).tolist()
    }


def named(shading):
    """Return the id (n,) of the occluder of each code; -1 for LIT and FACES_AWAY."""
    return np.select(
        [shading == BY_RELIEF, shading == BY_WALL, shading >= SHADOW_IDS, shading >= ROCK_IDS],
        [GROUND, BACKGROUND, shading.astype(int) - SHADOW_IDS + ROCK_IDS, shading],
        -1,
    )


def test_the_code_of_a_dark_pixel_is_its_occluder(surfaces, hits):
    own, found = surfaces.id_of_face[hits.face], dict.fromkeys(("itself", "rock", "relief", "wall", "sand"), 0)
    for lamp in (LOW, BEHIND):
        shading = shading_of(surfaces, hits, lamp)
        towards = lamp.light_at(hits.point, falloff=False)[0]
        np.testing.assert_array_equal(shading == LIT, lit(surfaces, hits, lamp))
        away = (np.sum(hits.plane * towards, axis=1) <= 0) | (np.sum(hits.normal * towards, axis=1) <= 0)
        np.testing.assert_array_equal(shading == FACES_AWAY, away)
        thing, by = named(shading), blocking(surfaces, hits, towards)
        assert all(by[number][thing == number].all() for number in by)  # the object does occlude the lamp
        alone = (thing >= 0) & (np.sum(list(by.values()), axis=0) == 1)
        assert alone.sum() > 0.6 * (thing >= 0).sum()
        for number, blocks in by.items():
            np.testing.assert_array_equal(thing[alone] == number, blocks[alone])
        on_rock, by_rock = own >= ROCK_IDS, thing >= ROCK_IDS
        kinds = (thing == own, (thing != own) & by_rock, thing == GROUND, thing == BACKGROUND)
        for name, pixels in zip(found, (*(on_rock & kind for kind in kinds), ~on_rock & by_rock), strict=True):
            found[name] += pixels.sum()
    assert min(found.values()) > 10, found


def test_pixels_without_a_surface_have_neither_a_code_nor_a_lit_share(surfaces, hits):
    maps = compute_maps(surfaces, Camera(CAMERA, LENS), {"sun": LOW}, OPTIONS).by_lamp["sun"]
    seen = np.zeros(maps.shading.size, bool)
    seen[hits.pixel] = True
    np.testing.assert_array_equal(maps.shading.ravel() != NOTHING, seen)
    np.testing.assert_array_equal(np.isnan(maps.lit).ravel(), ~seen)


@pytest.mark.parametrize("lamp", [LOW, BEHIND])
def test_shading_codes_of_ground_and_walls_agree_with_removed_rocks(surfaces, hits, lamp):
    shading = shading_of(surfaces, hits, lamp)
    dark = (surfaces.id_of_face[hits.face] < ROCK_IDS) & ~lit(surfaces, hits, lamp)
    by_any = dark & lit(without(surfaces, *ROCKS), hits, lamp)
    by_one = {rock: dark & lit(without(surfaces, rock), hits, lamp) for rock in ROCKS}
    by_several = by_any & ~np.any(list(by_one.values()), axis=0)
    on_rest = surfaces.id_of_face[hits.face] < ROCK_IDS
    assert iou((shading >= SHADOW_IDS) & on_rest, by_any) >= 0.999
    for rock, expected in by_one.items():
        assert iou((shading == SHADOW_IDS + rock) & on_rest & ~by_several, expected) >= 0.999


def test_shading_codes_agree_with_id_maps(surfaces, hits, ids_of):
    shading = shading_of(surfaces, hits, LOW)
    ids = ids_of(surfaces, CAMERA, LENS, {"sun": LOW})["sun"].reshape(-1)[hits.pixel]
    by_rock = (surfaces.id_of_face[hits.face] == GROUND) & (shading >= SHADOW_IDS)
    np.testing.assert_array_equal(shading[by_rock], ids[by_rock])
    filled_in = (ids >= SHADOW_IDS) & ~by_rock
    assert set(np.unique(shading[filled_in])) <= {BY_RELIEF, BY_WALL, FACES_AWAY}
    assert filled_in.sum() < 0.03 * by_rock.sum()


def test_pixels_below_the_visibility_threshold_of_a_disc_are_dark(surfaces, hits, monkeypatch):
    disc = replace(LOW, radius_m=0.25)
    towards = disc.light_at(hits.point, falloff=False)[0]
    first_row = hits.pixel // LENS.width // STRIP_ROWS * STRIP_ROWS
    rotation = rotations(hits.pixel - first_row * LENS.width, first_row)
    by = None
    for way in to_disc(towards, disc.radius_m, OPTIONS.lamp_samples, rotation):
        found = blocking(surfaces, hits, way)
        by = found if by is None else {number: by[number] | found[number] for number in by}
    sizes = []
    for below in (0.2, 0.5, 1.0):
        monkeypatch.setattr("polarsim.render.maps.SHADOW_BELOW", below)
        maps = compute_maps(surfaces, Camera(CAMERA, LENS), {"sun": disc}, OPTIONS).by_lamp["sun"]
        share, shading = (picture.reshape(-1)[hits.pixel] for picture in (maps.lit, maps.shading))
        np.testing.assert_array_equal(shading == LIT, share >= below)
        thing = named(shading)
        assert min(by[number][thing == number].mean() for number in by) > 0.999
        sizes.append((shading != LIT).sum())
    assert sizes[0] < sizes[1] < sizes[2]
    assert ((share > 0.2) & (share < 0.8)).sum() > 500
