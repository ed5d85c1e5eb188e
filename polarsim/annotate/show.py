"""One photo or twin with its labels drawn in: what `polarsim show KEY` writes."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.annotate.overlay import Marks, add_legend, draw_labels
from polarsim.errors import ConfigError, FormatError, LabelError, about
from polarsim.formats import png
from polarsim.formats.tables import LABEL_COLUMNS, label_table, read_parquet
from polarsim.formats.yolo import read_polygons
from polarsim.geometry.polygons import paint
from polarsim.photo import BOX_CLASSES, GREY_VALUES, PhotoKey
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
    """Draw a photo (domain `photo`) with its propagated labels, or a model's twin with its rendered ones.

    Where a run has no photos a twin of the same key stands in; cover photos show another light, often another camera.

    Parameters
    ----------
    scale, kinds
        As in `show`.
    masks
        Fill the regions too: of a photo the polygons of its labels, of a twin what it shows.

    Raises
    ------
    LabelError
        The run has no such picture.
    FormatError
        The run has no polygons or instance map of it.
    """
    tables = run.folder / ("labels" if domain == PHOTO else "renders") / "tables"
    picture = run.pictures_of(domain, key.terrain).get(key)
    if domain == PHOTO and picture is None:
        picture = next(iter(sorted(run.folder.glob(f"renders/*/Terrain{key.terrain:02d}/{key}.png"))), None)
        log.warning("%s: no photo of %s, %s stands in", run.folder, key, picture or "and no twin")
    if picture is None or not picture.exists():
        reason = f"no {domain} picture of {key}; domains of this run: {', '.join(run.domains)}"
        raise LabelError(reason, path=run.folder)
    show(
        key=key,
        picture=picture,
        labels=tables / f"Terrain{key.terrain:02d}.parquet",
        out=out,
        scale=scale,
        kinds=kinds,
        masks=_masks_of(run, domain, key) if masks else None,
        title=f"{key}, {picture.parents[1].name} twin" if run.folder in picture.parents else "",
    )


def _masks_of(run: Run, domain: str, key: PhotoKey) -> dict[str, np.ndarray]:
    """Where rocks and shadows are, (h, w) bool by kind."""
    if domain != PHOTO:
        return read_kind_masks(run.instances(key))
    grey = paint(read_polygons(run.polygons(key)))
    return {kind: grey == GREY_VALUES[kind] for kind in BOX_CLASSES}


def show(
    *,
    key: PhotoKey,
    picture: Path,
    labels: Sequence[Mapping[str, object]] | Path,
    out: Path,
    scale: float = 1.0,
    kinds: Sequence[str] = BOX_CLASSES,
    masks: Mapping[str, np.ndarray] | None = None,
    title: str = "",
) -> None:
    """Write a picture, tone-mapped to eight bits, with boxes, lines from shadows to rocks, ids, confidences, a legend.

    Parameters
    ----------
    picture
        A photo or twin (16 bits), or a picture of eight bits of the whole photo at any size.
    labels
        A label table, or rows with `LABEL_COLUMNS`; rows of other photos are passed over.
    scale
        Size of the result over that of the picture.
    kinds
        What is drawn: "rock", "shadow".
    masks : kind -> (h, w) bool
        Regions of the whole photo to fill; none when None.
    title
        Text of the legend; default: the key, and the name of the picture where that is another one.

    Raises
    ------
    FormatError
        The picture is no picture, or the table no label table.
    ConfigError
        A kind that no label has, or a scale that leaves no picture.
    """
    unknown = [kind for kind in kinds if kind not in BOX_CLASSES]
    if unknown:
        raise ConfigError(f"kind {unknown[0]!r}, expected {' or '.join(BOX_CLASSES)}")
    pixels = to_8bit(png.read(picture))
    width = round(scale * pixels.shape[1])
    if not 64 <= width <= 16384:
        raise ConfigError(f"scale {scale:g} makes a picture {width} px wide, expected 64 to 16384 px")
    if isinstance(labels, Path):
        with about(labels):
            rows = rows_of(read_parquet(labels, LABEL_COLUMNS), key)
    else:
        rows = rows_of(label_table([dict(row) for row in labels]), key)
    drawn = draw_labels(pixels, rows, width, Marks(kinds, links=True, shadow_ids=True), masks)
    usual = f"{key}, {picture.name}" if picture.stem != str(key) else str(key)
    png.write(out, add_legend(drawn, title or usual, rows, kinds))


def rows_of(table: pd.DataFrame, key: PhotoKey) -> pd.DataFrame:
    """The labels of one photo.

    Raises
    ------
    FormatError
        A label is of a kind that boxes do not have.
    """
    rows = table[table["key"] == str(key)]
    strange = [kind for kind in rows["kind"] if kind not in BOX_CLASSES]
    if strange:
        raise FormatError(f"label of kind {strange[0]!r} on {key}, expected {' or '.join(BOX_CLASSES)}")
    return rows
