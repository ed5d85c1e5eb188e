"""Published labels reduced to few seeds: propagated labels are at least as accurate as copies of the seeds."""

import numpy as np
import pytest

from polarsim.acquire.index import index_terrain
from polarsim.acquire.options import SeedOptions, SourceOptions
from polarsim.cameras.locate import locate_cameras
from polarsim.cameras.options import LocalisationOptions
from polarsim.formats import release, yolo
from polarsim.geometry.boxes import clip, iou, match_by_iou
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import PropagationInputs, propagate_labels
from polarsim.photo import PhotoKey
from polarsim.rocks.adopt import adopt_rocks
from polarsim.run_files import rigs
from polarsim.site import polar
from tests.support.polar_photos import SIZE

pytestmark = pytest.mark.release

TERRAIN, SEEDED = 11, "270"  # three of nine rocks are lit: too few to localise A and B
EXPOSURES = (32, 256, 1024)
# Left to Right on other terrains, facts of the data set: dx = PLANE[position] - 0.18 (y - 608), dy = 15.5 px.
PLANE = {"A": -185.0, "B": -188.0, "C": -182.4}


@pytest.fixture(scope="module")
def labels(release_root, tmp_path_factory):
    """Truth, propagated labels and seeds by key, and the cameras."""
    folder = tmp_path_factory.mktemp("few")
    index_terrain(
        site=polar(),
        terrain=TERRAIN,
        positions=list("ABC"),
        source=SourceOptions(kind="release", root=release_root),
        seed_options=SeedOptions(light="off", camera="L", azimuths=(SEEDED,), exposure="best"),
        photos=folder / "photos.parquet",
        calibration=folder / "calibration.json",
        inventory=folder / "inventory.json",
        seeds=folder / "seeds",
    )
    locate_cameras(
        site=polar(),
        terrain=TERRAIN,
        positions=list("ABC"),
        inventory=folder / "inventory.json",
        calibration=folder / "calibration.json",
        seeds=folder / "seeds",
        cameras=folder / "cameras",
        options=LocalisationOptions(),
    )
    adopt_rocks(
        site=polar(),
        terrain=TERRAIN,
        inventory=folder / "inventory.json",
        cameras=folder / "cameras",
        rocks=folder / "rocks.parquet",
        cuboids=folder / "cuboids.yaml",
        meshes=folder / "meshes",
    )
    files = release.label_files(release_root, TERRAIN)
    keys = [key for key in sorted(files) if key.azimuth in polar().suns and key.exposure_ms in EXPOSURES]
    names = ("photos.parquet", "inventory.json", "seeds", "cameras", "meshes")
    propagate_labels(
        PropagationInputs(polar(), TERRAIN, keys, *(folder / name for name in names)),
        boxes=folder / "boxes",
        table=folder / "labels.parquet",
        options=LabelsOptions(visibility="annotator", ray_step_px=4),
    )
    truth = {key: rocks_of(files[key]) for key in keys}
    found = {key: rocks_of(folder / "boxes" / f"{key}.txt") for key in keys}
    seeds = {PhotoKey.parse(path.stem).position: rocks_of(path) for path in (folder / "seeds").glob("*.txt")}
    return truth, found, seeds, rigs.read_all_localised(folder / "cameras")


def rocks_of(path):
    classes, boxes = yolo.read_boxes(path, size=SIZE)
    return boxes[classes == 0]


def copied(seed, key):
    """Return the boxes of a seed, for the right photo shifted by the plane fitted to different terrains."""
    if key.camera == "L":
        return seed
    dx = PLANE[key.position] - 0.18 * ((seed[:, 1] + seed[:, 3]) / 2 - 608)
    return clip(seed + np.stack([dx, np.full_like(dx, 15.5)] * 2, axis=1), 1936, 1216)


def f1(truth, found):
    """Pooled over files, pairs at IoU >= 0.5."""
    hits = sum(len(match_by_iou(iou(truth[key], boxes))[0]) for key, boxes in found.items())
    return 2 * hits / sum(len(truth[key]) + len(boxes) for key, boxes in found.items())


def test_positions_without_localisation_are_marked_and_the_run_continues(labels):
    localised = labels[3]
    assert set(localised) == set("ABC")
    assert localised["C"].method == "labels"
    assert localised["A"].unproven
    assert localised["B"].unproven


def test_other_exposures_of_the_seeded_photos_are_the_seeds(labels):
    _, found, seeds, _ = labels
    for key, boxes in found.items():
        if (key.camera, key.azimuth) == ("L", SEEDED):
            np.testing.assert_array_equal(boxes, seeds[key.position])


@pytest.mark.parametrize("position", "ABC")
@pytest.mark.parametrize("camera", "LR")
def test_labels_are_at_least_as_accurate_as_copies_of_the_seeds(labels, position, camera):
    truth, found, seeds, _ = labels
    own = {key: boxes for key, boxes in found.items() if (key.position, key.camera) == (position, camera)}
    assert all(len(boxes) for boxes in own.values())
    assert f1(truth, own) >= f1(truth, {key: copied(seeds[position], key) for key in own})
