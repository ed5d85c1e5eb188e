"""Conversion of the images and boxes of a domain to YOLO format, shared by all data sets."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import tone
from polarsim.detect.frame import read_picture
from polarsim.detect.grouping import ClassBoxes, labels_by_photo
from polarsim.detect.options import VIEWS, PicturesOptions
from polarsim.errors import DetectError, PolarsimError, with_part, with_path
from polarsim.formats import png, tables, yolo
from polarsim.formats.files import read_json, write_json, writing_folder
from polarsim.formats.readers import reason_of
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES, NO_ROCK, ROCK, SHADOW, PhotoKey, Terrain, parse_terrain, terrain_text
from polarsim.progress import track
from polarsim.run_files import class_masks, instances
from polarsim.schemas.detect import PICTURES

USED, MISSING, CORRUPT = STATES = ("used", "missing", "corrupt")
STATE_COLUMNS = PICTURES.columns
VIEW_COLUMNS = ("name", "scene", "camera")
log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class ImageSource:
    """Image to convert."""

    key: str
    path: Path | None  # None: missing
    camera: str  # group of correlated images
    terrains: tuple[Terrain, ...]  # visible terrains
    size: tuple[int, int] | None  # expected width and height, px; None: any


def convert_domain(
    *,
    domain: str,
    pictures: Path,
    labels: Sequence[Path],
    keys: Sequence[PhotoKey],
    size: tuple[int, int],
    folder: Path,
    options: PicturesOptions,
    masks: Sequence[Path] = (),
) -> None:
    """Apply `convert_views` to the domain of novel views, `convert_photos` to all other domains."""
    if domain == VIEWS:
        convert_views(views=pictures, folder=folder, options=options)
    else:
        convert_photos(
            domain=domain,
            pictures=pictures,
            labels=labels[0],
            keys=keys,
            size=size,
            folder=folder,
            options=options,
            masks=masks,
        )


def convert_photos(
    *,
    domain: str,
    pictures: Path,
    labels: Path,
    keys: Sequence[PhotoKey],
    size: tuple[int, int],
    folder: Path,
    options: PicturesOptions,
    masks: Sequence[Path] = (),
) -> None:
    """Write the photos or twins of a domain as 8-bit images with YOLO labels.

    Parameters
    ----------
    pictures : Path
        Either `photos.parquet` (columns key and path) or the folder of the twins of a reflectance model.
    labels : Path
        Label table of the domain, `LABEL_COLUMNS`.
    size : (int, int)
        Width and height of the photos, px; images of another size are corrupt.
    folder : Path
        Folder to write: `images/KEY.png`, `labels/KEY.txt`, `domain.json`, and `pictures.csv` with the state of each
        image: used, missing or corrupt. Corrupt images and labels are skipped with a warning.
    masks : sequence of Path
        Folders `TerrainTT` of grey maps by photo or instance maps by exposure bracket. If given, `masks/KEY.png` is
        written for each image, see `class_masks`.
    """
    paths = picture_paths(pictures, list(keys))
    if missing := len(keys) - len(paths):
        log.warning("%s: %d of %d images are missing and skipped", pictures, missing, len(keys))
    sources = [
        ImageSource(str(key), paths.get(key), f"{key.position} {key.camera}", (key.terrain,), size)
        for key in sorted(keys)
    ]
    table = _read_labels(labels)
    names = [source.key for source in sources]
    boxes_of = dict(zip(names, labels_by_photo(table, names), strict=True))
    things_of = _things_by_photo(table) if masks else {}

    def labelled(source: ImageSource, size: tuple[int, int]) -> ClassBoxes:
        with with_path(labels), with_part(source.key):
            return _inside(*boxes_of[source.key], size)

    def masked(source: ImageSource) -> np.ndarray:
        return _read_mask(masks, PhotoKey.parse(source.key), things_of.get(source.key, ()))

    _convert(domain, sources, labelled, folder, options, masked if masks else None)


def convert_views(*, views: Path, folder: Path, options: PicturesOptions) -> None:
    """Convert the output of `polarsim render VIEWS.yaml`, 12-bit images and labels, like `convert_photos`."""
    index = tables.read_csv(views / "index.csv", VIEW_COLUMNS)
    terrains_of: dict[str, tuple[Terrain, ...]] = {}
    sources = []
    for row in index.sort_values("name").to_dict("records"):
        name, scene = str(row["name"]), str(row["scene"])
        if scene not in terrains_of:
            terrains_of[scene] = _terrains_of_view(views / "sidecars" / f"{name}.json")
        path = views / "images" / f"{name}.png"
        existing = path if path.is_file() else None
        camera = f"{scene} {row['camera']}"
        sources.append(ImageSource(name, existing, camera, terrains_of[scene], size=None))

    def labelled(source: ImageSource, size: tuple[int, int]) -> ClassBoxes:
        return _inside(*yolo.read_boxes(views / "labels" / f"{source.key}.txt", size), size)

    _convert(VIEWS, sources, labelled, folder, options)


def _terrains_of_view(sidecar: Path) -> tuple[Terrain, ...]:
    try:
        return tuple(sorted({parse_terrain(str(terrain["terrain"])) for terrain in read_json(sidecar)["terrains"]}))
    except (KeyError, TypeError, ValueError) as error:
        raise DetectError("no list of visible terrains, expected key 'terrains'", path=sidecar) from error


def picture_paths(pictures: Path, keys: list[PhotoKey]) -> dict[PhotoKey, Path]:
    """Return the existing file of each photo, from a photo table or a folder of twins `TerrainTT/KEY.png`."""
    if pictures.is_dir():
        paths = {key: pictures / f"Terrain{terrain_text(key.terrain)}" / f"{key}.png" for key in keys}
    else:
        table = tables.read_parquet(pictures, ("key", "path"))
        listed = dict(zip(table["key"].astype(str), table["path"].astype(str), strict=True))
        paths = {key: Path(listed[str(key)]) for key in keys if str(key) in listed}
    return {key: path for key, path in paths.items() if path.is_file()}


def read_states(folder: Path) -> pd.DataFrame:
    """Read the row of each image, `STATE_COLUMNS`, as text; terrains are separated by spaces."""
    table = tables.read_csv(folder / "pictures.csv", STATE_COLUMNS)
    return table[list(STATE_COLUMNS)].astype(str)


def _convert(
    domain: str,
    sources: Sequence[ImageSource],
    labelled: Callable[[ImageSource, tuple[int, int]], ClassBoxes],
    folder: Path,
    options: PicturesOptions,
    masked: Callable[[ImageSource], np.ndarray] | None = None,
) -> None:
    rows = []
    with writing_folder(folder) as made:
        for name in ("images", "labels", *(["masks"] if masked else [])):
            (made / name).mkdir()
        for source in track(sources, f"{domain} images"):
            state = _convert_one(source, labelled, masked, made, options)
            rows.append((source.key, state, source.camera, " ".join(map(str, source.terrains))))
        table = pd.DataFrame(rows, columns=list(STATE_COLUMNS))
        counts = {state: int((table["state"] == state).sum()) for state in STATES}
        tables.write_csv(made / "pictures.csv", table)
        write_json(made / "domain.json", {"domain": domain, "pictures": counts})
    log.info("%s: %s", domain, ", ".join(f"{count} {state}" for state, count in counts.items()))


def _convert_one(
    source: ImageSource,
    labelled: Callable[[ImageSource, tuple[int, int]], ClassBoxes],
    masked: Callable[[ImageSource], np.ndarray] | None,
    made: Path,
    options: PicturesOptions,
) -> str:
    """Write an image with labels if possible; return the state of the image."""
    if source.path is None:
        return MISSING
    try:
        header = png.parse_header(source.path.read_bytes())  # OpenCV accepts truncated files without an error
        picture = png.read_photo(source.path, source.size or (header.width, header.height))
        size = picture.shape[1], picture.shape[0]
        classes, corners = labelled(source, size)
        mask = masked(source) if masked else None
    except (PolarsimError, OSError) as error:
        reason = error if isinstance(error, PolarsimError) and error.path else f"{source.path}: {reason_of(error)}"
        log.warning("skipped: %s", reason)
        return CORRUPT
    small = tone.shrink(picture, min(options.longer_side, max(picture.shape)))
    png.write_png(made / "images" / f"{source.key}.png", tone.to_8_bits(small))
    yolo.write_boxes(made / "labels" / f"{source.key}.txt", classes, corners, size)
    if mask is not None:
        class_masks.write_class_mask(
            made / "masks" / f"{source.key}.png", class_masks.resized(mask, (small.shape[1], small.shape[0]))
        )
    return USED


def _read_mask(folders: Sequence[Path], key: PhotoKey, labelled: Collection[int]) -> np.ndarray:
    """Read the class mask (h, w) of a photo or twin."""
    name = f"Terrain{terrain_text(key.terrain)}"
    folder = next((folder for folder in folders if folder.name == name), None)
    if folder is None:
        raise DetectError(f"no folder {name} of masks for {key}")
    grey_map, instance_map = folder / f"{key}.png", folder / instances.instance_map_name(key)
    if grey_map.is_file():
        return class_masks.of_grey_map(read_picture(grey_map))
    return class_masks.of_ids(instances.read_instances(instance_map), labelled)


def _read_labels(path: Path) -> pd.DataFrame:
    table = tables.read_parquet(path, tables.LABEL_COLUMNS)
    unknown = sorted(set(table["kind"].astype(str)) - set(BOX_CLASSES))
    if unknown:
        raise DetectError(f"kind {unknown[0]!r}, expected one of {', '.join(BOX_CLASSES)}", path=path)
    return table


def _things_by_photo(table: pd.DataFrame) -> dict[str, set[int]]:
    """Return the instance ids of the labelled rocks and shadows of each photo."""
    numbered = table[table["rock"] != NO_ROCK]
    ids = numbered["rock"] + numbered["kind"].map({ROCK: instances.ROCK_IDS, SHADOW: instances.SHADOW_IDS})
    return {str(key): set(photo_ids.tolist()) for key, photo_ids in ids.groupby(numbered["key"])}


def _inside(classes: np.ndarray, corners: np.ndarray, size: tuple[int, int]) -> ClassBoxes:
    """Clip boxes at the border of the image and drop boxes outside."""
    if not np.isfinite(corners).all() or (corners[:, 2:] < corners[:, :2]).any():
        raise DetectError("invalid box, expected finite x0 <= x1 and y0 <= y1")
    clipped = boxes.clip(corners, *size)
    visible = boxes.area(clipped) > 0
    return classes[visible], clipped[visible]
