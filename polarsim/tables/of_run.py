"""Pictures made of what a run has of one photo."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from polarsim.errors import LabelError
from polarsim.formats.instances import read_kind_masks
from polarsim.formats.tables import read_parquet
from polarsim.formats.yolo import read_polygons
from polarsim.geometry.polygons import paint
from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import BOX_CLASSES, GREY_VALUES, PhotoKey
from polarsim.tables.figures.comparison import draw_comparison
from polarsim.tables.figures.contact import draw_contact
from polarsim.tables.figures.gap_rocks import draw_gap_rocks
from polarsim.tables.figures.opposition import draw_opposition
from polarsim.tables.figures.seen import draw_seen
from polarsim.tables.options import TablesOptions
from polarsim.tables.run_files import cover_photo_of, instances_of, photo_of, pictures_of, polygons_of, twin_of
from polarsim.tables.show import show

log = logging.getLogger("polarsim")


def show_of_run(
    *,
    key: PhotoKey,
    run: Path,
    domain: str,
    out: Path,
    scale: float = 1.0,
    kinds: Sequence[str] = BOX_CLASSES,
    masks: bool = False,
) -> None:
    """Draw a photo (domain `photo`) with its propagated labels, or a model's twin with its automatic ones.

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
    tables = run / ("labels" if domain == "photo" else "renders") / "tables"
    picture = photo_of(run, key) if domain == "photo" else twin_of(run, domain, key)
    if domain == "photo" and picture is None:
        picture = next(iter(sorted(run.glob(f"renders/*/Terrain{key.terrain:02d}/{key}.png"))), None)
        log.warning("%s: no photo of %s, %s stands in", run, key, picture or "and no twin")
    if picture is None or not picture.exists():
        raise LabelError(f"no {domain} picture of {key}; models are below {run / 'renders'}", path=run)
    show(
        key=key,
        picture=picture,
        labels=tables / f"Terrain{key.terrain:02d}.parquet",
        out=out,
        scale=scale,
        kinds=kinds,
        masks=_masks_of(run, domain, key) if masks else None,
    )


def _masks_of(run: Path, domain: str, key: PhotoKey) -> dict[str, np.ndarray]:
    """Where rocks and shadows are, (h, w) bool by kind."""
    if domain != "photo":
        return read_kind_masks(instances_of(run, key))
    grey = paint(read_polygons(polygons_of(run, key)))
    return {kind: grey == GREY_VALUES[kind] for kind in BOX_CLASSES}


def draw_contact_of_run(
    *,
    terrain: int,
    position: str,
    run: Path,
    grid: GridOptions,
    models: Sequence[str],
    figure: Path,
    options: TablesOptions,
) -> None:
    """The contact sheet of a set-up, on its photos, else on twins of the first model that has them."""

    def picture_of(key: PhotoKey) -> Path | None:
        candidates = [photo_of(run, key), *(twin_of(run, model, key) for model in models)]
        return next((path for path in candidates if path is not None and path.exists()), None)

    draw_contact(
        keys=selected_grid(terrain, [position], grid),
        labels=run / "labels" / "tables" / f"Terrain{terrain:02d}.parquet",
        picture_of=picture_of,
        figure=figure,
        options=options,
    )


def draw_comparison_of_run(
    *, key: PhotoKey, run: Path, models: Sequence[str], figure: Path, options: TablesOptions
) -> None:
    """The figure of one photo: photo, twins and cover photo, as far as the run has them, with their labels."""
    table = f"Terrain{key.terrain:02d}.parquet"
    draw_comparison(
        key=key,
        photo=photo_of(run, key),
        twins_of=lambda shown: {model: twin_of(run, model, shown) for model in models},
        labels=run / "labels" / "tables" / table,
        automatic=run / "renders" / "tables" / table,
        cover_photo=cover_photo_of(run, key),
        figure=figure,
        options=options,
    )


def draw_gap_rocks_of_run(
    *,
    trained: str,
    run: Path,
    photo_domain: str | None,
    instances: Path,
    ipd: Path,
    predictions: Mapping[str, Path],
    labels: Mapping[str, Path],
    figure: Path,
    origin: dict[str, str],
    options: TablesOptions,
) -> None:
    """The page of rocks of one judge of a run; least confidence as its IPD was computed."""
    draw_gap_rocks(
        trained=trained,
        instances=instances,
        predictions=predictions,
        labels=labels,
        picture_of=_pictures(run, photo_domain),
        confidence=_confidence(ipd),
        figure=figure,
        origin=origin,
        options=options,
    )


def draw_seen_of_run(
    *,
    trained: str,
    run: Path,
    photo_domain: str | None,
    instances: Path,
    ipd: Path,
    predictions: Mapping[str, Path],
    labels: Mapping[str, Path],
    figure: Path,
    origin: dict[str, str],
    options: TablesOptions,
) -> None:
    """What one judge of a run sees in photo and twins; least confidence as its IPD was computed."""
    draw_seen(
        trained=trained,
        instances=instances,
        predictions=predictions,
        labels=labels,
        picture_of=_pictures(run, photo_domain),
        confidence=_confidence(ipd),
        figure=figure,
        origin=origin,
        options=options,
    )


def draw_opposition_of_run(
    *,
    terrains: Sequence[int],
    run: Path,
    photo_domain: str,
    models: Sequence[str],
    grid: GridOptions,
    positions: Sequence[str],
    figure: Path,
    words: Path,
    options: TablesOptions,
) -> None:
    """Photo and twins near opposition and far from it."""
    draw_opposition(
        keys=[key for terrain in terrains for key in selected_grid(terrain, list(positions), grid)],
        cameras={terrain: run / "cameras" / f"Terrain{terrain:02d}" for terrain in terrains},
        photo_domain=photo_domain,
        models=models,
        picture_of=_pictures(run, photo_domain),
        figure=figure,
        words=words,
        options=options,
    )


def _pictures(run: Path, photo_domain: str | None) -> Callable[[str, PhotoKey], Path | None]:
    """Photo or twin of a domain and a key; of a terrain's photos the table is read once."""
    photos: dict[int, dict[PhotoKey, Path]] = {}

    def picture_of(domain: str, key: PhotoKey) -> Path | None:
        if domain != photo_domain:
            return twin_of(run, domain, key)
        if key.terrain not in photos:
            photos[key.terrain] = pictures_of(run, "photo", key.terrain)
        return photos[key.terrain].get(key)

    return picture_of


def _confidence(ipd: Path) -> float:
    """Least confidence of the predictions that IPD counts."""
    confidence = read_parquet(ipd, ["confidence"])["confidence"]
    return float(confidence.iloc[0]) if len(confidence) else 0.0
