"""Check that the paths of a configuration lead to usable data, before any job starts.

Snakemake removes the outputs of a job before it runs the job. An invalid path that is detected by a
job would therefore delete the results of an earlier run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from pydantic import BaseModel

from polarsim.acquire.inputs import no_scan_error
from polarsim.acquire.options import NO_SEEDS, SeedOptions
from polarsim.acquire.seeds import choose_seed_files, find_labels, no_seed_error
from polarsim.config import Config
from polarsim.errors import ConfigError
from polarsim.formats import release, site_files
from polarsim.formats.files import resolve_packaged
from polarsim.grid import selected_grid
from polarsim.photo import PhotoKey

_FOLDERS = (
    "source.root", "labels.seeds.root", "labels.corrections", "scoring.annotated_root", "detect.views",
    "rover.fine_tuning.drives",
)  # fmt: skip
_OPTIONAL_SECTIONS = ("detect", "rover", "covers")  # their paths are used only where their key `run` is true


def check_paths(config: Config) -> None:
    """Check every path of a configuration, the seeds, the corrections and the excluded photos.

    Raises
    ------
    ConfigError
        A path is missing, a file instead of a folder or vice versa, or a folder without usable content; a corrected
        photo is not part of the run; an excluded photo is neither seed nor correction.
    FormatError, LabelError
        A label file is invalid, or a terrain has no scans or no seeds.
    """
    for key, path in _used_paths(config):
        _check_kind(key, path)
    _check_source(config)
    _check_ranges(config)
    _check_scans(config)
    _check_seeds(config)
    _check_annotated(config)
    _check_excluded(config, _checked_corrections(config))


def _used_paths(config: Config) -> Iterator[tuple[str, Path]]:
    """Yield key and path of every path that the run reads, in the order of the configuration."""
    for name, section in config:
        if isinstance(section, BaseModel) and (name not in _OPTIONAL_SECTIONS or getattr(section, "run", True)):
            yield from _paths_in(section, name)


def _paths_in(value: object, key: str) -> Iterator[tuple[str, Path]]:
    if isinstance(value, Path):
        yield key, value
    elif isinstance(value, BaseModel):
        for name, inner in value:
            yield from _paths_in(inner, f"{key}.{name}")
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _paths_in(inner, f"{key}.{name}")
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for inner in value:
            yield from _paths_in(inner, key)


def _check_kind(key: str, path: Path) -> None:
    path = resolve_packaged(path)
    if key == "source.root" and not path.exists():  # data may have to be generated or downloaded
        return
    if not path.exists():
        raise ConfigError(f"{key}: no such file or folder", path=path)
    is_folder = key in _FOLDERS or key.startswith("detect.elsewhere.")
    if is_folder and not path.is_dir():
        raise ConfigError(f"{key}: a file, expected a folder", path=path)
    if not is_folder and not path.is_file():
        raise ConfigError(f"{key}: a folder, expected a file", path=path)


def _is_local(config: Config) -> bool:
    """Return whether raw data are local: neither generated nor downloaded."""
    return not config.data_source.is_generated and not config.source.urls


def _check_source(config: Config) -> None:
    source, views = config.source, config.detect.views
    if _is_local(config) and not source.root.is_dir():
        raise ConfigError(f"source.root: no such folder, expected data of kind {source.kind!r}", path=source.root)
    if config.detect.run and views is not None and not (views / "index.csv").is_file():
        raise ConfigError("detect.views: no index.csv, expected output of `polarsim render VIEWS.yaml`", path=views)
    for drive in config.rover.fine_tuning.drives if config.rover.run else ():
        if not any(drive.glob("*/poses.parquet")):
            raise ConfigError("rover.fine_tuning.drives: no pictures of a drive, expected */poses.parquet", path=drive)


def _check_ranges(config: Config) -> None:
    if not config.has_ranges:
        raise ConfigError(
            f"source: without scans, ranges are measured in stereo photos, but the site {config.site.name} has one "
            "camera: expected files.clouds or files.range_maps of the site, and source.scans: true"
        )


def _check_scans(config: Config) -> None:
    """Check that all terrains of local data have scans if one has; without any, the first job of a terrain fails."""
    if not config.has_scans or not _is_local(config):
        return
    site, root = config.site, config.source.root
    missing = [
        terrain
        for terrain in config.terrains
        if not site_files.find_range_maps(site, root, terrain) and not site_files.find_clouds(site, root, terrain)
    ]
    if missing and len(missing) < len(config.terrains):
        raise no_scan_error(site, missing[0], root)


def _check_seeds(config: Config) -> None:
    seeds = config.labels.seeds
    if not isinstance(seeds, SeedOptions) or (seeds.root is None and not _is_local(config)):
        return
    for terrain in config.terrains:
        files, folder = find_labels(seeds.root or config.source.root, terrain, config.site.key)
        if not any(seeds.allow(key) and key.position in config.positions for key in files):
            raise no_seed_error(terrain, seeds, files, folder, config.site.key)


def _check_annotated(config: Config) -> None:
    root = config.scoring.annotated_root
    if root is None:
        return
    folders = [of(root, n) for n in config.terrains for of in (release.label_folder, release.polygon_folder)]
    if not any(folder.is_dir() for folder in folders):
        expected = " or ".join(folder.relative_to(root).as_posix() for folder in folders[:2])
        raise ConfigError(f"scoring.annotated_root: no labels of the run's terrains, expected {expected}", path=root)


def _checked_corrections(config: Config) -> set[PhotoKey]:
    """Return the photos that people corrected, all of them photos of the run."""
    folder = config.labels.corrections
    if folder is None:
        return set()
    from polarsim.labels.seeds import read_all_corrections  # imports pandas, which a plan needs only here

    found = set(read_all_corrections(folder, config.site))
    if not found:
        raise ConfigError(
            "labels.corrections: no KEY.txt or COCO file with labels; omit the key to run without corrections",
            path=folder,
        )
    for key in sorted(found):
        if key.terrain not in config.terrains:
            raise ConfigError(f"labels.corrections: {key}, expected {config.terrains_text}", folder)
        if key not in selected_grid(config.site, key.terrain, config.positions, config.grid):
            raise ConfigError(f"labels.corrections: {key} is not in the run's `positions` and `grid`", folder)
    return found


def _check_excluded(config: Config, corrections: set[PhotoKey]) -> None:
    """Check that each excluded photo is a seed or a correction, as far as the seeds exist already."""
    seeds = config.labels.seeds
    for key in map(PhotoKey.parse, config.labels.excluded_annotations):
        if key.terrain not in config.terrains:
            raise ConfigError(f"labels.excluded_annotations: {key}, expected {config.terrains_text}")
        if key in corrections:
            continue
        if not isinstance(seeds, SeedOptions):
            raise ConfigError(
                f"labels.excluded_annotations: {key} is not a correction, and labels.seeds is {NO_SEEDS!r}"
            )
        root = seeds.root or config.source.root
        files, folder = find_labels(root, key.terrain, config.site.key) if root.is_dir() else ({}, root)
        if files and key not in dict(choose_seed_files(config.site, files, config.positions, seeds)):
            raise ConfigError(f"labels.excluded_annotations: {key} is neither a seed nor a correction", path=folder)
