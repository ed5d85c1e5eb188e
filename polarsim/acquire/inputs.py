"""Raw data of a terrain as inputs of Snakemake rules."""

from __future__ import annotations

from pathlib import Path

from polarsim.acquire.fetch import archives_of
from polarsim.acquire.options import SeedChoice, SeedOptions, SourceOptions
from polarsim.acquire.seeds import find_labels
from polarsim.errors import FormatError
from polarsim.photo import Terrain, terrain_text
from polarsim.site import Site
from polarsim.sources.registry import SOURCES


def raw_inputs(site: Site, terrain: Terrain, source: SourceOptions, seeds: SeedChoice) -> list[Path]:
    """Return the receipt of a generated or fetched terrain, or the files of a local one.

    Label files that cannot be seeds are not included, nor are photos, which are too many: after adding photos, run
    `index_terrain` with `--forcerun`.
    """
    data = SOURCES[source.kind]
    if data.is_generated or archives_of(site, terrain, source):
        return [source.root / "receipts" / f"Terrain{terrain_text(terrain)}.json"]
    files: list[Path] = []
    if isinstance(seeds, SeedOptions):
        labels, _ = find_labels(seeds.root or source.root, terrain)
        files = [path for key, path in labels.items() if seeds.allow(key)]
    return [*files, *data.inputs(site, source.root, terrain)]


def no_scan_error(site: Site, terrain: Terrain, root: Path) -> FormatError:
    """Return the error for a terrain without scans in a run that reads scans."""
    expected = " or ".join(pattern for pattern in (site.files.range_maps, site.files.clouds) if pattern)
    return FormatError(
        f"no scan of terrain {terrain_text(terrain)}, expected {expected}: add scans, or remove the terrain from "
        "`terrains` and run it separately with source.scans: false and annotated photos",
        path=root,
    )
