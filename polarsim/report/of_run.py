"""Pictures made of what a run has of one photo."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from polarsim.formats.run_files import cover_photo_of, photo_of, pictures_of, twin_of
from polarsim.formats.tables import read_parquet
from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import PhotoKey
from polarsim.report.figures.comparison import draw_comparison
from polarsim.report.figures.contact import draw_contact
from polarsim.report.figures.gap_rocks import draw_gap_rocks
from polarsim.report.figures.opposition import draw_opposition
from polarsim.report.figures.seen import draw_seen
from polarsim.scoring.options import TablesOptions


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


def draw_finds_of_run(
    *,
    trained: str,
    run: Path,
    photo_domain: str | None,
    instances: Path,
    ipd: Path,
    predictions: Mapping[str, Path],
    labels: Mapping[str, Path],
    seen: Path,
    gap_rocks: Path,
    origin: dict[str, str],
    options: TablesOptions,
) -> None:
    """What one detector of a run finds in photo and twins, and its page of rocks; least confidence as of its IPD."""
    picture_of, confidence = _pictures(run, photo_domain), _confidence(ipd)
    for draw, figure in ((draw_seen, seen), (draw_gap_rocks, gap_rocks)):
        draw(
            trained=trained,
            instances=instances,
            predictions=predictions,
            labels=labels,
            picture_of=picture_of,
            confidence=confidence,
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
