"""Labels of a site with named terrains, other lamps and smaller photos, with two cameras and with one."""

import json

import numpy as np
import pandas as pd
import pytest

from polarsim.formats import obj, png, tables, yolo
from polarsim.geometry.stereo import StereoRig
from polarsim.labels.masks import draw_masks
from polarsim.labels.options import LabelsOptions
from polarsim.labels.propagate import PropagationInputs, propagate_labels
from polarsim.run_files import inventory, rigs
from polarsim.run_files.survey import surveyed_pose
from tests.support.other_site import SIZE, one_camera, other_rig, other_site

from .conftest import BLOCKS, block, flat_ground

TERRAIN = "yard-a"


@pytest.fixture(params=[True, False], ids=["stereo", "one camera"])
def site(request):
    return other_site() if request.param else one_camera()


@pytest.fixture
def inputs(site, tmp_path):
    """Two blocks, localised rigs at both positions, and seeds of the rocks under one lamp at one position."""
    names = ("photos.parquet", "inventory.json", "seeds", "cameras", "meshes")
    files = PropagationInputs(site, TERRAIN, list(site.photos_of(TERRAIN)), *(tmp_path / name for name in names))
    obj.write_obj(files.meshes / obj.ground_name(TERRAIN), flat_ground(half=3.2), "ground")
    for rock, (centre, size) in BLOCKS.items():
        obj.write_obj(files.meshes / obj.rock_name(TERRAIN, rock), block(centre, size), f"rock{rock}")
    rig_of_site = other_rig() if site.cameras.stereo else StereoRig.single(other_rig().left)
    for position, tripod in site.tripods_of(TERRAIN).items():
        rig = rigs.LocalisedRig(rig_of_site, surveyed_pose(tripod), "labels", {})
        rigs.write_localised(files.cameras / f"Pos{position}.json", rig)
    inventory.write_inventory(files.inventory, inventory.Inventory(TERRAIN, "files"))
    tables.write_parquet(files.photos, pd.DataFrame({name: [] for name in tables.PHOTO_COLUMNS}))
    seeds = np.array(list(expected(files, "gate", "L").values()))
    yolo.write_boxes(files.seeds / "yard-a_gate_off_45_L_0040.txt", np.zeros(len(seeds), int), seeds, SIZE)
    return files


def expected(files, position, camera):
    """Return the boxes (4,) of the projected blocks inside the photo by rock."""
    rig = rigs.read_all_localised(files.cameras)[position]
    boxes = {}
    for rock, (centre, size) in BLOCKS.items():
        pixels = rig.project(camera, block(centre, size).vertices)
        boxes[rock] = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
    return {rock: box for rock, box in boxes.items() if (box[:2] >= 0).all() and (box[2:] <= SIZE).all()}


def test_labels_are_propagated_to_all_photos_of_the_site(site, inputs, tmp_path):
    out = tmp_path / "out"
    options = LabelsOptions(min_shadow_exposure_ms_by_terrain={"yard-b": 160}, min_rock_side_px=6)
    propagate_labels(inputs, boxes=out / "boxes", table=out / "labels.parquet", options=options)
    assert {path.stem for path in (out / "boxes").glob("*.txt")} == {str(key) for key in inputs.keys}
    table = tables.read_parquet(out / "labels.parquet", tables.LABEL_COLUMNS)
    assert set(table["terrain"]) == {TERRAIN}
    assert set(table["azimuth"]) >= {"45", "135"}
    assert set(table["camera"]) == set(site.cameras.sides)
    for (position, camera, _), rows in table[(table["kind"] == "rock") & (table["azimuth"] != "no")].groupby(
        ["position", "camera", "key"]
    ):
        wanted = expected(inputs, position, camera)
        found = dict(zip(rows["rock"], rows[["x0", "y0", "x1", "y1"]].to_numpy(), strict=True))
        assert set(found) <= set(BLOCKS)
        for rock in set(found) & set(wanted):
            np.testing.assert_allclose(found[rock], wanted[rock], atol=3)
    assert set(table["position"]) == {"gate", "mast"}
    assert {"rock", "shadow"} <= set(table["kind"])


def test_masks_have_the_size_of_the_photos(site, inputs, tmp_path):
    out = tmp_path / "out"
    propagate_labels(inputs, boxes=out / "boxes", table=out / "labels.parquet", options=LabelsOptions())
    draw_masks(
        site=site,
        terrain=TERRAIN,
        keys=[key for key in inputs.keys if key.light == "off" and key.exposure_ms == 40],
        photos=inputs.photos,
        table=out / "labels.parquet",
        cameras=inputs.cameras,
        meshes=inputs.meshes,
        polygons=out / "polygons",
        masks=out / "masks",
        preview=out / "preview.png",
        annotations=out / "coco.json",
    )
    masks = sorted((out / "masks").glob("*.png"))
    assert masks
    assert {png.read_png(path).shape for path in masks} == {SIZE[::-1]}
    content = json.loads((out / "coco.json").read_text())
    assert {(image["width"], image["height"]) for image in content["images"]} == {SIZE}
    assert [image["id"] for image in content["images"]] == [site.image_id(site.key(path.stem)) for path in masks]
    assert {tuple(label["segmentation"]["size"]) for label in content["annotations"]} == {SIZE[::-1]}
