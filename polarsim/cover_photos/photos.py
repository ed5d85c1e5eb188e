"""Published cover photos: removal of drawn strokes, assignment of photo keys, and human labels."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect.grouping import BOX_COLUMNS
from polarsim.detect.tone import bits_in_use
from polarsim.errors import DetectError, PolarsimError
from polarsim.formats import png, release, tables, yolo
from polarsim.formats.files import writing_folder
from polarsim.geometry import boxes
from polarsim.geometry.images import resize
from polarsim.photo import BOX_CLASSES, ROCK, SHADOW, PhotoKey, Terrain
from polarsim.scenes.strokes import erase_strokes, find_drawn_boxes, find_strokes

SOURCE = "annotated"  # source of human labels
PAIRING_COLUMNS = (
    "cover", "key", "shown", "named_by", "drawn", "labels", "matched", "drawn_iou", "shadow_contrast",
)  # fmt: skip
_MAX_ASPECT_ERROR = 0.01  # maximum relative error of the aspect ratio of an uncropped photo
_MIN_WIDTH = 256  # minimum width of an image, px
_MIN_PX = 20  # minimum number of pixels of a shadow and of its surroundings
log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Cover:
    """Cover photo in the size of a photo: grey values (h, w) uint8 without strokes, strokes, and drawn boxes (n, 4)."""

    photo: np.ndarray
    drawn: np.ndarray
    strokes: np.ndarray  # (h, w) bool


def read_covers(
    *,
    root: Path,
    terrains: Sequence[Terrain],
    keys: Sequence[str],
    size: tuple[int, int],
    usual_exposure_ms: int,
    pictures: Path,
    labels: Path,
    pairing: Path,
    drawn: Path | None = None,
) -> None:
    """Write every cover photo without strokes as `KEY.png` (8 bits, size of a photo), and the labels of the keys.

    Terrain and position of a cover photo are known from the file name. Camera and azimuth follow from the labelled
    exposure bracket with the best matching shadows: the photo is darker inside shadow boxes than around them.
    Unreadable cover photos and cover photos without matching labels are skipped with a warning.

    Parameters
    ----------
    keys : sequence of str
        Known photo keys, which override the match of shadows.
    size : (int, int)
        Width and height of the photos, px.
    usual_exposure_ms : int
        Exposure of the label files of brackets, if there is a choice, ms.
    pairing : Path
        CSV to write: a row per cover photo and exposure bracket, with the measures of the match.
    drawn : Path, optional
        Folder of masks `KEY.png` to write, 255 at strokes and 0 elsewhere.
    """
    named = {key.station: key for key in map(PhotoKey.parse, keys)}
    rows: list[tuple[object, ...]] = []
    photos: dict[PhotoKey, Cover] = {}
    annotated: list[dict[str, object]] = []
    for terrain in terrains:
        files = release.label_files(root, terrain)
        for position, path in release.cover_photos(root, terrain).items():
            key = named.pop((terrain, position), None)
            try:
                cover = read_cover(path, size)
                paired = pair_cover(cover, _brackets(files, position, key, usual_exposure_ms), key)
            except PolarsimError as error:
                log.warning("%s: skipped: %s", path.name, error)
                continue
            rows += [(path.name, *row) for row in paired.itertuples(index=False)]
            key = PhotoKey.parse(str(paired.loc[paired["shown"], "key"].item()))
            photos[key] = cover
            annotated += annotation_rows(key, files[key], size)
    if named:
        raise DetectError(f"no cover photo for key {next(iter(named.values()))}", path=root)
    if not photos:
        raise DetectError(f"no usable cover photo of terrains {', '.join(map(str, terrains))}", path=root)
    with writing_folder(pictures) as folder:
        for key, cover in photos.items():
            png.write_png(folder / f"{key}.png", cover.photo)
    if drawn is not None:
        with writing_folder(drawn) as folder:
            for key, cover in photos.items():
                png.write_png(folder / f"{key}.png", np.where(cover.strokes, 255, 0).astype(np.uint8))
    tables.write_parquet(labels, tables.label_table(annotated))
    table = pd.DataFrame(rows, columns=list(PAIRING_COLUMNS))
    tables.write_csv(pairing, table.round({"drawn_iou": 3, "shadow_contrast": 3}))


def read_cover(path: Path, size: tuple[int, int]) -> Cover:
    """Read a cover photo of any size and bit depth, grey or colour, and resize it to the size of a photo, px."""
    picture = png.read_png(path)
    height, width = picture.shape[:2]
    if width < _MIN_WIDTH or abs(width * size[1] / (height * size[0]) - 1) > _MAX_ASPECT_ERROR:
        raise DetectError(
            f"{width} x {height} px, expected {size[0]} x {size[1]} or the same aspect ratio, "
            f"width {_MIN_WIDTH} or more"
        )
    picture = in_eight_bits(picture)
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=-1)
    picture = np.ascontiguousarray(picture[..., :3])
    strokes = find_strokes(picture)
    covered = resize(np.where(strokes, 255, 0).astype(np.uint8), size) > 0
    return Cover(resize(erase_strokes(picture), size), find_drawn_boxes(strokes) * (size[0] / width), covered)


def in_eight_bits(picture: np.ndarray) -> np.ndarray:
    """Convert an image with 8, 12 (stored as 16) or 16 bits to uint8."""
    return (picture >> (bits_in_use(picture, picture.dtype) - 8)).astype(np.uint8)


def pair_cover(cover: Cover, brackets: Mapping[PhotoKey, Path], known: PhotoKey | None) -> pd.DataFrame:
    """Match a cover photo with exposure brackets: a row of `PAIRING_COLUMNS[1:]` per bracket; one row is `shown`.

    `brackets` are the label files of one photo of each bracket of the position, `known` is the key if it is known.
    """
    rows = []
    for key, path in sorted(brackets.items()):
        classes, corners = yolo.read_boxes(path, cover.photo.shape[::-1])
        rocks, shadows = (corners[classes == BOX_CLASSES.index(kind)] for kind in (ROCK, SHADOW))
        overlap = boxes.iou(cover.drawn, rocks) if len(cover.drawn) and len(rocks) else np.zeros((0, 0))
        total = overlap[boxes.match_by_summed_iou(overlap)] if overlap.size else np.zeros(0)
        count = max(len(cover.drawn), len(rocks), 1)
        rows.append(
            (str(key), False, "", len(cover.drawn), len(rocks), int((total > 0).sum()), total.sum() / count,
             shadow_contrast(cover.photo, shadows, rocks))
        )  # fmt: skip
    table = pd.DataFrame(rows, columns=list(PAIRING_COLUMNS[1:]))
    if known is not None:
        number, by = int(np.flatnonzero(table["key"] == str(known))[0]), "configuration"
    elif (table["shadow_contrast"] > 0).any():
        number, by = int(table["shadow_contrast"].argmax()), "shadows"
    elif (table["drawn_iou"] > 0).any():
        number, by = int(table["drawn_iou"].argmax()), "boxes"
    else:
        raise DetectError(f"none of {len(table)} labelled exposure brackets matches its shadows or boxes")
    return table.assign(shown=np.arange(len(table)) == number, named_by=by)


def shadow_contrast(photo: np.ndarray, shadows: np.ndarray, rocks: np.ndarray) -> float:
    """Return the mean contrast of shadow boxes (n, 4) with their surroundings in a photo (h, w).

    The contrast is (outside - inside) / (outside + inside) of mean grey values, from -1 to 1, without pixels in boxes
    of rocks (m, 4). NaN without shadows.
    """
    bare = np.ones(photo.shape, bool)
    for window in map(_window, rocks):
        bare[window] = False
    values = []
    for shadow in shadows:
        half = (shadow[2:] - shadow[:2]) / 2
        around = _window(shadow + np.concatenate([-half, half]))
        inside = np.zeros(photo.shape, bool)
        inside[_window(shadow)] = True
        dark, lit = (photo[around][chosen[around] & bare[around]] for chosen in (inside, ~inside))
        if min(len(dark), len(lit)) >= _MIN_PX:
            values.append((lit.mean() - dark.mean()) / (lit.mean() + dark.mean() + 1))
    return float(np.mean(values)) if values else float("nan")


def annotation_rows(key: PhotoKey, path: Path, size: tuple[int, int]) -> list[dict[str, object]]:
    """Return rows of the label table for the human boxes of a label file of a photo of a size, px."""
    classes, corners = yolo.read_boxes(path, size)
    return [
        tables.key_columns(key)
        | {"kind": BOX_CLASSES[kind], "rock": -1, "source": SOURCE, "confidence": 1.0}
        | dict(zip(BOX_COLUMNS, box.tolist(), strict=True))
        for kind, box in zip(classes, corners, strict=True)
    ]


def _brackets(
    files: Mapping[PhotoKey, Path], position: str, known: PhotoKey | None, usual_exposure_ms: int
) -> dict[PhotoKey, Path]:
    """Return a label file of each bracket without rover light, with the exposure closest to the usual one."""
    if known is not None and known not in files:
        raise DetectError(f"no label file {known}.txt")
    keys = [key for key in files if key.position == position and key.light == "off" and key.has_sun]
    nearest: dict[object, PhotoKey] = {}
    for key in sorted(keys, key=lambda key: (key.stops_from(usual_exposure_ms), key)):
        nearest.setdefault(key.bracket, key)
    if known is not None:
        nearest[known.bracket] = known
    if not nearest:
        raise DetectError(f"position {position} has no labels")
    return {key: files[key] for key in nearest.values()}


def _window(box: np.ndarray) -> tuple[slice, slice]:
    left, top, right, bottom = (max(0, round(edge)) for edge in box.tolist())
    return slice(top, bottom), slice(left, right)
