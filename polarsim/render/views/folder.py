"""Output folder of novel views: files of each image, contact sheet and listings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from polarsim.formats import coco, png, tables, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.files import relative_to, write_json, write_text, writing
from polarsim.geometry.poses import yaw_pitch_roll
from polarsim.photo import BLACK_LEVEL, BOX_CLASSES, COLOURS, ROCK, SHADOW
from polarsim.render.views.options import Views
from polarsim.render.views.plan import NamedScene, PlannedImage
from polarsim.run_files.instances import ROCK_IDS
from polarsim.run_files.picture_sets import AUTO

Tone = Callable[[np.ndarray], np.ndarray]  # 12-bit image (h, w) uint16 to 8-bit image (h, w, 3) uint8
_WIDTH, _MAX_TILE_WIDTH, _GAP = 4000, 480, 2  # px: width of the sheet, maximum tile width, gap between tiles
_EVERY = 5  # every fifth viewpoint is for validation
_MIN_NAMED_WIDTH = 300  # px: tiles narrower than this have no caption
_OF_ONE_TERRAIN = ("terrain", "sources", "noise_seed")  # sidecar keys of images of a terrain that views lack
Entry = tuple[PlannedImage, float, list[Annotation]]  # image, exposure time in ms, labels


class Sheet:
    """Contact sheet. Images can be added in any order."""

    def __init__(self, names: Sequence[str], size: tuple[int, int], tone: Tone) -> None:
        """`size`: width and height of the images, px."""
        self._index = {name: index for index, name in enumerate(names)}
        self._columns = ceil(sqrt(len(names)))
        self._wide = max(1, min(_MAX_TILE_WIDTH, _WIDTH // self._columns - _GAP, size[0]))
        self._high = max(1, round(self._wide * size[1] / size[0]))
        rows = ceil(len(names) / self._columns)
        self._tone = tone
        self._pixels = np.full((rows * (self._high + _GAP), self._columns * (self._wide + _GAP), 3), 255, np.uint8)

    def add(self, name: str, picture: np.ndarray, labels: Sequence[Annotation]) -> None:
        """Draw an image (h, w), 12-bit uint16 or uint8, with label boxes into the tile of the image."""
        import cv2

        size = (self._wide, self._high)
        small = cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        eight = picture.dtype == np.uint8
        tile = (
            np.repeat(np.round(small).astype(np.uint8)[..., None], 3, axis=2)
            if eight
            else self._tone(np.round(np.maximum(small, BLACK_LEVEL)).astype(np.uint16))
        )
        tile = np.ascontiguousarray(tile)
        scale = self._wide / picture.shape[1]
        for label in sorted(labels, key=lambda label: label.kind, reverse=True):  # rocks on top
            x0, y0, x1, y1 = (round(float(edge) * scale) for edge in label.box)
            cv2.rectangle(tile, (x0, y0), (x1 - 1, y1 - 1), COLOURS[label.kind], 1)
        if self._wide >= _MIN_NAMED_WIDTH:
            cv2.putText(
                tile, name, (4, self._high - 6), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (255, 255, 255), 1, cv2.LINE_AA
            )
        row, column = divmod(self._index[name], self._columns)
        top, left = row * (self._high + _GAP), column * (self._wide + _GAP)
        self._pixels[top : top + self._high, left : left + self._wide] = tile

    def write(self, path: str | Path) -> None:
        """Write the sheet as JPEG."""
        import cv2

        done, coded = cv2.imencode(".jpg", self._pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])
        assert done
        with writing(path) as temporary:
            temporary.write_bytes(coded.tobytes())


@dataclass(frozen=True)
class ViewsFolder:
    """Output folder of views."""

    views: Views
    out: Path
    preview: bool  # 8-bit images instead of 12-bit
    tone: Tone
    sheet: Sheet

    def write(self, picture: PlannedImage, grey: np.ndarray, exposure_ms: float, labels: Sequence[Annotation]) -> None:
        """Write an image (h, w) uint16, the boxes and the sidecar."""
        pixels = self.tone(grey)[..., 0] if self.preview else grey
        png.write_png(self.out / f"images/{picture.name}.png", pixels)
        yolo.write_boxes(
            self.out / f"labels/{picture.name}.txt",
            np.array([BOX_CLASSES.index(label.kind) for label in labels], int),
            np.array([label.box for label in labels], float),
            picture.size,
        )
        write_json(self.out / f"sidecars/{picture.name}.json", self._sidecar(picture, exposure_ms))
        self.sheet.add(picture.name, pixels, labels)

    def _sidecar(self, picture: PlannedImage, exposure_ms: float) -> dict[str, Any]:
        scene, views = picture.scene, self.views
        content = scene.sidecar(picture.shot(exposure_ms))
        return {
            **{key: value for key, value in content.items() if key not in _OF_ONE_TERRAIN},
            **picture.columns(),
            "terrains": [{"terrain": scene.terrain, "meshes": scene.digests}],
            "moment_utc": picture.light.moment_utc,
            "exposure": "stated" if picture.exposure_ms else {AUTO: views.auto_exposure.model_dump()},
            "stars": views.stars.model_dump() if views.stars else None,
            "bits": 8 if self.preview else 12,
        }


def write_listing(out: Path, entries: Sequence[Entry], final: Path) -> None:
    """Write index.csv, annotations.json, rocks.csv, and data.yaml with train.txt and val.txt.

    `final`: path of the complete folder, which paths of meshes are relative to.
    """
    tables.write_csv(out / "index.csv", pd.DataFrame([_index_row(*entry) for entry in entries]))
    pictures = [
        (
            {
                "id": picture.number + 1,
                "file_name": f"images/{picture.name}.png",
                "width": picture.size[0],
                "height": picture.size[1],
                **picture.columns(),
                "exposure_ms": exposure_ms,
            },
            labels,
        )
        for picture, exposure_ms, labels in entries
    ]
    coco.write_coco_images(out / "annotations.json", pictures, "Rocks and shadows of novel views, labelled by polarsim")
    scenes = {picture.scene.name: picture.scene for picture, _, _ in entries}
    tables.write_csv(out / "rocks.csv", _rocks(list(scenes.values()), final))
    names = "".join(f"  {number}: {name}\n" for number, name in enumerate(BOX_CLASSES))
    parts = divided([picture for picture, _, _ in entries])
    for part, chosen in parts.items():
        write_text(out / f"{part}.txt", "".join(f"./images/{picture.name}.png\n" for picture in chosen))
    note = "# Paths are relative to this file. Each camera is in one part only, because images of a camera are similar."
    write_text(out / "data.yaml", f"{note}\ntrain: train.txt\nval: val.txt\nnames:\n{names}")


def divided(pictures: Sequence[PlannedImage]) -> dict[str, list[PlannedImage]]:
    """Divide images into training and validation: every fifth viewpoint, at least one, is for validation.

    Both cameras of a pair are the same viewpoint. With only one viewpoint, the lights are divided instead; a single
    image is in both parts.
    """
    viewpoints = list(dict.fromkeys(_viewpoint(picture) for picture in pictures))
    sort = _viewpoint if len(viewpoints) > 1 else _light
    kinds = list(dict.fromkeys(map(sort, pictures)))
    kept = set(kinds[_EVERY - 1 :: _EVERY]) or {kinds[-1]}
    val = [picture for picture in pictures if sort(picture) in kept]
    return {"train": [picture for picture in pictures if sort(picture) not in kept] or val, "val": val}


def _viewpoint(picture: PlannedImage) -> tuple[str, str]:
    return picture.scene.name, picture.camera.name.rstrip("LR")


def _light(picture: PlannedImage) -> str:
    return picture.light.name


def _index_row(picture: PlannedImage, exposure_ms: float, labels: list[Annotation]) -> dict[str, object]:
    pose = picture.camera.world_from_camera
    angles = zip(("yaw_deg", "pitch_deg", "roll_deg"), np.degrees(yaw_pitch_roll(pose)).tolist(), strict=True)
    return {
        "name": picture.name,
        **picture.columns(),
        "exposure_ms": exposure_ms,
        **dict(zip(("x_m", "y_m", "z_m"), pose.translation.tolist(), strict=True)),
        **dict(angles),
        "azimuth_deg": picture.light.azimuth_deg,
        "elevation_deg": picture.light.elevation_deg,
        "moment_utc": picture.light.moment_utc,
        "instances": f"{picture.ground_truth}.png",
        "rocks": sum(label.kind == ROCK for label in labels),
        "shadows": sum(label.kind == SHADOW for label in labels),
    }


def _rocks(scenes: Sequence[NamedScene], out: Path) -> pd.DataFrame:
    """Return a table of the rocks of all scenes with terrain, id in the terrain, and mesh folder relative to `out`."""
    rows = [
        (scene.name, number - ROCK_IDS, scene.terrain, number - ROCK_IDS, relative_to(scene.meshes, out))
        for scene in scenes
        for number in scene.surfaces.ids.tolist()
        if number >= ROCK_IDS
    ]
    return pd.DataFrame(rows, columns=["scene", "rock", "terrain", "terrain_rock", "meshes"])
