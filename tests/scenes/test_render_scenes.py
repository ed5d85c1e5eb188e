"""Images of scenes: exact labels of visible objects, and reproducible bytes."""

import numpy as np
import pytest

from polarsim.errors import DetectError
from polarsim.formats import obj, png, yolo
from polarsim.photo import BLACK_LEVEL, WHITE_LEVEL
from polarsim.run_files import class_masks
from polarsim.run_files.instances import GROUND, ROCK_IDS
from polarsim.scenes.options import SceneOptions, SceneRanges
from polarsim.scenes.render_scenes import add_background, render_scenes
from polarsim.scenes.scene_image import object_contrast, tone_curve
from tests.scenes.conftest import block
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

STRAIGHT = tone_curve(1)


@pytest.fixture
def rendered(tmp_path):
    for rock, size in ((1, (0.2, 0.15, 0.12)), (4, (0.3, 0.2, 0.2))):
        obj.write_obj(tmp_path / "meshes" / obj.rock_name(1, rock), block(*size), "rock")

    def render(name, number=1, **ranges):
        chosen = {"rocks": (4, 4), "rig_share": 0, "max_strokes": 0, "cell_m": 0.05} | ranges
        render_scenes(
            terrain=1, meshes=tmp_path / "meshes", pictures=tmp_path / name, number=number, stored_px=128,
            options=SceneOptions(lamps=3, scale=0.1), ranges=SceneRanges(**chosen), threads=1,
        )  # fmt: skip
        return tmp_path / name

    return render


def test_every_scene_and_lamp_has_an_image_and_labels(rendered):
    folder = rendered("scenes", number=2)
    names = [path.stem for path in sorted((folder / "images").iterdir())]
    assert names == [f"t01_s00{scene}_l{lamp}" for scene in (0, 1) for lamp in (0, 1, 2)]
    assert names == [path.stem for path in sorted((folder / "labels").iterdir())]
    labels = [yolo.read_boxes(folder / "labels" / f"{name}.txt", size=SIZE) for name in names]
    assert all((boxes >= -1e-3).all() and (boxes <= [WIDTH, HEIGHT] * 2).all() for _, boxes in labels)
    assert sum((classes == 0).sum() for classes, _ in labels) >= 6
    assert sum((classes == 1).sum() for classes, _ in labels) >= 3
    pictures = [png.read_png(folder / "images" / f"{name}.png") for name in names]
    assert all((picture.dtype, picture.shape) == (np.uint8, (80, 128)) for picture in pictures)
    assert all(picture.std() > 3 for picture in pictures)


def test_masks_contain_labelled_objects_and_ignore_others(rendered):
    folder = rendered("scenes", number=2)
    for path in sorted((folder / "images").iterdir()):
        mask = class_masks.read_class_mask(folder / "masks" / path.name)
        assert mask.shape == png.read_png(path).shape
        classes, boxes = yolo.read_boxes(folder / "labels" / f"{path.stem}.txt", (128, 80))
        labelled = {kind: np.zeros(mask.shape, bool) for kind in (0, 1)}
        for kind, box in zip(classes, boxes, strict=True):
            x0, y0, x1, y1 = np.rint(box + np.array([-1, -1, 1, 1])).astype(int).clip(0)
            labelled[kind][y0:y1, x0:x1] = True
            assert (mask[y0:y1, x0:x1] == 1 + kind).any()
        for kind, inside in labelled.items():
            shown = mask == 1 + kind
            assert not shown.any() or inside[shown].mean() > 0.95  # small components may be outside the box
    invisible = rendered("invisible", min_contrast=1.01)
    masks = [class_masks.read_class_mask(path) for path in (invisible / "masks").iterdir()]
    assert {value for mask in masks for value in np.unique(mask)} == {0, 255}
    assert not any(path.read_text() for path in (invisible / "labels").iterdir())
    shown = rendered("seen", min_contrast=0)
    assert sum(len(path.read_text().splitlines()) for path in (shown / "labels").iterdir()) >= 6


def test_the_same_options_write_the_same_bytes(rendered):
    first, again = (rendered(name) for name in ("one", "two"))
    for path in sorted(first.rglob("*.*")):
        assert path.read_bytes() == (again / path.relative_to(first)).read_bytes(), path.name


def test_labels_cover_the_bright_rocks(rendered):
    """Rocks brighter than smooth sand: the boxes contain the brightest pixels."""
    flat = {"rough_sd_m": (0, 0), "max_layers": 0, "swell_sd_m": (0, 0), "max_craters": 0}
    folder = rendered(
        "bright", **flat, rock_albedo=(4, 4), rock_spread=0, patch_sd=(0, 0), walled_share=0, noise=False,
        exposure=(0.2, 0.2), near_share=0, background=(0, 0), lens_flare=(0, 0), number=3,
        models=("principled",), specular=(0, 0), roughness=(1, 1), elevation_deg=(8, 15),
    )  # fmt: skip
    inside, outside = [], []
    for path in sorted((folder / "images").iterdir()):
        picture = png.read_png(path).astype(float)
        classes, boxes = yolo.read_boxes(folder / "labels" / f"{path.stem}.txt", (128, 80))
        rock = np.zeros(picture.shape, bool)
        for x0, y0, x1, y1 in boxes[classes == 0].round().astype(int):
            rock[y0:y1, x0:x1] = True
        bright = picture > 1.6 * np.median(picture[picture > 5])
        inside.append(bright[rock].sum())
        outside.append(bright[~rock].sum())
    assert sum(inside) > 20
    assert sum(outside) < 0.15 * sum(inside)


def test_contrast_is_measured_in_the_image():
    """A rock at 0.2 and sand at 0.6 of white: dark photos have less contrast, overexposed photos have none."""
    ids = np.full((30, 40), GROUND, np.uint16)
    ids[10:20, 5:15] = ROCK_IDS + 4
    box = np.array([5, 10, 15, 20.0])
    radiance = np.where(ids == GROUND, 0.6, 0.2).astype(np.float32)
    white = WHITE_LEVEL - BLACK_LEVEL
    for light, expected in ((1, 0.4), (0.1, 0.04), (10, 0)):
        assert object_contrast(ids, ROCK_IDS + 4, box, radiance, light * white, STRAIGHT) == pytest.approx(
            expected, abs=0.005
        )
    assert object_contrast(ids, ROCK_IDS + 4, box, radiance, 0.1 * white, tone_curve(2)) == pytest.approx(
        0.06**0.5 - 0.02**0.5, abs=0.005
    )
    far = np.full_like(radiance, 0.2)
    far[:, 20:] = 0.9
    assert object_contrast(ids, ROCK_IDS + 4, box, far, white, STRAIGHT) == 0
    edge = np.where(np.arange(40) < 3, ROCK_IDS + 4, GROUND)[None].repeat(30, 0).astype(np.uint16)
    assert object_contrast(edge, ROCK_IDS + 4, np.array([0, 0, 3, 30.0]), radiance * 0 + 0.5, white, STRAIGHT) == 0


@pytest.mark.parametrize("gamma", [1.0, 1.5, 2.0])
def test_the_tone_curve_runs_from_black_to_white(gamma):
    curve = tone_curve(gamma)
    assert (curve[: BLACK_LEVEL + 1] == 0).all()
    assert curve[WHITE_LEVEL] == 255
    assert curve[BLACK_LEVEL + (WHITE_LEVEL - BLACK_LEVEL) // 2] == pytest.approx(255 * 0.5 ** (1 / gamma), abs=1)


def test_a_folder_without_rocks_is_reported(tmp_path):
    (tmp_path / "meshes").mkdir()
    with pytest.raises(DetectError) as error:
        render_scenes(
            terrain=6, meshes=tmp_path / "meshes", pictures=tmp_path / "scenes", number=1, stored_px=64,
            options=SceneOptions(), threads=1,
        )  # fmt: skip
    assert error.value.path == tmp_path / "meshes"


def test_the_hall_is_added_to_unlit_pixels_only(rng):
    bare = np.zeros((60, 90), bool)
    bare[:10] = True
    found = add_background(np.where(bare, 0, 1).astype(np.float32), bare, (0.3, 0.3), rng)
    assert found.min() >= 0
    assert 0 < found[:10].mean() < 1
    assert (found[10:] == 1).all()
