"""Export of the labels and images of a run for an annotation tool: labelImg, CVAT or Label Studio."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pandas as pd

from polarsim.annotate.show import rows_of
from polarsim.errors import ConfigError, LabelError
from polarsim.formats import class_lists, coco, png, release, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.files import check_new_folder, write_json, write_text, writing_folder
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.geometry.boxes import clip
from polarsim.photo import (
    BOX_CLASSES,
    HEX_COLOURS,
    NO_ROCK,
    ROCK,
    SHADOW,
    PhotoKey,
    Terrain,
    sorted_terrains,
    terrain_text,
)
from polarsim.progress import track
from polarsim.run_files.run import Run
from polarsim.site import Site
from polarsim.tone import to_8bit

TOOLS = ("labelimg", "cvat", "label-studio")
DECIMALS = 6  # of percentages: steps of a hundred-thousandth of a pixel
LOCAL_FILES = "/data/local-files/?d="  # prefix of images below Label Studio's document root
_RECTANGLES, _IMAGE = "label", "image"  # names of elements of the labelling interface


def export_photos(
    *, folder: Path, run: Path, terrains: Sequence[Terrain] = (), pattern: str = "*", domain: str = "photo", tool: str
) -> int:
    """Write the folder and return the number of images.

    Labels are the propagated labels of the photos, also for images of twins. `terrains` selects terrains (empty: all),
    `pattern` photo keys with * and ?, `domain` photos ("photo") or the twins of a model.
    """
    if tool not in TOOLS:
        raise ConfigError(f"tool {tool!r}, expected {', '.join(TOOLS)}")
    check_new_folder(folder)
    pictures = _chosen(run, terrains, pattern, domain)
    keys = list(pictures)
    site = Run(run).site
    terrains = sorted_terrains(key.terrain for key in keys)
    tables = [run / f"labels/tables/Terrain{terrain_text(terrain)}.parquet" for terrain in terrains]
    labels = pd.concat([read_parquet(table, LABEL_COLUMNS) for table in tables])
    with writing_folder(folder) as temporary:
        folder_of_pictures = temporary if tool == "labelimg" else temporary / "images"
        for key, path in track(list(pictures.items()), "pictures"):
            png.write_png(folder_of_pictures / f"{key}.png", to_8bit(png.read_png(path))[..., 0])
        if tool == "labelimg":
            _write_labelimg(temporary, labels, keys, site.images.size)
        elif tool == "cvat":
            _write_cvat(temporary, labels, keys, site)
        else:
            below = f"{quote(folder.resolve().name)}/images"
            tasks = label_studio_tasks(labels, keys, below, site.images.size)
            write_json(temporary / "tasks.json", tasks)
            write_text(temporary / "interface.xml", label_studio_interface())
    return len(pictures)


def opening(folder: Path, tool: str) -> str:
    """Return instructions to open the folder."""
    return {
        "labelimg": f"labelImg {folder} {folder / class_lists.CLASS_FILE}   # then choose the format YOLO",
        "cvat": f"paste {folder / 'labels.json'} as raw labels, upload {folder / 'images'}, "
        f"import {folder / 'annotations/instances_default.json'} as COCO 1.0",
        "label-studio": f"serve local files from {folder.resolve().parent}, paste {folder / 'interface.xml'} as code "
        f"of the labelling interface, import {folder / 'tasks.json'}",
    }[tool]


def _chosen(run: Path, terrains: Sequence[Terrain], pattern: str, domain: str) -> dict[PhotoKey, Path]:
    """Return the images of the labelled photos that match, sorted by photo key."""
    labelled = release.RUN_LAYOUT.terrains(run / "labels", PhotoKey.parse)
    if unknown := [str(terrain) for terrain in terrains if terrain not in labelled]:
        known = ", ".join(map(str, labelled)) or "none"
        raise LabelError(f"no labels of terrain {', '.join(unknown)}; terrains with labels: {known}", path=run)
    chosen = {}
    for terrain in terrains or labelled:
        files = release.key_files(run / "labels" / "boxes" / f"Terrain{terrain_text(terrain)}").files
        keys = [key for key in files if fnmatchcase(str(key), pattern)]
        if keys:
            pictures = Run(run).pictures_of(domain, terrain)
            chosen.update({key: pictures[key] for key in keys if key in pictures})
    if not chosen:
        searched = ", ".join(map(str, terrains or labelled)) or "none"
        raise LabelError(
            f"no labelled image matches: domain {domain}, photo keys {pattern}, terrains {searched}; "
            f"domains of this run: {', '.join(Run(run).domains)}",
            path=run,
        )
    return chosen


def _write_labelimg(folder: Path, labels: pd.DataFrame, keys: Sequence[PhotoKey], size: tuple[int, int]) -> None:
    write_text(folder / class_lists.CLASS_FILE, "".join(f"{name}\n" for name in BOX_CLASSES))
    for key in keys:
        rows = rows_of(labels, key)
        classes = rows["kind"].map(BOX_CLASSES.index).to_numpy(int)
        yolo.write_boxes(folder / f"{key}.txt", classes, rows[["x0", "y0", "x1", "y1"]].to_numpy(float), size)


def _write_cvat(folder: Path, labels: pd.DataFrame, keys: Sequence[PhotoKey], site: Site) -> None:
    """Write boxes without masks, because CVAT imports annotations with masks as polygons."""
    size = site.images.size
    photos = {key: [_boxed(row, size) for row in rows_of(labels, key).to_dict("records")] for key in keys}
    coco.write_coco(folder / "annotations" / "instances_default.json", photos, site, size)
    write_json(folder / "labels.json", cvat_labels())


def _boxed(row: dict[Hashable, Any], size: tuple[int, int]) -> Annotation:
    box = clip(np.array([row[edge] for edge in ("x0", "y0", "x1", "y1")], float), *size)
    return Annotation(row["kind"], int(row["rock"]), box, None, row["source"], round(float(row["confidence"]), 4))


def cvat_labels() -> list[dict[str, Any]]:
    """Return the labels of a CVAT task for the raw label editor: rectangles with the attributes of `coco`.

    Without these labels, CVAT drops rock ids at import.
    """
    attributes = [
        {"name": name, "input_type": kind, "mutable": False, "default_value": default, "values": values}
        for name, kind, default, values in (
            ("rock", "number", str(NO_ROCK), [str(NO_ROCK), "99999", "1"]),  # minimum, maximum, step
            ("confidence", "text", "1", ["1"]),
            ("label_source", "text", "", [""]),
        )
    ]
    return [
        {"name": kind, "color": colour, "type": "rectangle", "attributes": attributes}
        for kind, colour in HEX_COLOURS.items()
    ]


def label_studio_interface() -> str:
    """Return the labelling interface (XML) for the tasks of `label_studio_tasks`."""
    labels = "\n".join(f'    <Label value="{kind}" background="{colour}"/>' for kind, colour in HEX_COLOURS.items())
    return (
        f'<View>\n  <Image name="{_IMAGE}" value="${_IMAGE}" zoom="true"/>\n'
        f'  <RectangleLabels name="{_RECTANGLES}" toName="{_IMAGE}" canRotate="false" strokeWidth="2">\n'
        f"{labels}\n  </RectangleLabels>\n</View>\n"
    )


def label_studio_tasks(
    labels: pd.DataFrame, keys: Sequence[PhotoKey], pictures: str, size: tuple[int, int]
) -> list[dict[str, Any]]:
    """Return a task per photo: the image, and the labels as a prediction with relations from shadows to rocks.

    Positions and sizes are percentages of the image size; boxes are clipped to the photo. A prediction becomes an
    annotation when it is edited. `pictures` is the folder of the images `KEY.png` below Label Studio's document root,
    URL-encoded; `size` is the width and height of the photos.
    """
    by_key = dict(tuple(labels.groupby("key", sort=False)))
    none = labels.iloc[:0]
    return [_task(key, by_key.get(str(key), none), f"{LOCAL_FILES}{pictures}/{key}.png", size) for key in keys]


def _task(key: PhotoKey, rows: pd.DataFrame, picture: str, size: tuple[int, int]) -> dict[str, Any]:
    boxes = clip(rows[["x0", "y0", "x1", "y1"]].to_numpy(float), *size) / [*size, *size] * 100
    result = [
        _rectangle(f"{key}_{number}", row, box, size)
        for number, (row, box) in enumerate(zip(rows.to_dict("records"), boxes, strict=True), 1)
    ]
    score = round(float(rows["confidence"].mean()), 4) if len(rows) else 1.0
    prediction = {"model_version": "polarsim", "score": score, "result": [*result, *_relations(key, rows)]}
    return {"data": {_IMAGE: picture, "key": str(key)}, "predictions": [prediction]}


def _rectangle(name: str, row: dict[Any, Any], box: np.ndarray, size: tuple[int, int]) -> dict[str, Any]:
    x0, y0, x1, y1 = box.tolist()
    kind, rock = str(row["kind"]), int(row["rock"])
    rectangle = {"x": x0, "y": y0, "width": x1 - x0, "height": y1 - y0}
    return {
        "id": name,
        "type": "rectanglelabels",
        "from_name": _RECTANGLES,
        "to_name": _IMAGE,
        "original_width": size[0],
        "original_height": size[1],
        "image_rotation": 0,
        "score": round(float(row["confidence"]), 4),
        "value": {k: round(v, DECIMALS) for k, v in rectangle.items()} | {"rotation": 0, "rectanglelabels": [kind]},
        "meta": {"text": [f"rock {rock}"] if rock != NO_ROCK else []},
    }


def _relations(key: PhotoKey, rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the relations from every shadow to the first rock with the same id."""
    labelled = list(zip(rows["kind"], rows["rock"], range(1, len(rows) + 1), strict=True))
    rocks = {rock: number for kind, rock, number in reversed(labelled) if kind == ROCK and rock != NO_ROCK}
    return [
        {"type": "relation", "from_id": f"{key}_{number}", "to_id": f"{key}_{rocks[rock]}", "direction": "right"}
        for kind, rock, number in labelled
        if kind == SHADOW and rock in rocks
    ]
