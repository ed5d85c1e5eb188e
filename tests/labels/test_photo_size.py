"""The same scene in photos of half the size: labels have half the size and are otherwise equal."""

from dataclasses import replace

import numpy as np
import pytest

from polarsim.formats import tables, yolo
from polarsim.labels.brightness import Brightness
from polarsim.labels.casting import fit_to_dark_region
from polarsim.labels.label import make_label
from polarsim.labels.options import LabelsOptions
from polarsim.labels.projection import at_border
from polarsim.labels.propagate import propagate_labels
from polarsim.labels.shadows import CastShadow, mean_shadow
from polarsim.photo import NO_ROCK, PhotoKey, photo_scale
from polarsim.run_files import rigs
from polarsim.site import polar
from tests.support.polar_photos import SIZE

from .conftest import localised

EDGES = ["x0", "y0", "x1", "y1"]
HALF = tuple(side // 2 for side in SIZE)
KEYS = [
    PhotoKey(3, position, "off", azimuth, camera, 256)
    for position in "AC"
    for azimuth in ("30", "180", "270", "350")
    for camera in ("L", "R")
]


def labels_of(scene, site, step, out):
    options = LabelsOptions(visibility="annotator", ray_step_px=step)
    inputs = replace(scene.inputs(KEYS), site=site)
    propagate_labels(inputs, boxes=out / "boxes", table=out / "labels.parquet", options=options)
    return tables.read_parquet(out / "labels.parquet")


def halve_photos(scene):
    """Replace rigs and seeds of a scene by those of photos of half the size."""
    for position in "AC":
        rig = localised(position)
        lenses = {"left": rig.rig.left.scaled(0.5), "right": rig.rig.right.scaled(0.5)}
        rigs.write_localised(scene.cameras / f"Pos{position}.json", replace(rig, rig=replace(rig.rig, **lenses)))
    for path in scene.seeds.glob("*.txt"):
        classes, boxes = yolo.read_boxes(path, SIZE)
        yolo.write_boxes(path, classes, boxes / 2, size=HALF)


def test_labels_are_equal_in_photos_of_half_the_size(scene, tmp_path):
    site = polar()
    full = labels_of(scene, site, 2, tmp_path / "full")
    halve_photos(scene)
    images = site.images.model_copy(update={"width": HALF[0], "height": HALF[1]})
    half = labels_of(scene, site.model_copy(update={"images": images}), 1, tmp_path / "half")
    assert set(full["source"]) == {"seed", "fused", "cast", "projected"}
    names = ["key", "kind", "rock", "source", "confidence"]
    assert half[names].to_dict("records") == full[names].to_dict("records")
    np.testing.assert_allclose(2 * half[EDGES], full[EDGES], atol=0.01)


@pytest.mark.parametrize("factor", [2, 3])
def test_a_dark_region_is_found_in_larger_photos(factor):
    """Edges differ by the window over which brightness is averaged, which has 3 px at any size."""
    shape, step, real = (400, 968), 1, (206, 196, 326, 234)

    def found(size):
        rows, columns = shape[0] * size, shape[1] * size
        rate, shadow = np.ones((rows, columns), np.float32), np.full((rows, columns), NO_ROCK)
        x0, y0, x1, y1 = (size * edge for edge in real)
        rate[y0:y1, x0:x1] = 0.1
        rate[200 * size : 202 * size, x1 : x1 + 40 * size] = 0.1  # relief of the ground, 2 px wide
        shadow[200 * size : 240 * size, 200 * size : 320 * size] = 4
        box = size * np.array([200.0, 200, 320, 240])
        photo = Brightness(rate, (256,), 1.0)
        return fit_to_dark_region(box, shadow, np.full(shadow.shape, NO_ROCK), step, 4, photo)

    np.testing.assert_allclose(found(factor) / factor, found(1), atol=2)


def test_confidences_depend_on_the_size_relative_to_the_photo():
    box = np.array([100.0, 100, 160, 140])
    assert make_label("rock", 4, "fused", box, SIZE[0]).confidence == pytest.approx(
        make_label("rock", 4, "fused", 2 * box, 2 * SIZE[0]).confidence
    )


def test_a_box_is_at_the_border_within_the_same_share_of_the_photo():
    boxes = np.array([[3.0, 100, 200, 300]])  # 3 px from the left: 1.5 px at half of this width
    assert not at_border(boxes, np.array(SIZE)).any()
    assert at_border(boxes, 2 * np.array(SIZE)).tolist() == [[True, False, False, False]]


def test_dark_regions_may_differ_more_from_annotations_in_larger_photos():
    annotated = np.array([100.0, 200, 110, 210])
    cast = CastShadow(annotated + np.array([0, 0, 8, 0]), in_photo=True)  # 8 px: more than 6, less than 12
    inside = np.zeros(4, bool)
    np.testing.assert_array_equal(mean_shadow(annotated, inside, cast, 0.3, photo_scale(SIZE[0])), annotated)
    moved = mean_shadow(annotated, inside, cast, 0.3, photo_scale(2 * SIZE[0]))
    np.testing.assert_allclose(moved, annotated + np.array([0, 0, 4, 0]))
