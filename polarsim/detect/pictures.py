"""A domain's pictures and boxes as YOLO wants them, converted once: all data sets share these."""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect import tone
from polarsim.detect.frame import read_picture
from polarsim.detect.grouping import Labels, labels_by_photo
from polarsim.detect.options import VIEWS, PicturesOptions
from polarsim.errors import DetectError, PolarsimError, about, within
from polarsim.formats import png, tables, yolo
from polarsim.formats.files import read_json, write_json, writing_folder
from polarsim.geometry import boxes
from polarsim.photo import BOX_CLASSES, HEIGHT, NO_ROCK, ROCK, SHADOW, WIDTH, PhotoKey
from polarsim.progress import track
from polarsim.run_files import class_masks, instances
from polarsim.schemas.detect import PICTURES

USED, MISSING, CORRUPT = STATES = ("used", "missing", "corrupt")
STATE_COLUMNS = PICTURES.columns
VIEW_COLUMNS = ("name", "scene", "camera")
log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Source:
    """A picture to convert."""

    key: str
    path: Path | None  # none: it is known to be missing
    camera: str  # pictures of one camera are alike
    terrains: tuple[int, ...]  # that are to be seen
    size: tuple[int, int] | None = (WIDTH, HEIGHT)  # px; none: any


def convert_domain(
    *,
    domain: str,
    pictures: Path,
    labels: Sequence[Path],
    keys: Sequence[PhotoKey],
    folder: Path,
    options: PicturesOptions,
    masks: Sequence[Path] = (),
) -> None:
    """`convert_views` for the domain of novel views, which have labels of their own, else `convert_photos`."""
    if domain == VIEWS:
        convert_views(views=pictures, folder=folder, options=options)
    else:
        convert_photos(
            domain=domain, pictures=pictures, labels=labels[0], keys=keys, folder=folder, options=options, masks=masks
        )


def convert_photos(
    *,
    domain: str,
    pictures: Path,
    labels: Path,
    keys: Sequence[PhotoKey],
    folder: Path,
    options: PicturesOptions,
    masks: Sequence[Path] = (),
) -> None:
    """Write a domain's photos or twins as 8-bit pictures with YOLO labels.

    Parameters
    ----------
    domain : str
        Name of the domain, noted in `domain.json`.
    pictures : Path
        Either `photos.parquet` (columns key and path) or the folder of a reflectance model's twins.
    labels : Path
        Label table of the domain, `LABEL_COLUMNS`.
    folder : Path
        Folder to write: `images/KEY.png`, `labels/KEY.txt`, `domain.json`, and `pictures.csv` with the state of every
        picture: used, missing or corrupt. A corrupt picture or label is a warning.
    masks : sequence of Path
        Folders `TerrainTT` of grey maps by photo or instance maps by exposure bracket. With them every picture has
        `masks/KEY.png` too, see `formats.class_masks`.

    Raises
    ------
    PolarsimError
        A broken table, or a full disk.
    """
    paths = picture_paths(pictures, list(keys))
    if missing := len(keys) - len(paths):
        log.warning("%s: %d of %d pictures are missing, left out", pictures, missing, len(keys))
    sources = [Source(str(key), paths.get(key), f"{key.position} {key.camera}", (key.terrain,)) for key in sorted(keys)]
    table = _read_labels(labels)
    names = [source.key for source in sources]
    boxes_of = dict(zip(names, labels_by_photo(table, names), strict=True))
    things_of = _things_by_photo(table) if masks else {}

    def labelled(source: Source, size: tuple[int, int]) -> Labels:
        with about(labels), within(source.key):
            return _inside(*boxes_of[source.key], size)

    def masked(source: Source) -> np.ndarray:
        return _read_mask(masks, PhotoKey.parse(source.key), things_of.get(source.key, ()))

    _convert(domain, sources, labelled, folder, options, masked if masks else None)


def convert_views(*, views: Path, folder: Path, options: PicturesOptions) -> None:
    """As `convert_photos`, for what `polarsim render VIEWS.yaml` wrote: 12-bit pictures with labels beside them.

    Raises
    ------
    PolarsimError
        No such folder, or a broken index in it.
    """
    index = tables.read_csv(views / "index.csv", VIEW_COLUMNS)
    terrains_of: dict[str, tuple[int, ...]] = {}
    sources = []
    for row in index.sort_values("name").to_dict("records"):
        name, scene = str(row["name"]), str(row["scene"])
        if scene not in terrains_of:
            terrains_of[scene] = _terrains_of_view(views / "sidecars" / f"{name}.json")
        path = views / "images" / f"{name}.png"
        found = path if path.is_file() else None
        camera = f"{scene} {row['camera']}"
        sources.append(Source(name, found, camera, terrains_of[scene], size=None))

    def labelled(source: Source, size: tuple[int, int]) -> Labels:
        return _inside(*yolo.read_boxes(views / "labels" / f"{source.key}.txt", size), size)

    _convert(VIEWS, sources, labelled, folder, options)


def _terrains_of_view(sidecar: Path) -> tuple[int, ...]:
    try:
        return tuple(sorted({int(terrain["terrain"]) for terrain in read_json(sidecar)["terrains"]}))
    except (KeyError, TypeError, ValueError) as error:
        raise DetectError("does not say which terrains are to be seen", path=sidecar) from error


def picture_paths(pictures: Path, keys: list[PhotoKey]) -> dict[PhotoKey, Path]:
    """File of each photo that has one: from a photo table, or from a folder of twins `TerrainTT/KEY.png`."""
    if pictures.is_dir():
        found = {key: pictures / f"Terrain{key.terrain:02d}" / f"{key}.png" for key in keys}
    else:
        table = tables.read_parquet(pictures, ("key", "path"))
        listed = dict(zip(table["key"].astype(str), table["path"].astype(str), strict=True))
        found = {key: Path(listed[str(key)]) for key in keys if str(key) in listed}
    return {key: path for key, path in found.items() if path.is_file()}


def read_states(folder: Path) -> pd.DataFrame:
    """The row of every picture, `STATE_COLUMNS`, all of them texts; terrains are parted by spaces."""
    table = tables.read_csv(folder / "pictures.csv", STATE_COLUMNS)
    return table[list(STATE_COLUMNS)].astype(str)


def _convert(
    domain: str,
    sources: Sequence[Source],
    labelled: Callable[[Source, tuple[int, int]], Labels],
    folder: Path,
    options: PicturesOptions,
    masked: Callable[[Source], np.ndarray] | None = None,
) -> None:
    rows = []
    with writing_folder(folder) as made:
        for name in ("images", "labels", *(["masks"] if masked else [])):
            (made / name).mkdir()
        for source in track(sources, f"{domain} pictures"):
            state = _convert_one(source, labelled, masked, made, options)
            rows.append((source.key, state, source.camera, " ".join(map(str, source.terrains))))
        table = pd.DataFrame(rows, columns=list(STATE_COLUMNS))
        counts = {state: int((table["state"] == state).sum()) for state in STATES}
        tables.write_csv(made / "pictures.csv", table)
        write_json(made / "domain.json", {"domain": domain, "pictures": counts})
    log.info("%s: %s", domain, ", ".join(f"{count} {state}" for state, count in counts.items()))


def _convert_one(
    source: Source,
    labelled: Callable[[Source, tuple[int, int]], Labels],
    masked: Callable[[Source], np.ndarray] | None,
    made: Path,
    options: PicturesOptions,
) -> str:
    """Write one picture and its labels, unless there is a reason against; its state."""
    if source.path is None:
        return MISSING
    try:
        picture = _read(source.path, source.size)
        size = picture.shape[1], picture.shape[0]
        classes, corners = labelled(source, size)
        mask = masked(source) if masked else None
    except PolarsimError as error:
        log.warning("left out: %s", error)
        return CORRUPT
    small = tone.shrink(picture, min(options.longer_side, max(picture.shape)))
    png.write(made / "images" / f"{source.key}.png", tone.to_8_bits(small))
    yolo.write_boxes(made / "labels" / f"{source.key}.txt", classes, corners, size)
    if mask is not None:
        class_masks.write(
            made / "masks" / f"{source.key}.png", class_masks.resized(mask, (small.shape[1], small.shape[0]))
        )
    return USED


def _read(path: Path, size: tuple[int, int] | None) -> np.ndarray:
    """(h, w) uint16 with 12-bit values."""
    try:
        header = png.parse_header(path.read_bytes())  # OpenCV reads a cut picture without a word
    except OSError as error:
        raise DetectError(f"cannot be read, {error.strerror or error}", path=path) from error
    except PolarsimError as error:
        raise DetectError(error.reason, path=path) from error
    return png.read_photo(path, size or (header.width, header.height))


def _read_mask(folders: Sequence[Path], key: PhotoKey, labelled: Collection[int]) -> np.ndarray:
    """The class mask (h, w) of a photo or twin.

    Raises
    ------
    PolarsimError
        A broken map, or none.
    """
    name = f"Terrain{key.terrain:02d}"
    folder = next((folder for folder in folders if folder.name == name), None)
    if folder is None:
        raise DetectError(f"no folder {name} of masks for {key}")
    grey_map, instance_map = folder / f"{key}.png", folder / f"{str(key).rpartition('_')[0]}.png"
    if grey_map.is_file():
        return class_masks.of_grey_map(read_picture(grey_map))
    return class_masks.of_ids(instances.read(instance_map), labelled)


def _read_labels(path: Path) -> pd.DataFrame:
    table = tables.read_parquet(path, tables.LABEL_COLUMNS)
    unknown = sorted(set(table["kind"].astype(str)) - set(BOX_CLASSES))
    if unknown:
        raise DetectError(f"kind {unknown[0]!r}, expected one of {', '.join(BOX_CLASSES)}", path=path)
    return table


def _things_by_photo(table: pd.DataFrame) -> dict[str, set[int]]:
    """Ids in instance maps of the labelled rocks and shadows of every photo."""
    numbered = table[table["rock"] != NO_ROCK]
    ids = numbered["rock"] + numbered["kind"].map({ROCK: instances.ROCK_IDS, SHADOW: instances.SHADOW_IDS})
    return {str(key): set(own.tolist()) for key, own in ids.groupby(numbered["key"])}


def _inside(classes: np.ndarray, corners: np.ndarray, size: tuple[int, int]) -> Labels:
    """What of the boxes lies in the picture.

    Raises
    ------
    DetectError
        A box without corners, or with its right one on the left.
    """
    if not np.isfinite(corners).all() or (corners[:, 2:] < corners[:, :2]).any():
        raise DetectError("a label that is no box")
    clipped = boxes.clip(corners, *size)
    seen = boxes.area(clipped) > 0
    return classes[seen], clipped[seen]
