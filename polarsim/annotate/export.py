"""A run's labels and pictures as a folder that a labelling tool opens."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import COLOURS
from polarsim.annotate.show import rows_of
from polarsim.errors import ConfigError, LabelError
from polarsim.formats import annotated, coco, cvat, label_studio, png, release, yolo
from polarsim.formats.files import write_json, write_text, writing_folder
from polarsim.formats.run_files import pictures_of
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.formats.tone import to_8bit
from polarsim.geometry.boxes import clip
from polarsim.photo import BOX_CLASSES, TERRAINS, PhotoKey
from polarsim.progress import track

TOOLS = ("labelimg", "cvat", "label-studio")
_COLOURS = {kind: "#{:02x}{:02x}{:02x}".format(*COLOURS[kind]) for kind in BOX_CLASSES}


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
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError("not empty, and an export overwrites nothing: name a new folder", path=folder)
    pictures = _chosen(run, terrains, pattern, domain)
    keys = list(pictures)
    labels = pd.concat([_table(run, terrain) for terrain in sorted({key.terrain for key in keys})])
    with writing_folder(folder) as temporary:
        place = temporary if tool == "labelimg" else temporary / "images"
        for key, path in track(list(pictures.items()), "pictures"):
            png.write(place / f"{key}.png", to_8bit(png.read(path))[..., 0])
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
        "labelimg": f"labelImg {folder} {folder / release.CLASS_LIST}   # then choose the format YOLO",
        "cvat": f"paste {folder / 'labels.json'} as raw labels, upload {folder / 'images'}, "
        f"import {folder / 'annotations/instances_default.json'} as COCO 1.0",
        "label-studio": f"serve local files from {folder.resolve().parent}, paste {folder / 'interface.xml'} as code "
        f"of the labelling interface, import {folder / 'tasks.json'}",
    }[tool]


def _chosen(run: Path, terrains: Sequence[int], pattern: str, domain: str) -> dict[PhotoKey, Path]:
    """Pictures of the photos that the run labelled, in the order of keys."""
    chosen = {}
    for terrain in terrains or TERRAINS:
        labelled = release.key_files(run / "labels" / "boxes" / f"Terrain{terrain:02d}").files
        wanted = [key for key in labelled if fnmatchcase(str(key), pattern)]
        if wanted:
            pictures = pictures_of(run, domain, terrain)
            chosen.update({key: pictures[key] for key in wanted if key in pictures})
    if not chosen:
        raise LabelError(
            f"no labelled {domain} picture of a key like {pattern}; models are in {run / 'renders'}", path=run
        )
    return chosen


def _table(run: Path, terrain: int) -> pd.DataFrame:
    return read_parquet(run / "labels" / "tables" / f"Terrain{terrain:02d}.parquet", LABEL_COLUMNS)


def _write_labelimg(folder: Path, labels: pd.DataFrame, keys: Sequence[PhotoKey]) -> None:
    annotated.write_class_list(folder)
    for key in keys:
        rows = rows_of(labels, key)
        classes = rows["kind"].map(BOX_CLASSES.index).to_numpy(int)
        yolo.write_boxes(folder / f"{key}.txt", classes, rows[["x0", "y0", "x1", "y1"]].to_numpy(float))


def _write_cvat(folder: Path, labels: pd.DataFrame, keys: Sequence[PhotoKey]) -> None:
    """Boxes without outlines: with outlines CVAT makes polygons of them."""
    photos = {key: [_boxed(row) for row in rows_of(labels, key).to_dict("records")] for key in keys}
    coco.write_coco(folder / "annotations" / "instances_default.json", photos)
    write_json(folder / "labels.json", cvat.label_list(_COLOURS))


def _boxed(row: dict[Hashable, Any]) -> coco.Annotation:
    box = clip(np.array([row[edge] for edge in ("x0", "y0", "x1", "y1")], float))
    return coco.Annotation(row["kind"], int(row["rock"]), box, None, row["source"], round(float(row["confidence"]), 4))


def _write_label_studio(folder: Path, labels: pd.DataFrame, keys: Sequence[PhotoKey], pictures: str) -> None:
    write_json(folder / "tasks.json", label_studio.tasks(labels, keys, pictures))
    write_text(folder / "interface.xml", label_studio.interface(_COLOURS))
