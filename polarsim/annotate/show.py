"""Photo or twin with labels, the output of `polarsim show KEY`."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import OverlayStyle, add_legend, draw_labels
from polarsim.errors import ConfigError, FormatError, LabelError
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, read_parquet
from polarsim.formats.yolo import read_polygons
from polarsim.geometry.polygons import paint
from polarsim.photo import BOX_CLASSES, GREY_VALUES, PhotoKey, terrain_text
from polarsim.run_files.instances import read_kind_masks
from polarsim.run_files.run import PHOTO, Run
from polarsim.tone import to_8bit

log = logging.getLogger("polarsim")


def show_of_run(
    *,
    key: PhotoKey,
    run: Run,
    domain: str,
    out: Path,
    scale: float = 1.0,
    kinds: Sequence[str] = BOX_CLASSES,
    masks: bool = False,
) -> None:
    """Draw a photo (domain `photo`) with propagated labels, or a twin of a model with rendered labels.

    In a run without photos, a twin with the same key replaces the photo. Cover photos are not used, because they have
    another light and often another camera.

    `masks` also fills the masks: polygons of the labels for a photo, the instance map for a twin.
    """
    tables = run.folder / ("labels" if domain == PHOTO else "renders") / "tables"
    picture = run.pictures_of(domain, key.terrain).get(key)
    if domain == PHOTO and picture is None:
        picture = next(iter(sorted(run.folder.glob(f"renders/*/Terrain{terrain_text(key.terrain)}/{key}.png"))), None)
        if picture:
            log.warning("%s: no photo %s, using its twin %s", run.folder, key, picture)
    if picture is None or not picture.exists():
        reason = f"no image {key} of the domain {domain}; domains of this run: {', '.join(run.domains)}"
        raise LabelError(reason, path=run.folder)
    write_preview(
        key=key,
        picture=picture,
        labels=read_parquet(tables / f"Terrain{terrain_text(key.terrain)}.parquet", LABEL_COLUMNS),
        out=out,
        scale=scale,
        kinds=kinds,
        masks=_masks_of(run, domain, key) if masks else None,
        title=f"{key}, {picture.parents[1].name} twin" if run.folder / "renders" in picture.parents else "",
        photo_width=run.site.images.width,
    )


def _masks_of(run: Run, domain: str, key: PhotoKey) -> dict[str, np.ndarray]:
    """Return the masks (h, w) bool of rocks and shadows by kind."""
    if domain != PHOTO:
        return read_kind_masks(run.instances(key))
    size = run.site.images.size
    grey = paint(read_polygons(run.polygons(key), size), size[::-1])
    return {kind: grey == GREY_VALUES[kind] for kind in BOX_CLASSES}


def write_preview(
    *,
    key: PhotoKey,
    picture: Path,
    labels: pd.DataFrame,
    out: Path,
    scale: float = 1.0,
    kinds: Sequence[str] = BOX_CLASSES,
    masks: Mapping[str, np.ndarray] | None = None,
    title: str = "",
    photo_width: int | None = None,
) -> None:
    """Write a tone-mapped 8-bit image with boxes, lines from shadows to rocks, ids, low confidences and a legend.

    `picture` is a photo or twin (16 bits), or an 8-bit image of the photo at any size. Labels of other photos are
    ignored. `masks` (h, w) bool of the photo are filled. The default title is the photo key, and the file name of the
    image if it differs from the key. `photo_width` is the width of the photo, px; default: that of the image.
    """
    unknown = [kind for kind in kinds if kind not in BOX_CLASSES]
    if unknown:
        raise ConfigError(f"kind {unknown[0]!r}, expected {' or '.join(BOX_CLASSES)}")
    pixels = to_8bit(png.read_png(picture))
    width = round(scale * pixels.shape[1])
    if not 64 <= width <= 16384:
        raise ConfigError(f"scale {scale:g} makes an image {width} px wide, expected 64 to 16384 px")
    rows = rows_of(labels, key)
    drawn = draw_labels(
        pixels, rows, width, OverlayStyle(kinds, links=True, shadow_ids=True), masks, photo_width=photo_width
    )
    usual = f"{key}, {picture.name}" if picture.stem != str(key) else str(key)
    png.write_png(out, add_legend(drawn, title or usual, rows, kinds))


def rows_of(table: pd.DataFrame, key: PhotoKey) -> pd.DataFrame:
    """Return the labels of a photo."""
    rows = table[table["key"] == str(key)]
    unknown = [kind for kind in rows["kind"] if kind not in BOX_CLASSES]
    if unknown:
        raise FormatError(f"label of {key} with the kind {unknown[0]!r}, expected {' or '.join(BOX_CLASSES)}")
    return rows
