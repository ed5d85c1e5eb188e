"""A domain's pictures and boxes as a YOLO data set of 8-bit pictures."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import tone
from polarsim.detect.options import DetectOptions
from polarsim.detect.split import PARTS, read_split
from polarsim.errors import DetectError, about
from polarsim.formats import png, tables, yolo
from polarsim.formats.files import write_json, write_text, writing_folder
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.progress import track

BOX_COLUMNS = ("x0", "y0", "x1", "y1")
PICTURE_COLUMNS = ("key", "part")
log = logging.getLogger("polarsim")


def make_dataset(
    *, domain: str, pictures: Path, labels: Path, split: Path, dataset: Path, options: DetectOptions
) -> None:
    """Write the folder of one domain's data set.

    Parameters
    ----------
    domain : str
        Name of the domain, noted in `dataset.json`.
    pictures : Path
        Either `photos.parquet` (columns key and path) or the folder of a reflectance model's twins.
    labels : Path
        Label table of the domain, `LABEL_COLUMNS`.
    split : Path
        CSV of key and part; a photo without a picture is a warning and a gap.
    dataset : Path
        Folder to write: `images/<part>/KEY.png`, `labels/<part>/KEY.txt`, `data.yaml`, and `pictures.csv`, which lists
        the pictures that are really there.

    Raises
    ------
    PolarsimError
        A broken file, or a part without any picture.
    """
    parts = read_split(split)
    paths = picture_paths(pictures, list(parts))
    if missing := len(parts) - len(paths):
        log.warning("%s: %d of %d pictures of the split are missing, left out", pictures, missing, len(parts))
    boxes_of = _boxes_by_photo(labels)
    rows: list[tuple[str, str]] = []
    with writing_folder(dataset) as folder:
        for part in PARTS:
            (folder / "images" / part).mkdir(parents=True)
            (folder / "labels" / part).mkdir(parents=True)
        for key in track(sorted(paths), f"{domain} pictures"):
            part = parts[key]
            if _write_picture(paths[key], folder / "images" / part / f"{key}.png", options):
                classes, corners = boxes_of.get(str(key), (np.zeros(0, int), np.zeros((0, 4))))
                yolo.write_boxes(folder / "labels" / part / f"{key}.txt", classes, corners)
                rows.append((str(key), part))
        counts = {part: sum(row[1] == part for row in rows) for part in PARTS}
        for part, count in counts.items():
            if not count:
                raise DetectError(f"{dataset}: no {domain} picture in the {part} part")
        log.info("%s: %d train, %d val, %d test pictures", domain, *counts.values())
        tables.write_csv(folder / "pictures.csv", pd.DataFrame(rows, columns=list(PICTURE_COLUMNS)))
        write_text(folder / "data.yaml", _data_yaml())
        write_json(folder / "dataset.json", {"domain": domain, "tone": options.tone, "pictures": counts})


def picture_paths(pictures: Path, keys: list[PhotoKey]) -> dict[PhotoKey, Path]:
    """File of each photo that has one: from a photo table, or from a folder of twins `TerrainTT/KEY.png`."""
    if pictures.is_dir():
        found = {key: pictures / f"Terrain{key.terrain:02d}" / f"{key}.png" for key in keys}
    else:
        table = tables.read_parquet(pictures, ("key", "path"))
        listed = dict(zip(table["key"].astype(str), table["path"].astype(str), strict=True))
        found = {key: Path(listed[str(key)]) for key in keys if str(key) in listed}
    return {key: path for key, path in found.items() if path.is_file()}


def read_pictures(dataset: Path, part: str) -> list[str]:
    """Keys of the pictures that a part of a data set really has, sorted."""
    table = tables.read_csv(dataset / "pictures.csv", PICTURE_COLUMNS)
    return sorted(table.loc[table["part"] == part, "key"].astype(str))


def _boxes_by_photo(labels: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Class numbers (n,) and boxes (n, 4) inside the photo of every labelled photo."""
    table = tables.read_parquet(labels, tables.LABEL_COLUMNS)
    unknown = sorted(set(table["kind"].astype(str)) - set(BOX_CLASSES))
    if unknown:
        raise DetectError(f"{labels}: kind {unknown[0]!r}, expected one of {', '.join(BOX_CLASSES)}")
    found = {}
    for key, rows in table.groupby("key", sort=True):
        corners = boxes.clip(rows[list(BOX_COLUMNS)].to_numpy(float))
        seen = boxes.area(corners) > 0
        classes = np.array([BOX_CLASSES.index(kind) for kind in rows["kind"]])
        found[str(key)] = classes[seen], corners[seen]
    return found


def _write_picture(source: Path, target: Path, options: DetectOptions) -> bool:
    """Convert one picture; False where it is darker than the options allow."""
    with about(source):
        pixels = png.read_photo(source)
    if options.min_mean_dn > 0 and tone.mean_dn(pixels) < options.min_mean_dn:
        return False
    png.write(target, tone.to_8_bits(tone.shrink(pixels, options.imgsz) if options.downsize else pixels, options))
    return True


def _data_yaml() -> str:
    parts = "".join(f"{part}: images/{part}\n" for part in PARTS)
    names = "".join(f"  {number}: {name}\n" for number, name in enumerate(BOX_CLASSES))
    return f"# Paths are relative to this file.\n{parts}names:\n{names}"
