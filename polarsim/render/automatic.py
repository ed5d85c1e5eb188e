"""Exact labels of the twins, from what every pixel's ray met: rock and shadow boxes, instance masks, a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy import ndimage

from polarsim.formats import png, tables, yolo
from polarsim.formats.rigs import PlacedRig, read_all_placed
from polarsim.formats.scene import read_terrain
from polarsim.geometry.boxes import of_mask
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, PhotoKey
from polarsim.progress import track
from polarsim.render.hits import cast_strip, for_strips
from polarsim.render.lamps import Lamp, lamps_of, lit_by
from polarsim.render.options import RenderOptions
from polarsim.render.shadows import ground_shadows
from polarsim.render.surfaces import ROCK_IDS, SHADOW_IDS, Surfaces, surfaces_of
from polarsim.render.twins import views_of

NO_LAMP = "none"  # name of the picture of ids without any shadow
_TOUCHING = np.ones((3, 3), bool)  # pixels that meet at a corner belong together


def render_ids(
    surfaces: Surfaces, sandbox_from_camera: Pose, lens: Lens, lamps: Mapping[str, Lamp], threads: int = 1
) -> dict[str, np.ndarray]:
    """(h, w) uint16 ids of a view by the lamp that throws the shadows, and without any under `NO_LAMP`.

    BACKGROUND, GROUND, RELIEF_SHADOW (ground that the relief or a wall hides from the lamp), ROCK_IDS + k for rock k,
    SHADOW_IDS + k for ground that rock k hides from the lamp.
    """
    _ = surfaces.all, surfaces.planes, surfaces.rocks, surfaces.rest  # built before threads would race for it
    pictures = {name: np.zeros((lens.height, lens.width), np.uint16) for name in (NO_LAMP, *lamps)}

    def work(rows: slice) -> None:
        hits = cast_strip(surfaces, sandbox_from_camera, lens, rows, smooth=False)
        ids = surfaces.id_of_face[hits.face]
        pictures[NO_LAMP][rows].reshape(-1)[hits.pixel] = ids
        for name, lamp in lamps.items():
            pictures[name][rows].reshape(-1)[hits.pixel] = ground_shadows(surfaces, hits, ids, lamp)

    for_strips(lens.height, threads, work)
    return pictures


def boxes_of(ids: np.ndarray, options: RenderOptions) -> list[tuple[str, int, np.ndarray]]:
    """(kind, rock, box) of every rock and shadow that is large enough in a picture of ids (h, w), rocks first."""
    found = []
    for number, window in enumerate(ndimage.find_objects(ids.astype(np.int32)), 1):
        if window is None or number < ROCK_IDS:
            continue
        kind, rock = (ROCK, number - ROCK_IDS) if number < SHADOW_IDS else (SHADOW, number - SHADOW_IDS)
        least = options.min_rock_px if kind == ROCK else options.min_shadow_px
        box = box_of_parts(ids[window] == number, least, options.min_part_px)
        if box is not None:
            corner = [window[1].start, window[0].start]
            found.append((kind, rock, box + np.tile(corner, 2)))
    return found


def box_of_parts(mask: np.ndarray, least_px: int, least_part_px: int) -> np.ndarray | None:
    """(4,) box around the connected parts of at least `least_part_px`; None where they have fewer than `least_px`."""
    parts, _ = ndimage.label(mask, _TOUCHING)
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    large = sizes >= least_part_px
    return of_mask(large[parts]) if sizes[large].sum() >= least_px else None


def label_twins(
    *,
    terrain: int,
    keys: Sequence[PhotoKey],
    cameras: Path,
    meshes: Path,
    boxes: Path,
    instances: Path,
    table: Path,
    options: RenderOptions,
    threads: int,
) -> None:
    """Write the automatic labels of a terrain's twins: the same for all models and for all exposures of a photo set.

    Parameters
    ----------
    cameras, meshes : Path
        Folders with the terrain's `PosX.json` and meshes; positions without a pose are a warning and a gap.
    boxes : Path
        Folder for `KEY.txt`; empty where no lamp is on, for nothing is to be seen there.
    instances : Path
        Folder for `TT_P_light_az_C.png`, the ids of a photo set.
    table : Path
        Parquet file of the label rows, source `rendered`.

    Raises
    ------
    FormatError
        A mesh or pose is missing or broken.
    """
    rigs = read_all_placed(cameras)
    views = views_of(keys, rigs, cameras)
    surfaces = surfaces_of(read_terrain(meshes, terrain), options)
    rows: list[dict[str, object]] = []
    for position, camera in track(sorted(views), f"labels of terrain {terrain:02d}"):
        view_keys = views[position, camera]
        pictures = _view_ids(surfaces, rigs, position, camera, view_keys, threads)
        found = {name: boxes_of(picture, options) for name, picture in pictures.items()}
        written = set()
        for key in view_keys:
            lamps = lit_by(key)
            labels = found[lamps[0]] if lamps else []
            yolo.write_boxes(
                boxes / f"{key}.txt", np.array([BOX_CLASSES.index(kind) for kind, _, _ in labels], int),
                np.array([box for _, _, box in labels], float),
            )  # fmt: skip
            rows += [label_row(key, *label) for label in labels]
            if key.photo_set not in written:
                written.add(key.photo_set)
                name = str(key).rsplit("_", 1)[0]
                png.write(instances / f"{name}.png", pictures[lamps[0] if lamps else NO_LAMP])
    tables.write_parquet(table, tables.label_table(rows))


def label_row(key: PhotoKey, kind: str, rock: int, box: np.ndarray) -> dict[str, object]:
    corners = dict(zip(("x0", "y0", "x1", "y1"), box.tolist(), strict=True))
    return {**tables.key_columns(key), "kind": kind, "rock": rock, "source": "rendered", "confidence": 1.0, **corners}


def _view_ids(
    surfaces: Surfaces,
    rigs: Mapping[str, PlacedRig],
    position: str,
    camera: str,
    keys: Sequence[PhotoKey],
    threads: int,
) -> dict[str, np.ndarray]:
    throwing = {lit_by(key)[0] for key in keys if lit_by(key)}
    rig = rigs[position]
    lamps = {name: lamp for name, lamp in lamps_of(rigs, position).items() if name in throwing}
    return render_ids(surfaces, rig.sandbox_from(camera), rig.rig.lens(camera), lamps, threads)
