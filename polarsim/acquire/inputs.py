"""The files of a local source that decide what a terrain's stages do: what Snakemake watches."""

from __future__ import annotations

from pathlib import Path

from polarsim.acquire.fetch import archives_of
from polarsim.acquire.options import SeedChoice, SeedOptions, SourceOptions
from polarsim.acquire.seeds import find_labels
from polarsim.formats import nasa, release


def raw_inputs(terrain: int, source: SourceOptions, seeds: SeedChoice) -> list[Path]:
    """A receipt where the terrain is made or fetched; else its local seed labels, meshes, calibration and scans.

    Label files are listed only as far as they may be seeds. Photos are too many to be watched one by one: where some
    were added, ask for `index_terrain` again (`--forcerun`).
    """
    if source.kind == "analog" or archives_of(terrain, source):
        return [source.root / "receipts" / f"Terrain{terrain:02d}.json"]
    files: list[Path] = []
    if isinstance(seeds, SeedOptions):
        labels, _ = find_labels(seeds.root or source.root, terrain)
        files = [path for key, path in labels.items() if seeds.allow(key)]
    if source.kind == "release":
        ground = release.ground_file(source.root, terrain)
        return [*files, *release.mesh_files(source.root, terrain).values(), *([ground] if ground else [])]
    folder = nasa.find_terrain_folder(source.root, terrain)
    range_maps, clouds = nasa.find_scans(source.root, terrain)
    calibration = nasa.find_calibration(folder) if folder else None
    if calibration:
        files.append(calibration)
    return [*files, *range_maps.values(), *clouds.values()]
