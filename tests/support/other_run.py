"""A small run of the second site: a terrain, two rocks, two lamps and the rig's lamp, photos and twins of one model."""

from pathlib import Path

import numpy as np
import pandas as pd
import yaml

from polarsim.formats import coco, obj, png, rle, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.tables import key_columns, label_table, typed, write_parquet
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.run_files import inventory, rigs
from polarsim.run_files.survey import surveyed_pose
from polarsim.schemas.photos import PHOTOS
from polarsim.site import Site
from tests.made_terrain import ROCKS, make_cube, make_sand
from tests.support.label_rows import label_row
from tests.support.other_site import SIZE, other_rig

TERRAIN, FOLDER, MODEL = "yard-a", "Terrainyard-a", "hapke"
MESHES = {rock: make_cube((x, y, side / 4), side) for rock, ((x, y), side) in ROCKS.items()}


def keys_of(site: Site) -> list[PhotoKey]:
    """Return the photos of position gate at the usual exposure of each lamp, and under the rig's lamp."""
    lamps = [("off", "45", 40), ("off", "135", 40), ("on", "no", 640)]
    return [
        PhotoKey(TERRAIN, "gate", light, azimuth, camera, exposure)
        for light, azimuth, exposure in lamps
        for camera in site.cameras.sides
    ]


def rig_of(site: Site, position: str) -> rigs.LocalisedRig:
    rig = other_rig() if site.cameras.stereo else StereoRig.single(other_rig().left)
    return rigs.LocalisedRig(rig, surveyed_pose(site.tripods[position]), "labels", {})


def boxes_of(site: Site, key: PhotoKey) -> dict[tuple[str, int], np.ndarray]:
    """Return boxes (4,) by kind and rock: rocks at the meshes, shadows next to them under a lamp."""
    found = {}
    for rock, mesh in MESHES.items():
        pixels = rig_of(site, key.position).project(key.camera, mesh.vertices)
        box = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
        if (box[:2] >= 0).all() and (box[2:] <= SIZE).all():
            found["rock", rock] = box
            if key.has_sun:
                found["shadow", rock] = np.clip(box + np.tile([12, 6], 2), 0, [*SIZE, *SIZE])
    return found


def make_run(root: Path, site: Site) -> Path:
    """Write the run and its photos below a folder."""
    run, keys, rng = root / "results/other", keys_of(site), np.random.default_rng(4)
    config = {"run": "other", "site": site.model_dump(mode="json", exclude_unset=True)}
    run.mkdir(parents=True)
    (run / "config.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    photos, rows, annotated = [], [], {}
    for key in keys:
        path = root / "photos" / f"{key}.png"
        for file in (path, run / f"renders/{MODEL}/{FOLDER}/{key}.png"):
            png.write_png(file, rng.integers(100, 3000, SIZE[::-1]).astype(np.uint16))
        file = {"width": SIZE[0], "height": SIZE[1], "bits": 16, "sha256": "", "path": str(path)}
        photos.append(key_columns(key) | file)
        boxes = boxes_of(site, key)
        rows += [label_row(key, kind, rock, box, source="fused") for (kind, rock), box in boxes.items()]
        classes = np.array([BOX_CLASSES.index(kind) for kind, _ in boxes], int)
        yolo.write_boxes(run / f"labels/boxes/{FOLDER}/{key}.txt", classes, np.array(list(boxes.values())), SIZE)
        rings = [(2 if kind == "rock" else 3, _ring(box)) for (kind, _), box in boxes.items()]
        yolo.write_polygons(run / f"labels/polygons/{FOLDER}/{key}.txt", rings, SIZE)
        annotated[key] = [Annotation(kind, rock, box, _mask(box), "fused") for (kind, rock), box in boxes.items()]
        ids = np.ones(SIZE[::-1], np.uint16)
        for (kind, rock), box in boxes.items():
            ids[_window(box)] = (1000 if kind == "rock" else 2000) + rock
        png.write_png(run / f"renders/instances/{FOLDER}/{str(key).rpartition('_')[0]}.png", ids)
    write_parquet(run / f"acquire/{FOLDER}/photos.parquet", typed(photos, PHOTOS))
    inventory.write_inventory(
        run / f"acquire/{FOLDER}/inventory.json", inventory.Inventory(TERRAIN, "files", clouds={"gate": "gate.ply"})
    )
    for stage in ("labels", "renders"):
        write_parquet(run / f"{stage}/tables/{FOLDER}.parquet", label_table(rows))
        coco.write_coco(run / f"{stage}/coco/{FOLDER}.json", annotated, site, SIZE)
    for position in site.positions:
        rigs.write_localised(run / f"cameras/{FOLDER}/Pos{position}.json", rig_of(site, position))
    obj.write_obj(run / f"meshes/{FOLDER}" / obj.ground_name(TERRAIN), make_sand(), "ground")
    for rock, mesh in MESHES.items():
        obj.write_obj(run / f"meshes/{FOLDER}" / obj.rock_name(TERRAIN, rock), mesh, f"rock{rock}")
    rocks = [{"rock": rock, "x": x, "y": y, "z": side / 4, "size_m": side} for rock, ((x, y), side) in ROCKS.items()]
    write_parquet(run / f"rocks/{FOLDER}/rocks.parquet", pd.DataFrame(rocks))
    return run


def _window(box: np.ndarray) -> tuple[slice, slice]:
    x0, y0, x1, y1 = np.round(box).astype(int)
    return slice(y0, y1), slice(x0, x1)


def _mask(box: np.ndarray) -> rle.Rle:
    mask = np.zeros(SIZE[::-1], bool)
    mask[_window(box)] = True
    return rle.encode_rle(mask, SIZE)


def _ring(box: np.ndarray) -> np.ndarray:
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
