"""Index of the raw data of a terrain: photos, calibration, scans, published meshes and seeds."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.acquire.converted import photos_of_run
from polarsim.acquire.inputs import no_scan_error
from polarsim.acquire.options import SeedChoice, SeedOptions, SourceOptions
from polarsim.acquire.seeds import choose_seed_files, copy_seeds, find_labels, no_seed_error
from polarsim.acquire.stereo_check import check_calibration
from polarsim.errors import FormatError
from polarsim.formats import png, release
from polarsim.formats.calibrations import read_calibration, stated_rig
from polarsim.formats.readers import reader
from polarsim.formats.tables import PHOTO_COLUMNS, key_columns, read_parquet, typed, write_parquet
from polarsim.grid import GridOptions
from polarsim.photo import PhotoKey, Terrain
from polarsim.progress import track
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.rigs import write_rig
from polarsim.schemas.photos import PHOTOS
from polarsim.site import Site
from polarsim.sources.registry import SOURCES

PHOTO_BITS = 16  # of the files; values have 12 bits

log = logging.getLogger("polarsim")
STATED = "stated"  # source of the default calibration


@reader("photo")
def describe_photo(path: Path, size: tuple[int, int]) -> dict[str, object]:
    """Return width and height in pixels, bits, SHA-256 and path of a photo in polarsim's photo format.

    `size`: expected width and height, px.
    """
    content = path.read_bytes()
    header = png.parse_header(content)
    if (header.width, header.height) != size:
        raise FormatError(f"{header.width} x {header.height} pixels, expected {size[0]} x {size[1]}")
    if header.bits != PHOTO_BITS or header.channels != 1:
        raise FormatError(f"{header.channels} channels of {header.bits} bits, expected 1 of {PHOTO_BITS}")
    return {
        "width": header.width,
        "height": header.height,
        "bits": header.bits,
        "sha256": hashlib.sha256(content).hexdigest(),
        "path": path.as_posix(),
    }


def index_photos(files: Sequence[tuple[PhotoKey, Path]], size: tuple[int, int]) -> pd.DataFrame:
    """Return a table with a row per photo; see `describe_photo` for errors."""
    rows = [{**key_columns(key), **describe_photo(path, size)} for key, path in track(files, "reading photos")]
    return photo_table(rows)


def photo_table(rows: Sequence[Mapping[Any, Any]] | pd.DataFrame) -> pd.DataFrame:
    """Return rows as a table with the columns and types of `PHOTOS`, sorted by key. It may be empty."""
    table = typed(rows, PHOTOS)
    return table.sort_values("key", ignore_index=True)


def index_terrain(
    *,
    site: Site,
    terrain: Terrain,
    positions: Sequence[str],
    source: SourceOptions,
    seed_options: SeedChoice,
    photos: Path,
    calibration: Path,
    inventory: Path,
    seeds: Path,
    converted: str | Path | None = None,
    grid: GridOptions | None = None,
) -> None:
    """Write `photos.parquet`, `calibration.json`, `inventory.json` and the folder of seeds of a terrain.

    All photos of the positions are indexed. `grid` is the part of the photo grid whose missing photos are reported.
    `converted` is the folder of the photos in polarsim's photo format, for sites with `Site.converts_photos`.
    """
    if not source.root.is_dir():
        raise FormatError(f"no such folder, expected the root of the source {source.kind!r}", path=source.root)
    data = SOURCES[source.kind]
    content = data.index(site, source.root, terrain, positions, grid or GridOptions())
    raw = content.inventory
    if not source.scans:
        raw = replace(raw, range_maps={}, clouds={})
    elif data.has_scans and (site.files.clouds or site.files.range_maps) and not raw.scanned:
        raise no_scan_error(site, terrain, source.root)
    if isinstance(seed_options, SeedOptions):
        root = seed_options.root or source.root
        chosen = _seeds(site, terrain, positions, raw, root, seed_options, log_strays=data.has_photos)
    else:
        chosen = []
        if unknown := set(positions) - set(raw.scanned):
            log.warning("%s: no scan of position %s, and no seeds are read", source.root, ", ".join(sorted(unknown)))
    rig = read_calibration(raw.calibration, site) if raw.calibration else stated_rig(site)
    stated = Path(raw.calibration) if raw.calibration else None
    with photos_of_run(content.photos, site, converted) as recorded:
        table = index_photos(list(recorded.items()), site.images.size)
        if rig.is_stereo:
            check_calibration(recorded, rig, stated, site.usual_exposure_ms)
    if converted is not None:
        table["path"] = [(Path(converted) / Path(path).name).as_posix() for path in table["path"]]
    write_parquet(photos, table)  # all errors of the source were raised above, before the first output
    write_rig(calibration, rig, Path(raw.calibration).name if raw.calibration else STATED)
    write_inventory(inventory, raw)
    copy_seeds(chosen, seeds, site.images.size)


def merge_photos(*, tables: list[Path], merged: Path) -> None:
    """Merge the photo tables of terrains."""
    write_parquet(merged, photo_table(pd.concat([read_parquet(path, PHOTO_COLUMNS) for path in tables])))


def _seeds(
    site: Site,
    terrain: Terrain,
    positions: Sequence[str],
    raw: Inventory,
    root: Path,
    options: SeedOptions,
    *,
    log_strays: bool,
) -> list[tuple[PhotoKey, Path]]:
    files, folder = find_labels(root, terrain, site.key)
    if log_strays:  # the inventory of a release lists strays
        stray = release.key_files(folder, site.key).stray
        release.log_strays((path for path in stray if folder != root or path.suffix.lower() == ".txt"), str(folder))
    chosen = choose_seed_files(site, files, positions, options)
    if not chosen:
        raise no_seed_error(terrain, options, files, folder, site.key)
    unknown = set(positions) - {key.position for key, _ in chosen} - set(raw.scanned)
    if unknown:
        log.warning("%s: neither a seed nor a scan of position %s", folder, ", ".join(sorted(unknown)))
    return chosen
