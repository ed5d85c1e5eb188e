"""Propagation of the left labels of the release, compared with the human labels of the remaining photos."""

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import obj, tables, yolo
from polarsim.geometry.boxes import iou, match_by_iou
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import camera_pose
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import PropagationInputs, propagate_labels
from polarsim.photo import PhotoKey
from polarsim.run_files import inventory, rigs
from polarsim.site import polar
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig

from .conftest import flat_ground

pytestmark = pytest.mark.release

POSES = {  # left cameras fitted to left boxes with the stated rig: x, y, z in metres; yaw, pitch, roll in degrees
    1: {"A": (3.541, -0.402, 1.482, 178.20, 24.42, -1.00), "C": (0.747, -3.526, 1.505, 104.75, 28.32, 2.06)},
    11: {"A": (3.534, -0.392, 1.511, 180.60, 24.66, 0.20), "C": (0.646, -3.890, 1.573, 101.54, 28.05, 0.25)},
}


def sloping_ground(meshes: dict[int, Mesh]) -> Mesh:
    """A plane through the feet of the rocks."""
    feet = np.array(
        [[*mesh.vertices[:, :2].mean(axis=0), np.percentile(mesh.vertices[:, 2], 3)] for mesh in meshes.values()]
    )
    slope = np.linalg.lstsq(np.column_stack([feet[:, :2], np.ones(len(feet))]), feet[:, 2], rcond=None)[0]
    level = flat_ground()
    xy = level.vertices[:, :2]
    return Mesh(np.column_stack([xy, xy @ slope[:2] + slope[2]]), level.faces)


def f1(truth: dict, found: dict, number: int) -> float:
    """Pooled over files, pairs at IoU >= 0.5."""
    counts = np.zeros(3)
    for key, (classes, boxes) in truth.items():
        annotated, own = boxes[classes == number], found[key][1][found[key][0] == number]
        counts += [len(match_by_iou(iou(annotated, own))[0]), len(annotated), len(own)]
    return 2 * counts[0] / (counts[1] + counts[2])


@pytest.fixture(scope="module", params=sorted(POSES))
def labels(request, release_root, tmp_path_factory):
    """Return human and propagated labels of the photos without seeds, by key."""
    terrain, folder = request.param, tmp_path_factory.mktemp("release")
    files = {}
    for path in sorted((release_root / "Labels" / f"Terrain{terrain:02d}").glob("*_????.txt")):
        key = PhotoKey.parse(path.stem)
        if key.position in POSES[terrain] and key.azimuth != "no" and key.exposure_ms in (64, 256, 1024):
            files[key] = yolo.read_boxes(path, size=SIZE)
    seeds = [key for key in files if (key.camera, key.light, key.exposure_ms) == ("L", "off", 256)]
    for key in seeds:
        yolo.write_boxes(folder / "seeds" / f"{key}.txt", *files[key], size=SIZE)
    published = obj.rock_files(release_root / "TerrainMeshes" / f"Terrain{terrain:02d}")
    meshes = {rock: obj.read_obj(path) for rock, path in published.items()}
    for rock, mesh in meshes.items():
        obj.write_obj(folder / "meshes" / obj.rock_name(terrain, rock), mesh, f"rock{rock}")
    obj.write_obj(folder / "meshes" / obj.ground_name(terrain), sloping_ground(meshes), "ground")
    for position, (x, y, z, *angles) in POSES[terrain].items():
        pose = camera_pose(np.array([x, y, z]), *np.radians(angles))
        rigs.write_localised(folder / "cameras" / f"Pos{position}.json", rigs.LocalisedRig(default_rig(), pose))
    inventory.write_inventory(folder / "inventory.json", inventory.Inventory(terrain, "release"))
    tables.write_parquet(folder / "photos.parquet", pd.DataFrame({name: [] for name in tables.PHOTO_COLUMNS}))
    names = ("photos.parquet", "inventory.json", "seeds", "cameras", "meshes")
    propagate_labels(
        PropagationInputs(polar(), terrain, list(files), *(folder / name for name in names)),
        boxes=folder / "boxes",
        table=folder / "labels.parquet",
        options=LabelsOptions(visibility="annotator", min_shadow_exposure_ms_by_terrain={1: 32}, ray_step_px=4),
    )
    found = {key: yolo.read_boxes(folder / "boxes" / f"{key}.txt", size=SIZE) for key in files}
    return {key: value for key, value in files.items() if key not in seeds}, found


def only(truth: dict, **parts: str) -> dict:
    return {key: value for key, value in truth.items() if all(getattr(key, k) == v for k, v in parts.items())}


def test_propagated_exposures_agree_with_human_labels(labels):
    truth = only(labels[0], camera="L", light="off")
    assert f1(truth, labels[1], 0) > 0.97
    assert f1(truth, labels[1], 1) > 0.93


def test_the_rover_light_does_not_change_labels(labels):
    truth = only(labels[0], camera="L", light="on")
    assert f1(truth, labels[1], 0) > 0.97


def test_right_photos_agree_with_human_labels(labels):
    # Human labels of right and left photos agree to 0.92 (rocks) and 0.88 (shadows) at best.
    truth = only(labels[0], camera="R")
    assert f1(truth, labels[1], 0) > 0.85
    assert f1(truth, labels[1], 1) > 0.75
