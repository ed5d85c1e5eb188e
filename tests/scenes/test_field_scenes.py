"""Scenes beyond the sandbox: views, ground, rocks of many sizes, and labels that agree with the rendered rocks."""

from dataclasses import replace
from itertools import pairwise
from typing import get_args

import numpy as np
import pytest
from scipy import stats

from polarsim.formats import obj, png, yolo
from polarsim.randomness import generator
from polarsim.run_files import class_masks
from polarsim.run_files.instances import GROUND, ROCK_IDS, SHADOW_IDS
from polarsim.scenes.field_effects import Atmosphere, Texture, add_sky
from polarsim.scenes.field_ground import draw_ground, octaves
from polarsim.scenes.field_options import FieldRanges, GroundKind
from polarsim.scenes.field_rocks import rock_noise, scatter_field_rocks, scatter_gravel, weather
from polarsim.scenes.field_scenes import draw_field_scene
from polarsim.scenes.field_view import draw_view
from polarsim.scenes.layout import power_law
from polarsim.scenes.options import SceneOptions
from polarsim.scenes.render_scenes import render_scenes
from tests.scenes.conftest import block

SMALL = FieldRanges(scale=0.1)


def views(count, ranges=SMALL):
    return [draw_view(ranges, generator(number, "view")) for number in range(count)]


def test_ground_nodes_are_even_in_the_image_and_cover_it():
    for view in views(12):
        x, y = view.nodes
        assert (np.diff(view.forward) > 0).all()
        pixels = view.camera.project(np.stack([x, y, np.zeros_like(y)], axis=-1))
        inside = view.camera.inside(pixels)
        gaps = np.linalg.norm(np.diff(pixels, axis=1), axis=-1)[inside[:, 1:] & inside[:, :-1]]
        assert 2 < gaps.min() <= gaps.max() < 3.1  # px
        rows = np.linalg.norm(np.diff(pixels, axis=0), axis=-1)[inside[1:] & inside[:-1]]
        assert rows.max() < 3.1
        low = pixels[inside]
        assert low[:, 0].min() < 4
        assert low[:, 0].max() > view.camera.lens.width - 4
        assert low[:, 1].max() > view.camera.lens.height - 4


def test_cells_are_those_of_the_nodes():
    for view in views(6):
        x, y = view.nodes
        points = np.stack([x[3:9, 5:20], y[3:9, 5:20]], axis=-1)
        rows, columns = view.cells_of(points.reshape(-1, 2))
        np.testing.assert_array_equal(rows.reshape(6, 15), np.arange(3, 9)[:, None].repeat(15, 1))
        np.testing.assert_array_equal(columns.reshape(6, 15), np.arange(5, 20)[None].repeat(6, 0))


def test_random_points_are_on_the_ground_in_the_image(rng):
    for view in views(40):
        points = view.draw_points(200, 0.0, rng)
        pixels = view.camera.project(np.column_stack([points, np.zeros(200)]))
        margin = 0.1 * view.camera.size  # the roll moves the corners
        assert len(view.draw_points(1, 0.0, rng)) == 1
        assert ((pixels > -margin) & (pixels < view.camera.size + margin)).all()


@pytest.mark.parametrize("kind", get_args(GroundKind))
def test_every_ground_is_below_the_camera(kind):
    for number, view in enumerate(views(4)):
        heights, albedo = draw_ground(view, kind, replace(SMALL, tracks_share=0.5), generator(number, kind))
        assert heights.shape == albedo.shape == view.nodes[0].shape
        assert np.isfinite(heights).all()
        assert heights[view.forward < view.forward[0] + view.height].max() < 0.75 * view.height
        assert 0.3 <= albedo.min() <= albedo.max() <= 2.5
        assert heights.std() > 0


def test_octaves_have_unit_deviation_and_are_smooth_at_coarse_cells(rng):
    x, y = np.meshgrid(np.arange(200.0), np.arange(200.0))
    fields = [octaves(x, y, np.full((200, 1), 1.0), 16.0, 0.8, rng) for _ in range(6)]
    assert np.mean([field.std() for field in fields]) == pytest.approx(1, abs=0.15)
    coarse = octaves(x, y, np.full((200, 1), 8.0), 16.0, 0.8, rng)
    assert np.abs(np.diff(coarse, axis=1)).mean() < 0.5 * np.abs(np.diff(fields[0], axis=1)).mean()


@pytest.mark.parametrize("power", [0.8, 2.0])
def test_sizes_follow_a_power_law(rng, power):
    sizes = power_law(4000, (0.01, 0.7), power, rng)
    low, high = 0.01**-power, 0.7**-power

    def share(size):
        return (low - size**-power) / (low - high)

    assert stats.kstest(sizes, share).pvalue > 0.001
    assert stats.kstest(sizes, lambda size: share(size) ** 1.2).pvalue < 0.001


def test_rocks_have_their_sizes_in_the_image_and_touch_the_ground(shapes):
    """Rocks of a single size relative to the image width on level ground."""
    ranges = replace(
        SMALL, rocks=(30, 30), smallest=0.0999, largest=(0.1, 0.1), near_share=0, perspective_share=0,
        piled_share=(0, 0), sunk=(0, 0), horizon_share=0,
    )  # fmt: skip
    for number, view in enumerate(views(2, ranges)):
        heights = np.zeros(view.nodes[0].shape)
        rocks = scatter_field_rocks(shapes, view, heights, ranges, generator(number, "rocks"))
        assert len(rocks) > 10
        for rock in rocks:
            low, high = rock.vertices.min(axis=0), rock.vertices.max(axis=0)
            longest = np.linalg.norm(rock.vertices[:, None] - rock.vertices, axis=-1).max()
            width = view.width_at((low[0] + high[0]) / 2)
            assert 0.09 < longest / width < 0.19  # the diagonal of a box of extent 0.1
            assert low[2] > -1e-9


def test_weathered_rocks_keep_unit_size_and_differ(shapes, rng):
    unit = shapes[0].mesh(1.0, 0.2).vertices
    weathered = [weather(unit, 0.2, rng) for _ in range(20)]
    for points in weathered:
        assert np.ptp(points, axis=0).max() == pytest.approx(1)
    assert min(np.abs(first - second).max() for first, second in pairwise(weathered)) > 0.02


def test_rock_noise_is_continuous_and_finer_with_a_finer_mesh(rng):
    points = np.column_stack([np.linspace(-0.5, 0.5, 2001), np.zeros((2001, 2))])
    steps = []
    for finest in (0.2, 0.01):
        noise = np.array([rock_noise(points, finest, 0.5, rng) for _ in range(20)])
        assert noise.std(axis=1) == pytest.approx(np.ones(20))
        assert np.abs(np.diff(noise)).max() < 0.2  # steps of half a thousandth of the rock
        steps.append(np.abs(np.diff(noise)).mean())
    assert steps[1] > 1.5 * steps[0]


def test_gravel_faces_outwards_and_is_small(rng):
    view = views(1)[0]
    gravel = scatter_gravel(view, np.zeros(view.nodes[0].shape), replace(SMALL, gravel=(50, 50)), rng)
    a, b, c = (gravel.vertices[gravel.faces[:, corner]] for corner in range(3))
    stone = gravel.vertices.reshape(50, 12, 3)
    centre = stone.mean(axis=1)[gravel.faces[:, 0] // 12]
    assert (np.einsum("na,na->n", np.cross(b - a, c - a), (a + b + c) / 3 - centre) > 0).mean() > 0.97
    size = np.ptp(stone, axis=1).max(axis=1) / view.width_at(stone[..., 0].mean(axis=1))
    assert size.max() < 1.3 * SMALL.gravel_size[1]


@pytest.fixture
def rendered(tmp_path):
    for rock, size in ((1, (0.2, 0.15, 0.12)), (4, (0.3, 0.2, 0.2))):
        obj.write_obj(tmp_path / "meshes" / obj.rock_name(0, rock), block(*size), "rock")

    def render(name, number=1, **changes):
        chosen = {"rocks": (25, 40), "gravel": (100, 100), "parts_share": 0.5} | changes
        render_scenes(
            terrain=0, meshes=tmp_path / "meshes", pictures=tmp_path / name, number=number, stored_px=192,
            options=SceneOptions(kind="field", lamps=2, scale=0.1), ranges=FieldRanges(**chosen), threads=1,
        )  # fmt: skip
        return tmp_path / name

    return render


def test_labels_agree_with_masks(rendered):
    folder = rendered("scenes", number=2, negative_share=0)
    count = 0
    for path in sorted((folder / "images").iterdir()):
        picture = png.read_png(path)
        mask = class_masks.read_class_mask(folder / "masks" / path.name)
        assert picture.dtype == np.uint8
        assert picture.shape == mask.shape == (121, 192)
        classes, boxes = yolo.read_boxes(folder / "labels" / f"{path.stem}.txt", (192, 121))
        assert (boxes >= -1e-3).all()
        assert (boxes <= np.add([192, 121] * 2, 1e-3)).all()
        labelled = np.zeros(mask.shape, bool)
        for x0, y0, x1, y1 in np.rint(boxes[classes == 0] + [-1, -1, 1, 1]).astype(int).clip(0):
            labelled[y0:y1, x0:x1] = True
            assert (mask[y0:y1, x0:x1] == 1).any()
        rock = mask == 1
        assert not rock.any() or labelled[rock].mean() > 0.95  # small components may be outside of a box
        count += int((classes == 0).sum())
    assert count >= 10


def test_negative_scenes_have_no_label(rendered):
    folder = rendered("negative", number=2, negative_share=1)
    assert not any(path.read_text() for path in (folder / "labels").iterdir())
    masks = [class_masks.read_class_mask(path) for path in (folder / "masks").iterdir()]
    assert {value for mask in masks for value in np.unique(mask)} == {0}
    assert all(png.read_png(path).std() > 1 for path in (folder / "images").iterdir())


def test_the_same_options_write_the_same_bytes(rendered):
    first, again = (rendered(name) for name in ("one", "two"))
    files = sorted(path for path in first.rglob("*.*"))
    assert len(files) == 6
    for path in files:
        assert path.read_bytes() == (again / path.relative_to(first)).read_bytes(), path.name


def test_rocks_are_numbered_and_parts_are_not(shapes):
    ranges = replace(SMALL, rocks=(10, 10), negative_share=0, parts_share=1, near_share=0)
    scene = draw_field_scene(shapes, ranges, generator(3, "scene"))
    assert 1 <= len(scene.mesh.rocks) <= 10
    assert len(scene.albedo) == len(scene.mesh.vertices)
    assert (scene.albedo > 0).all()


def test_texture_keeps_the_mean_and_differs_between_objects(rng):
    view = views(1)[0]
    points = np.column_stack([view.draw_points(5000, 0.0, rng), np.zeros(5000)]).astype(np.float32)
    texture = Texture.draw((0.2, 0.2), (0.4, 0.4), rng)
    ground = texture.factors(points, np.full(5000, GROUND), view, np.array([1.0, 1, 1]))
    rock = texture.factors(points, np.full(5000, ROCK_IDS + 3), view, np.array([1.0, 1, 1]))
    assert ground.mean() == pytest.approx(1, abs=0.05)
    assert 0.03 < ground.std() < 0.5
    assert 1.5 * ground.std() < rock.std() < 3 * ground.std()
    assert abs(np.corrcoef(ground, rock)[0, 1]) < 0.5
    assert texture.offsets.shape == (SHADOW_IDS, 2)


def test_the_sky_is_at_infinity_and_haze_hides_distant_ground(rng):
    radiance, distance = np.full((40, 60), 0.2, np.float32), np.full((40, 60), np.inf, np.float32)
    distance[20:], distance[30:] = 300.0, 1.0
    hazy = add_sky(np.where(np.isinf(distance), 0, radiance), distance, Atmosphere(0.5, 2.0, 100.0), rng)
    assert hazy[:20].min() > 1
    assert hazy[25].mean() > hazy[35].mean()
    assert hazy[35].mean() == pytest.approx(0.2, abs=0.05)
    black = add_sky(radiance, distance, Atmosphere(0.0, 0.0, np.inf), rng)
    np.testing.assert_array_equal(black, radiance)
