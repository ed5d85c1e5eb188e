"""Reader of the catalogue of a run, from the files of `results/<run>/`."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path

from polarsim.detect.options import DetectOptions
from polarsim.detect.split import read_split
from polarsim.errors import ConfigError, FormatError
from polarsim.formats import tables
from polarsim.formats.readers import reader
from polarsim.photo import PhotoKey, Terrain, terrain_text
from polarsim.publish.catalogue import PHOTO_DOMAINS, Catalogue, CatalogueImage, CatalogueTerrain
from polarsim.run_files import lamps, rigs, scene
from polarsim.run_files.inventory import read_inventory
from polarsim.run_files.run import CONFIG, PHOTO, Run
from polarsim.site import Site


def read_catalogue(run: Path, split: str = "") -> Catalogue:
    """Read a run; `split` determines the parts of images (empty: the first split of the run's configuration)."""
    site = Run(run).site
    inventories = {number: run / f"acquire/Terrain{terrain_text(number)}/inventory.json" for number in site.terrains}
    terrains = {number: _terrain(run, site, number) for number, path in inventories.items() if path.is_file()}
    if not terrains:
        raise ConfigError("is not a run: no terrain below acquire/; check the name or run snakemake", path=run)
    kind = next(iter(terrains.values())).kind
    split = _split(run, split)
    parts = read_split(run / "detect" / split / "split.csv") if split else {}
    pictures = tuple(sorted(_pictures(Run(run), terrains, PHOTO_DOMAINS[kind], parts)))
    if not pictures:
        raise ConfigError("no images: expected photos below acquire/ or twins below renders/", path=run)
    return Catalogue(
        run=run,
        site=site,
        kind=kind,
        terrains=terrains,
        pictures=pictures,
        drives=Run(run).drives,
        tables=tuple(sorted((run / "tables").glob("*.parquet"))),
        split=split,
        config=_config(run),
        made_on=_made_on(run, pictures),
    )


def _terrain(run: Path, site: Site, number: Terrain) -> CatalogueTerrain:
    folder = f"Terrain{terrain_text(number)}"
    cameras, meshes, rocks = run / "cameras" / folder, run / "meshes" / folder, run / "rocks" / folder
    localised = rigs.read_all_localised(cameras)
    suns = lamps.read_suns(cameras, localised, site, number) if localised else {}
    maps = sorted(path for path in (run / "renders" / "maps" / folder).glob("*") if path.is_dir())
    return CatalogueTerrain(
        number=number,
        site=site,
        kind=read_inventory(run / "acquire" / folder / "inventory.json").kind,
        rigs=localised,
        suns={azimuth: suns[azimuth] for azimuth in site.suns if azimuth in suns},
        fitted_suns=frozenset(lamps.read_localised_suns(cameras)),
        meshes=scene.mesh_files(meshes, number) if meshes.is_dir() else {},
        made_from=scene.mesh_origins(meshes) if meshes.is_dir() else {},
        rocks=tables.read_parquet(rocks / "rocks.parquet", ["rock"]) if (rocks / "rocks.parquet").is_file() else None,
        maps={path.name: tuple(sorted(path.iterdir())) for path in maps},
    )


def _pictures(
    run: Run, terrains: Mapping[Terrain, CatalogueTerrain], photo_domain: str, parts: Mapping[PhotoKey, str]
) -> Iterator[CatalogueImage]:
    for terrain in terrains.values():
        listed = run.folder / "acquire" / terrain.name / "photos.parquet"
        if listed.is_file():
            paths = run.pictures_of(PHOTO, terrain.number)
            for row in tables.read_parquet(listed, tables.PHOTO_COLUMNS).to_dict("records"):
                key = PhotoKey.parse(row["key"])
                path = paths[key]
                if not path.is_file():
                    raise FormatError(f"lists {path}, which is missing", listed)
                size = int(row["width"]), int(row["height"])
                yield CatalogueImage(photo_domain, key, path, *size, row["sha256"], parts.get(key, ""))
        for model in run.models:
            for key, path in run.pictures_of(model, terrain.number).items():
                yield CatalogueImage(model, key, path, *_size(path), "", parts.get(key, ""))


@reader("picture")
def _size(path: Path) -> tuple[int, int]:
    """Read width and height from the header of an image."""
    from PIL import Image

    with Image.open(path) as picture:
        return picture.size


def _split(run: Path, wanted: str) -> str:
    """Return the wanted split, otherwise the first split of the run's configuration, otherwise the only split."""
    splits = Run(run).splits
    if wanted and wanted not in splits:
        raise ConfigError(f"no split {wanted!r}, expected one of: {', '.join(splits) or 'none'}", path=run / "detect")
    if wanted or not splits:
        return wanted
    if (run / CONFIG).is_file():
        first = str((Run(run).configured("detect").get("splits") or DetectOptions.model_fields["splits"].default)[0])
    else:
        first = splits[0] if len(splits) == 1 else ""
    if first not in splits:
        reason = f"the configured split {first!r} does not exist" if first else f"{CONFIG} is missing"
        raise ConfigError(f"{reason}; choose one of {', '.join(splits)} with --split", path=run)
    return first


def _config(run: Path) -> str:
    """Return the configuration hash in the run's tables, or ""."""
    for path in sorted((run / "tables").glob("*.parquet")):
        table = tables.read_parquet(path)
        if "config" in table.columns and len(table):
            return str(table["config"].iloc[0])
    return ""


def _made_on(run: Path, pictures: tuple[CatalogueImage, ...]) -> str:
    """Return the date of the run's newest file, so that repeated exports give the same bytes.

    The environment variable SOURCE_DATE_EPOCH overrides the date, for copies of a run without time stamps
    (https://reproducible-builds.org/specs/source-date-epoch/).
    """
    stated = os.environ.get("SOURCE_DATE_EPOCH", "")
    if stated:
        try:
            return datetime.fromtimestamp(int(stated), UTC).date().isoformat()
        except (ValueError, OverflowError, OSError) as error:
            raise ConfigError(f"SOURCE_DATE_EPOCH is {stated!r}, expected seconds since 1970") from error
    stages = ("labels/coco", "renders/coco", "cameras", "meshes")
    files = [path for stage in stages for path in (run / stage).rglob("*") if path.is_file()]
    newest = max(path.stat().st_mtime for path in [*files, *(picture.path for picture in pictures)])
    return datetime.fromtimestamp(newest, UTC).date().isoformat()
