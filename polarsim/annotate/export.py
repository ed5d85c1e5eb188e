"""A run's labels and pictures as a folder that a labelling tool opens: labelImg, CVAT or Label Studio."""

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
from polarsim.formats import coco, png, release, yolo
from polarsim.formats.files import check_new_folder, write_json, write_text, writing_folder
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.geometry.boxes import clip
from polarsim.photo import BOX_CLASSES, HEIGHT, HEX_COLOURS, NO_ROCK, ROCK, SHADOW, WIDTH, PhotoKey
from polarsim.progress import track
from polarsim.run_files.run import Run
from polarsim.tone import to_8bit

TOOLS = ("labelimg", "cvat", "label-studio")
DECIMALS = 6  # of a percent: a hundred-thousandth of a pixel
LOCAL_FILES = "/data/local-files/?d="  # how Label Studio names pictures below its document root
_RECTANGLES, _IMAGE = "label", "image"  # names of the interface's parts


def export(
    *, folder: Path, run: Path, terrains: Sequence[int] = (), pattern: str = "*", domain: str = "photo", tool: str
) -> int:
    """Write the folder; how many pictures it has.

    The labels are those that the run propagated to its photos, also where twins stand in for the photos.

    Parameters
    ----------
    folder
        A new folder, or an empty one.
    terrains
        Their numbers; all of the run's when empty.
    pattern
        Which photo keys, with * and ? as in file names.
    domain
        "photo", or the model of the twins that are shown.
    tool
        One of `TOOLS`.

    Raises
    ------
    ConfigError
        The folder holds something, perhaps labels that a person edited; or no such tool.
    LabelError
        No labelled picture fits.
    FormatError
        A table or picture of the run is broken.
    """
    if tool not in TOOLS:
        raise ConfigError(f"tool {tool!r}, expected {', '.join(TOOLS)}")
    check_new_folder(folder)
    pictures = _chosen(run, terrains, pattern, domain)
    keys = list(pictures)
    labels = pd.concat([_table(run, terrain) for terrain in sorted({key.terrain for key in keys})])
    with writing_folder(folder) as temporary:
        folder_of_pictures = temporary if tool == "labelimg" else temporary / "images"
        for key, path in track(list(pictures.items()), "pictures"):
            png.write(folder_of_pictures / f"{key}.png", to_8bit(png.read(path))[..., 0])
        if tool == "labelimg":
            _write_labelimg(temporary, labels, keys)
        elif tool == "cvat":
            _write_cvat(temporary, labels, keys)
        else:
            _write_label_studio(temporary, labels, keys, f"{quote(folder.resolve().name)}/images")
    return len(pictures)


def opening(folder: Path, tool: str) -> str:
    """How a person opens the folder."""
    return {
        "labelimg": f"labelImg {folder} {folder / yolo.CLASS_FILE}   # then choose the format YOLO",
        "cvat": f"paste {folder / 'labels.json'} as raw labels, upload {folder / 'images'}, "
        f"import {folder / 'annotations/instances_default.json'} as COCO 1.0",
        "label-studio": f"serve local files from {folder.resolve().parent}, paste {folder / 'interface.xml'} as code "
        f"of the labelling interface, import {folder / 'tasks.json'}",
    }[tool]


def _chosen(run: Path, terrains: Sequence[int], pattern: str, domain: str) -> dict[PhotoKey, Path]:
    """Pictures of the photos that the run labelled, in the order of keys."""
    there = [int(folder.name[-2:]) for folder in sorted((run / "labels" / "boxes").glob("Terrain[0-9][0-9]"))]
    if unknown := [str(terrain) for terrain in terrains if terrain not in there]:
        known = ", ".join(map(str, there)) or "none"
        raise LabelError(f"no labels of terrain {', '.join(unknown)}; terrains with labels: {known}", path=run)
    chosen = {}
    for terrain in terrains or there:
        labelled = release.key_files(run / "labels" / "boxes" / f"Terrain{terrain:02d}").files
        wanted = [key for key in labelled if fnmatchcase(str(key), pattern)]
        if wanted:
            pictures = Run(run).pictures_of(domain, terrain)
            chosen.update({key: pictures[key] for key in wanted if key in pictures})
    if not chosen:
        raise LabelError(
            f"no labelled {domain} picture of a key like {pattern}, terrains "
            f"{', '.join(map(str, terrains or there)) or 'none'}; domains of this run: {', '.join(Run(run).domains)}",
            path=run,
        )
    return chosen


def _table(run: Path, terrain: int) -> pd.DataFrame:
    return read_parquet(run / "labels" / "tables" / f"Terrain{terrain:02d}.parquet", LABEL_COLUMNS)


def _write_labelimg(folder: Path, labels: pd.DataFrame, keys: Sequence[PhotoKey]) -> None:
    write_text(folder / yolo.CLASS_FILE, "".join(f"{name}\n" for name in BOX_CLASSES))
    for key in keys:
        rows = rows_of(labels, key)
        classes = rows["kind"].map(BOX_CLASSES.index).to_numpy(int)
        yolo.write_boxes(folder / f"{key}.txt", classes, rows[["x0", "y0", "x1", "y1"]].to_numpy(float))


def _write_cvat(folder: Path, labels: pd.DataFrame, keys: Sequence[PhotoKey]) -> None:
    """Boxes without outlines: with outlines CVAT makes polygons of them."""
    photos = {key: [_boxed(row) for row in rows_of(labels, key).to_dict("records")] for key in keys}
    coco.write_coco(folder / "annotations" / "instances_default.json", photos)
    write_json(folder / "labels.json", cvat_labels())


def _boxed(row: dict[Hashable, Any]) -> coco.Annotation:
    box = clip(np.array([row[edge] for edge in ("x0", "y0", "x1", "y1")], float))
    return coco.Annotation(row["kind"], int(row["rock"]), box, None, row["source"], round(float(row["confidence"]), 4))


def _write_label_studio(folder: Path, labels: pd.DataFrame, keys: Sequence[PhotoKey], pictures: str) -> None:
    write_json(folder / "tasks.json", label_studio_tasks(labels, keys, pictures))
    write_text(folder / "interface.xml", label_studio_interface())


def cvat_labels() -> list[dict[str, Any]]:
    """The labels of a CVAT task: rectangles with the attributes of `coco`.

    Its raw label editor takes them; without them CVAT drops rock ids at import.
    """
    attributes = [
        _attribute("rock", "number", str(NO_ROCK), [str(NO_ROCK), "99999", "1"]),  # lowest, highest, step
        _attribute("confidence", "text", "1", []),
        _attribute("label_source", "text", "", []),
    ]
    return [
        {"name": kind, "color": colour, "type": "rectangle", "attributes": attributes}
        for kind, colour in HEX_COLOURS.items()
    ]


def _attribute(name: str, input_type: str, default: str, values: list[str]) -> dict[str, Any]:
    return {
        "name": name,
        "input_type": input_type,
        "mutable": False,
        "default_value": default,
        "values": values or [default],
    }


def label_studio_interface() -> str:
    """The labelling interface (XML) that shows the tasks of `label_studio_tasks`."""
    labels = "\n".join(f'    <Label value="{kind}" background="{colour}"/>' for kind, colour in HEX_COLOURS.items())
    return (
        f'<View>\n  <Image name="{_IMAGE}" value="${_IMAGE}" zoom="true"/>\n'
        f'  <RectangleLabels name="{_RECTANGLES}" toName="{_IMAGE}" canRotate="false" strokeWidth="2">\n'
        f"{labels}\n  </RectangleLabels>\n</View>\n"
    )


def label_studio_tasks(labels: pd.DataFrame, keys: Sequence[PhotoKey], pictures: str) -> list[dict[str, Any]]:
    """A task a photo: its picture, and its labels as one prediction, shadows tied to their rocks.

    Positions and sizes are percent of the picture's; a prediction becomes an annotation as soon as a person edits it.

    Parameters
    ----------
    labels
        Label rows; those of other photos are passed over. Boxes are cut at the photo's border.
    keys
        The photos, in the order of the tasks, those without labels too.
    pictures
        Folder of the pictures `KEY.png` below Label Studio's document root, as in an address (no bare spaces).
    """
    by_key = dict(tuple(labels.groupby("key", sort=False)))
    none = labels.iloc[:0]
    return [_task(key, by_key.get(str(key), none), f"{LOCAL_FILES}{pictures}/{key}.png") for key in keys]


def _task(key: PhotoKey, rows: pd.DataFrame, picture: str) -> dict[str, Any]:
    boxes = clip(rows[["x0", "y0", "x1", "y1"]].to_numpy(float)) / [WIDTH, HEIGHT, WIDTH, HEIGHT] * 100
    result = [
        _rectangle(f"{key}_{number}", row, box)
        for number, (row, box) in enumerate(zip(rows.to_dict("records"), boxes, strict=True), 1)
    ]
    score = round(float(rows["confidence"].mean()), 4) if len(rows) else 1.0
    prediction = {"model_version": "polarsim", "score": score, "result": [*result, *_relations(key, rows)]}
    return {"data": {_IMAGE: picture, "key": str(key)}, "predictions": [prediction]}


def _rectangle(name: str, row: dict[Any, Any], box: np.ndarray) -> dict[str, Any]:
    x0, y0, x1, y1 = box.tolist()
    kind, rock = str(row["kind"]), int(row["rock"])
    rectangle = {"x": x0, "y": y0, "width": x1 - x0, "height": y1 - y0}
    return {
        "id": name,
        "type": "rectanglelabels",
        "from_name": _RECTANGLES,
        "to_name": _IMAGE,
        "original_width": WIDTH,
        "original_height": HEIGHT,
        "image_rotation": 0,
        "score": round(float(row["confidence"]), 4),
        "value": {k: round(v, DECIMALS) for k, v in rectangle.items()} | {"rotation": 0, "rectanglelabels": [kind]},
        "meta": {"text": [f"rock {rock}"] if rock != NO_ROCK else []},
    }


def _relations(key: PhotoKey, rows: pd.DataFrame) -> list[dict[str, Any]]:
    """From every shadow to the first rock of its number."""
    labelled = list(zip(rows["kind"], rows["rock"], range(1, len(rows) + 1), strict=True))
    rocks = {rock: number for kind, rock, number in reversed(labelled) if kind == ROCK and rock != NO_ROCK}
    return [
        {"type": "relation", "from_id": f"{key}_{number}", "to_id": f"{key}_{rocks[rock]}", "direction": "right"}
        for kind, rock, number in labelled
        if kind == SHADOW and rock in rocks
    ]
