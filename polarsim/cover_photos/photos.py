"""The published cover photos as a small real test: what each of them shows, without strokes, with people's boxes."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log2
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
from polarsim.photo import BOX_CLASSES, HEIGHT, ROCK, SHADOW, USUAL_EXPOSURE_MS, WIDTH, PhotoKey
from polarsim.scenes.strokes import drawn_boxes, erase_strokes, find_strokes

SOURCE = "annotated"  # of labels that people made
PAIRING_COLUMNS = (
    "cover", "key", "shown", "named_by", "drawn", "labels", "matched", "drawn_iou", "shadow_contrast",
)  # fmt: skip
BY_CONFIGURATION, BY_SHADOWS, BY_BOXES = "configuration", "shadows", "boxes"
_SAME_FORM = 0.01  # relative error of the sides' ratio up to which a picture shows a whole photo
_LEAST_WIDTH = 256  # px of a picture that is still looked at
_LEAST_PX = 20  # of a shadow and of what is around it
log = logging.getLogger("polarsim")


@dataclass(frozen=True)
class Cover:
    """A cover photo as large as a photo: its grey values (h, w) uint8 without strokes, and the boxes (n, 4) drawn."""

    photo: np.ndarray
    drawn: np.ndarray


def read_covers(
    *,
    root: Path,
    terrains: Sequence[int],
    keys: Sequence[str],
    pictures: Path,
    labels: Path,
    pairing: Path,
) -> None:
    """Write every cover photo without its strokes as `KEY.png` (8 bits, a photo's size), and the labels of their keys.

    A cover photo says its terrain and position. Camera and azimuth are those of the labelled exposure bracket whose
    shadows it shows: inside their boxes the photo is darker than around them. A cover photo that cannot be read, or
    that no label fits, is left out with a warning.

    Parameters
    ----------
    root : Path
        Folder of the published release.
    keys : sequence of str
        Photo keys that are known, whatever the shadows say.
    pairing : Path
        CSV to write: a row a cover photo and exposure bracket, with all that tells which of them it shows.

    Raises
    ------
    DetectError
        Not one cover photo can be used, or a key names none.
    """
    named = {key.station: key for key in map(PhotoKey.parse, keys)}
    rows: list[tuple[object, ...]] = []
    found: dict[PhotoKey, np.ndarray] = {}
    annotated: list[dict[str, object]] = []
    for terrain in terrains:
        files = release.label_files(root, terrain)
        for position, path in release.cover_photos(root, terrain).items():
            key = named.pop((terrain, position), None)
            try:
                cover = read_cover(path)
                paired = pair_cover(cover, _brackets(files, position, key), key)
            except PolarsimError as error:
                log.warning("%s is left out: %s", path.name, error)
                continue
            rows += [(path.name, *row) for row in paired.itertuples(index=False)]
            key = PhotoKey.parse(str(paired.loc[paired["shown"], "key"].item()))
            found[key] = cover.photo
            annotated += label_rows(key, files[key])
    if named:
        raise DetectError(f"no cover photo of key {next(iter(named.values()))}", path=root)
    if not found:
        raise DetectError(f"no cover photo of terrains {', '.join(map(str, terrains))} can be used", path=root)
    with writing_folder(pictures) as folder:
        for key, photo in found.items():
            png.write(folder / f"{key}.png", photo)
    tables.write_parquet(labels, tables.label_table(annotated))
    table = pd.DataFrame(rows, columns=list(PAIRING_COLUMNS))
    tables.write_csv(pairing, table.round({"drawn_iou": 3, "shadow_contrast": 3}))


def read_cover(path: Path) -> Cover:
    """A cover photo of any size and depth, grey or in colour, scaled to a photo's size.

    Raises
    ------
    DetectError
        No picture of a whole photo.
    FormatError
        No picture.
    """
    picture = png.read(path)
    height, width = picture.shape[:2]
    if width < _LEAST_WIDTH or abs(width * HEIGHT / (height * WIDTH) - 1) > _SAME_FORM:
        raise DetectError(
            f"{width} x {height} pixels, expected a whole photo of {WIDTH} x {HEIGHT} or another size of that form"
        )
    picture = in_eight_bits(picture)
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=-1)
    picture = np.ascontiguousarray(picture[..., :3])
    drawn = drawn_boxes(find_strokes(picture)) * (WIDTH / width)
    return Cover(resize(erase_strokes(picture), (WIDTH, HEIGHT)), drawn)


def in_eight_bits(picture: np.ndarray) -> np.ndarray:
    """uint8 of a picture with 8, 12 in 16, or 16 bits."""
    return (picture >> (bits_in_use(picture, picture.dtype) - 8)).astype(np.uint8)


def pair_cover(cover: Cover, brackets: Mapping[PhotoKey, Path], known: PhotoKey | None) -> pd.DataFrame:
    """A row of `PAIRING_COLUMNS` without the first for each exposure bracket, by its key; one of them is `shown`.

    Parameters
    ----------
    brackets : mapping of PhotoKey to Path
        Label file of one photo of each bracket of the cover photo's position.
    known : PhotoKey or None
        The key that the cover photo is known to have.

    Raises
    ------
    DetectError
        No labels fit.
    """
    rows = []
    for key, path in sorted(brackets.items()):
        classes, corners = yolo.read_boxes(path)
        rocks, shadows = (corners[classes == BOX_CLASSES.index(kind)] for kind in (ROCK, SHADOW))
        overlap = boxes.iou(cover.drawn, rocks) if len(cover.drawn) and len(rocks) else np.zeros((0, 0))
        total = overlap[boxes.match_sum(overlap)] if overlap.size else np.zeros(0)
        most = max(len(cover.drawn), len(rocks), 1)
        rows.append(
            (str(key), False, "", len(cover.drawn), len(rocks), int((total > 0).sum()), total.sum() / most,
             shadow_contrast(cover.photo, shadows, rocks))
        )  # fmt: skip
    table = pd.DataFrame(rows, columns=list(PAIRING_COLUMNS[1:]))
    if known is not None:
        number, by = int(np.flatnonzero(table["key"] == str(known))[0]), BY_CONFIGURATION
    elif (table["shadow_contrast"] > 0).any():
        number, by = int(table["shadow_contrast"].argmax()), BY_SHADOWS
    elif (table["drawn_iou"] > 0).any():
        number, by = int(table["drawn_iou"].argmax()), BY_BOXES
    else:
        raise DetectError(f"none of {len(table)} labelled exposure brackets has its shadows or boxes")
    return table.assign(shown=np.arange(len(table)) == number, named_by=by)


def shadow_contrast(photo: np.ndarray, shadows: np.ndarray, rocks: np.ndarray) -> float:
    """How much darker a photo (h, w) is inside boxes of shadows (n, 4) than around them, mean over the boxes.

    Each is the difference of the mean grey values over their sum, from -1 to 1; boxes of rocks (m, 4) count for
    neither. NaN without a shadow.
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
        if min(len(dark), len(lit)) >= _LEAST_PX:
            values.append((lit.mean() - dark.mean()) / (lit.mean() + dark.mean() + 1))
    return float(np.mean(values)) if values else float("nan")


def label_rows(key: PhotoKey, path: Path) -> list[dict[str, object]]:
    """Rows of the label table of the boxes that people drew."""
    classes, corners = yolo.read_boxes(path)
    return [
        tables.key_columns(key)
        | {"kind": BOX_CLASSES[kind], "rock": -1, "source": SOURCE, "confidence": 1.0}
        | dict(zip(BOX_COLUMNS, box.tolist(), strict=True))
        for kind, box in zip(classes, corners, strict=True)
    ]


def _brackets(files: Mapping[PhotoKey, Path], position: str, known: PhotoKey | None) -> dict[PhotoKey, Path]:
    """Return a label file of each bracket without the rover light: of the usual exposure, or of the nearest one."""
    if known is not None and known not in files:
        raise DetectError(f"no label file {known}.txt")
    own = [key for key in files if key.position == position and key.light == "off" and key.azimuth != "no"]
    nearest: dict[object, PhotoKey] = {}
    for key in sorted(own, key=lambda key: (abs(log2(key.exposure_ms / USUAL_EXPOSURE_MS)), key)):
        nearest.setdefault(key.bracket, key)
    if known is not None:
        nearest[known.bracket] = known
    if not nearest:
        raise DetectError(f"position {position} has no labels")
    return {key: files[key] for key in nearest.values()}


def _window(box: np.ndarray) -> tuple[slice, slice]:
    left, top, right, bottom = (max(0, round(edge)) for edge in box.tolist())
    return slice(top, bottom), slice(left, right)
