"""What a source has for one terrain: photos, calibration, scans and published meshes, and the seeds, in one form."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from polarsim.acquire.options import NO_SEEDS, SeedChoice, SeedOptions, SourceOptions
from polarsim.acquire.seeds import choose_seeds, copy_seeds, find_labels, no_seed_error
from polarsim.acquire.stereo_check import check_calibration
from polarsim.errors import FormatError, LabelError
from polarsim.formats import nasa, png, release
from polarsim.formats.readers import reader
from polarsim.formats.tables import PHOTO_COLUMNS, key_columns, read_parquet, write_parquet
from polarsim.geometry.stereo import stated_rig
from polarsim.grid import GridOptions, selected_grid
from polarsim.photo import HEIGHT, WIDTH, PhotoKey
from polarsim.progress import track
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.rigs import write_rig
from polarsim.schemas import PHOTOS

PHOTO_BITS = 16  # of the files; their values have 12

log = logging.getLogger("polarsim")
STATED = "stated"  # source of a calibration that no file of the source gave


@reader("photo")
def describe_photo(path: Path) -> dict[str, object]:
    """Width and height in pixels, bits, SHA-256 and path of a raw photo.

    Raises
    ------
    FormatError
        The file cannot be read or is damaged, or is no grey 16-bit PNG of NASA's size.
    """
    content = path.read_bytes()
    header = png.parse_header(content)
    if (header.width, header.height) != (WIDTH, HEIGHT):
        raise FormatError(f"{header.width} x {header.height} pixels, expected {WIDTH} x {HEIGHT}")
    if header.bits != PHOTO_BITS or header.channels != 1:
        raise FormatError(f"{header.channels} channels of {header.bits} bits, a photo has 1 of {PHOTO_BITS}")
    return {
        "width": header.width,
        "height": header.height,
        "bits": header.bits,
        "sha256": hashlib.sha256(content).hexdigest(),
        "path": path.as_posix(),
    }


def index_photos(files: Sequence[tuple[PhotoKey, Path]]) -> pd.DataFrame:
    """A row a photo; see `describe_photo` for what is refused."""
    return photo_table([{**key_columns(key), **describe_photo(path)} for key, path in track(files, "reading photos")])


def photo_table(rows: Sequence[Mapping[Any, Any]]) -> pd.DataFrame:
    """Rows of `PHOTOS`, typed and in the order of keys; also when there are none."""
    table = pd.DataFrame(rows, columns=list(PHOTOS.columns)).astype(PHOTOS.dtypes)
    return table.sort_values("key", ignore_index=True)


def log_gaps(keys: Collection[PhotoKey], expected: Sequence[PhotoKey], folder: Path) -> None:
    """One line where expected photos are not among `keys`, or photos lack their other camera's."""
    there = set(keys)
    missing = [key for key in expected if key not in there]
    unpaired = [key for key in sorted(there) if key.other_camera not in there]
    if not there:
        log.warning("%s: no photo", folder)
    elif missing or unpaired:
        log.warning(
            "%s: %d photos found, %d of the grid missing, %d without the other camera's, such as %s",
            folder, len(there), len(missing), len(unpaired), (*unpaired, *missing)[0],
        )  # fmt: skip


def index_terrain(
    *,
    terrain: int,
    positions: Sequence[str],
    source: SourceOptions,
    seed_options: SeedChoice,
    photos: Path,
    calibration: Path,
    inventory: Path,
    seeds: Path,
    grid: GridOptions | None = None,
) -> None:
    """Write `photos.parquet`, `calibration.json`, `inventory.json` and the folder of seeds of one terrain.

    All photos that are there are indexed. `grid` says which ones are missed where they are not there: the part of the
    photo grid that the run works on, or all of it.

    Raises
    ------
    FormatError
        The source has nothing of the terrain, a file of it is broken, or its calibration does not fit its photos.
    LabelError
        No seed, although `seed_options` are not "none"; or no scan where they are.
    """
    if not source.root.is_dir():
        raise FormatError(f"no such folder, it is the root of the source {source.kind!r}", path=source.root)
    if source.kind == "release":
        found, table = _published(source.root, terrain), photo_table([])
    else:
        found, table = _recorded(source, terrain, positions, grid or GridOptions())
    if isinstance(seed_options, SeedOptions):
        chosen = _seeds(terrain, positions, found, seed_options.root or source.root, seed_options)
    else:
        _check_scanned(terrain, positions, found, source.root)
        chosen = []
    rig = nasa.read_calibration(found.calibration) if found.calibration else stated_rig()
    recorded = {PhotoKey.parse(key): Path(path) for key, path in zip(table["key"], table["path"], strict=True)}
    check_calibration(recorded, rig, Path(found.calibration) if found.calibration else None)
    write_parquet(photos, table)  # from here on nothing of the source can be wrong any more
    write_rig(calibration, rig, Path(found.calibration).name if found.calibration else STATED)
    write_inventory(inventory, found)
    copy_seeds(chosen, seeds)


def merge_photos(*, tables: list[Path], merged: Path) -> None:
    """One table of the photos of all terrains."""
    parts = [read_parquet(path, PHOTO_COLUMNS) for path in tables]
    rows = pd.concat([part for part in parts if len(part)]) if any(map(len, parts)) else pd.DataFrame()
    write_parquet(merged, photo_table(rows.to_dict("records")))


def _published(root: Path, terrain: int) -> Inventory:
    """What a release has of a terrain."""
    looked_for = [release.label_folder(root, terrain), release.mesh_folder(root, terrain)]
    if not any(folder.is_dir() for folder in looked_for):
        names = " and ".join(folder.relative_to(root).as_posix() for folder in looked_for)
        raise FormatError(f"nothing of terrain {terrain:02d}, looked for {names}", path=root)
    stray = release.stray_files(root, terrain)
    release.log_strays(stray, f"{root}, terrain {terrain:02d}")
    ground = release.ground_file(root, terrain)
    return Inventory(
        terrain,
        "release",
        meshes=_paths(release.mesh_files(root, terrain)),
        ground=ground.as_posix() if ground else "",
        cover_photos=_paths(release.cover_photos(root, terrain)),
        stray=_below(stray, root),
    )


def _recorded(
    source: SourceOptions, terrain: int, positions: Sequence[str], grid: GridOptions
) -> tuple[Inventory, pd.DataFrame]:
    """What NASA's folders have of a terrain, and the index of its photos."""
    root = source.root
    range_maps, clouds = nasa.find_scans(root, terrain)
    folder = nasa.find_terrain_folder(root, terrain)
    if folder is None and not range_maps:
        names = f"Terrain{terrain:02d}_* and {nasa.RANGE_FOLDER}/Terrain{terrain:02d}"
        raise FormatError(f"nothing of terrain {terrain:02d}, looked for {names}", path=root)
    found = nasa.find_photos(folder, terrain) if folder else []
    files = [(key, path) for key, path in found if key.position in positions]
    log_gaps([key for key, _ in files], selected_grid(terrain, positions, grid), folder or root)
    stated = nasa.find_calibration(folder) if folder else None
    if stated is None:
        log.warning("%s: no %s, the rig of terrain 11 is taken", folder or root, nasa.CALIBRATION_NAME)
    stray = nasa.find_strays(folder, terrain) if folder else []
    inventory = Inventory(
        terrain,
        source.kind,
        calibration=stated.as_posix() if stated else "",
        range_maps=_paths({name: path for name, path in range_maps.items() if name in positions}),
        clouds=_paths({name: path for name, path in clouds.items() if name in positions}),
        stray=_below(stray, root),
    )
    return inventory, index_photos(files)


def _check_scanned(terrain: int, positions: Sequence[str], found: Inventory, root: Path) -> None:
    """Without seeds, nothing but scans tells of rocks and cameras."""
    if not found.scanned:
        raise LabelError(f"no scan of terrain {terrain:02d}, which labels.seeds: {NO_SEEDS} needs", path=root)
    unknown = set(positions) - set(found.scanned)
    if unknown:
        log.warning("%s: no scan of position %s, and no seeds are read", root, ", ".join(sorted(unknown)))


def _seeds(
    terrain: int, positions: Sequence[str], found: Inventory, root: Path, options: SeedOptions
) -> list[tuple[PhotoKey, Path]]:
    files, folder = find_labels(root, terrain)
    if found.kind != "release":  # those of a release are in its inventory
        stray = release.key_files(folder).stray
        release.log_strays((path for path in stray if folder != root or path.suffix.lower() == ".txt"), str(folder))
    chosen = choose_seeds(files, positions, options)
    if not chosen:
        raise no_seed_error(terrain, options, files, folder)
    unknown = set(positions) - {key.position for key, _ in chosen} - set(found.scanned)
    if unknown:
        log.warning("%s: neither a seed nor a scan of position %s", folder, ", ".join(sorted(unknown)))
    return chosen


def _paths(files: Mapping[str, Path] | Mapping[int, Path]) -> dict[str, str]:
    return {str(name): path.as_posix() for name, path in files.items()}


def _below(files: Sequence[Path], root: Path) -> tuple[str, ...]:
    return tuple(sorted(path.relative_to(root).as_posix() for path in files))
