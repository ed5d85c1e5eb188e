"""Variants differ in all that is drawn, keep the rocks' numbers, and have exact labels."""

import numpy as np
import pytest

from benchmarks.cover_photos.relief import ReliefOptions, sand_height, smooth_sand
from benchmarks.cover_photos.variants import VariantOptions, draw_variant
from benchmarks.cover_photos.varied import contrast_of_rock, render_varied
from polarsim.formats import png, yolo
from polarsim.formats.instances import GROUND, ROCK_IDS
from polarsim.photo import NO_ROCK
from polarsim.randomness import generator

COARSE = ReliefOptions(cell_m=0.1, most_craters=0)
TWO = {"rock_ids": (1, 5), "places": ((0.0, 0.0), (1.0, 0.5))}


@pytest.mark.parametrize("moved_share", [0.0, 1.0])
def test_rocks_keep_their_numbers_and_vertices_their_albedo(blocks, moved_share):
    options = VariantOptions(relief=COARSE, moved_share=moved_share)
    variant = draw_variant(blocks(**TWO), options, generator(0, "test"))
    assert variant.mesh.rocks == [1, 5]
    assert len(variant.albedo) == len(variant.mesh.vertices)
    assert (variant.albedo > 0).all()


def test_rocks_that_are_not_moved_follow_the_relief_and_no_more(blocks):
    mesh = blocks(**TWO)
    changed = draw_variant(mesh, VariantOptions(relief=COARSE, moved_share=0), generator(1, "test")).mesh
    for rock in mesh.rocks:
        shift = changed.part(rock).vertices - mesh.part(rock).vertices
        np.testing.assert_allclose(shift[:, :2], 0, atol=1e-12)
        np.testing.assert_allclose(shift[:, 2], shift[0, 2], atol=1e-12)
        assert 0 < abs(shift[0, 2]) < 0.1


def test_moved_rocks_keep_their_shape_and_stand_on_the_sand(blocks):
    mesh = blocks(**TWO)
    options = VariantOptions(relief=None, moved_share=1, rock_scale=(1.2, 1.2))
    for number in range(5):
        moved = draw_variant(mesh, options, generator(number, "test")).mesh
        quadric = smooth_sand(mesh.part(NO_ROCK).vertices)
        for rock in mesh.rocks:
            points, before = moved.part(rock).vertices, mesh.part(rock).vertices
            sides = np.linalg.norm(points - points[0], axis=1) / 1.2
            np.testing.assert_allclose(sides, np.linalg.norm(before - before[0], axis=1), atol=1e-9)
            assert points[:, 2].min() == pytest.approx(sand_height(quadric, *points[0, :2]), abs=1e-6)


def test_the_same_draw_gives_the_same_variant(blocks):
    first, again, other = (draw_variant(blocks(), VariantOptions(relief=COARSE), generator(n, "x")) for n in (3, 3, 4))
    np.testing.assert_array_equal(first.mesh.vertices, again.mesh.vertices)
    assert first.options == again.options
    assert first.options != other.options


def test_a_variant_has_one_of_the_models_that_are_asked_for(blocks):
    def models(**options):
        drawn = (draw_variant(blocks(), VariantOptions(relief=None, **options), generator(n, "x")) for n in range(12))
        return {variant.options.models for variant in drawn}

    assert models() == {("hapke",), ("principled",)}
    assert models(models=("principled",)) == {("principled",)}


def test_a_rock_is_seen_by_its_own_light_or_by_its_outline():
    ids = np.full((30, 40), GROUND, np.uint16)
    ids[10:16, 0:8] = ROCK_IDS + 4  # cut by the picture's edge
    box, dark = np.array([0, 10, 8, 16.0]), np.full((30, 40), 3, np.float32)
    assert contrast_of_rock(ids, 4, box, dark) == 0
    lit = dark.copy()
    lit[10:16, 0:3] = 8
    assert contrast_of_rock(ids, 4, box, lit) == 5
    outline = np.where(ids == GROUND, 5, dark).astype(np.float32)
    assert contrast_of_rock(ids, 4, box, outline) == 2
    far = dark.copy()
    far[:, 12:] = 9
    assert contrast_of_rock(ids, 4, box, far) == 0


@pytest.fixture
def varied(folders):
    def render(name, **options):
        # The small lens is a tenth of a photo's size: a rock of 0.4 m has 30 pixels there too.
        chosen = VariantOptions(number=2, scale=1, positions=("A", "C"), relief=COARSE, moved_share=0, **options)
        render_varied(
            terrain=1, cameras=folders / "cameras", meshes=folders / "meshes", pictures=folders / name,
            options=chosen, threads=1,
        )  # fmt: skip
        return folders / name

    return render


def test_every_view_lamp_and_variant_has_a_picture_and_boxes(varied):
    folder = varied("varied", rim=False)
    names = {path.stem for path in (folder / "images").iterdir()}
    assert names == {f"01_A_{az}_{cam}_v0{n}" for az in (30, 180, 270, 350) for cam in "LR" for n in (0, 1)}
    assert names == {path.stem for path in (folder / "labels").iterdir()}
    picture = png.read(folder / "images" / "01_A_30_L_v00.png")
    assert (picture.dtype, picture.shape) == (np.uint16, (140, 200))
    classes, boxes = yolo.read_boxes(folder / "labels" / "01_A_30_L_v00.txt", (200, 140))
    assert (classes == 0).sum() == 1
    assert (boxes >= -1e-3).all()


def test_the_same_options_write_the_same_bytes(varied):
    first, again = (varied(name, rim=False) for name in ("one", "two"))
    for path in sorted(first.rglob("*.*")):
        assert path.read_bytes() == (again / path.relative_to(first)).read_bytes(), path.name


def test_rocks_that_nobody_can_see_have_no_label(varied):
    bright, dark = (varied(name, rim=False, least_contrast=least) for name, least in (("bright", 0), ("dark", 1e6)))
    name = "01_A_30_L_v00.txt"
    kinds = [yolo.read_boxes(folder / "labels" / name)[0] for folder in (bright, dark)]
    assert (kinds[0] == 0).sum() == 1
    assert (kinds[1] == 0).sum() == 0
    assert (kinds[0] == 1).sum() == (kinds[1] == 1).sum()  # a shadow lies on lit sand
