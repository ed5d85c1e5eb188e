"""Detection of rocks and ground in scans: clouds, cuboids and a table of a terrain's rocks."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.formats import ply, tables
from polarsim.formats.files import writing_folder
from polarsim.formats.ply import Cloud
from polarsim.formats.yolo import read_rock_boxes
from polarsim.geometry.poses import Pose
from polarsim.photo import Terrain, terrain_text
from polarsim.rocks import table
from polarsim.rocks.annotated import add_annotated_rocks, add_carved_rocks
from polarsim.rocks.bumps import add_bumps
from polarsim.rocks.clouds import alignment_translations, surface_cloud, voxel_means
from polarsim.rocks.crops import CroppedRock, crop_rocks, rock_of_points
from polarsim.rocks.evidence import Evidence
from polarsim.rocks.ground import GROUND_CELL, SandSurface, find_ground, sand_extent
from polarsim.rocks.heights import upward_normals
from polarsim.rocks.options import RocksOptions
from polarsim.rocks.overrides import Overrides, read_overrides, write_cuboids, write_positions
from polarsim.rocks.regions import Cut, Limits, RockRegion, cut_by_shape, find_regions, scanned_points
from polarsim.rocks.scans import Extent, ScanPoints, merge_scans, scan_in_sandbox
from polarsim.rocks.walls import measure_walls
from polarsim.run_files import rigs
from polarsim.run_files.inventory import Inventory, read_inventory
from polarsim.run_files.rigs import LocalisedRig
from polarsim.run_files.scans import read_scan
from polarsim.run_files.scene import PHOTOS, SCANNED
from polarsim.run_files.walls import Walls, write_walls
from polarsim.site import Site
from polarsim.site_file_names import Files
from polarsim.site_parts import Sandbox

log = logging.getLogger("polarsim")
FOOT_HEIGHT = 0.006  # height above the ground at which a rock begins, metres
CONFIRMED_HEIGHT = 0.010  # minimum height of a rock that seed boxes confirm, metres
CONFIRMING_IOU = 0.3  # minimum IoU of a seed box and the rock that it confirms
# Points farther from the sand are ignored, metres: of walls, and of the floor around a raised box.
WALLS_REACH, FLOOR_REACH = 0.5, 2.0


def find_rocks(
    *,
    site: Site,
    terrain: Terrain,
    inventory: Path,
    cameras: Path,
    seeds: Path,
    overrides: Path | None,
    rocks: Path,
    cuboids: Path,
    ids: Path,
    clouds: Path,
    options: RocksOptions,
    from_photos: bool = False,
) -> None:
    """Separate rocks and ground in a terrain's scans; write the table, cuboids, positions by id, and clouds.

    Positions without a scan, or with a scan but without a pose, cause a warning. A terrain without scans has no rock
    and an empty ground cloud. Seeds with the name of another position are excluded with a warning.

    `from_photos`: the range maps are measured in photos. Their noise resembles small rocks, so that rocks without a
    seed box are excluded. Walls are not fitted here: the edges of their shadows in photos (`cameras.wall_shadows`) are
    more accurate than range maps.
    """
    localised = rigs.read_all_localised(cameras)
    typed = read_overrides(overrides) if overrides is not None else Overrides()
    evidence = Evidence(localised, read_rock_boxes(seeds, terrain, site.images.size), CONFIRMING_IOU)
    sandbox = site.sandbox_of(terrain)
    scans = read_scans(read_inventory(inventory), localised, site.files, sandbox)
    if not len(scans):
        log.warning(
            "%s: terrain %s has no scan, so that it gets no rocks and no ground", inventory, terrain_text(terrain)
        )
        _write(rocks, cuboids, ids, clouds, [], {}, {}, Cloud(np.zeros((0, 3)), np.zeros((0, 3))), None, {})
        return
    extent = sand_extent(scans, sandbox)
    everything, scans = scans, scans.select(extent.contains(scans.points))
    sand = find_ground(scans, extent, GROUND_CELL)
    sand, regions, limits = detect_regions(sand, evidence, options)
    if from_photos:
        regions = [region for region in regions if region.confirmed]
    rocks_found = [scanned_points(sand, region.seen) for region in regions]
    evidence.warn_of_other_terrain(f"terrain {terrain_text(terrain)}", rocks_found)
    sand, cropped = crop_rocks(sand, regions, typed, limits.foot, np.array(sandbox.half_width_m))
    rock_of_point = rock_of_points(sand, cropped, scans, limits.foot)
    points = {rock: _by_scan(scans.select(rock_of_point == rock), localised) for rock in cropped}
    translations = {rock: alignment_translations(list(parts.values())) for rock, parts in points.items()}
    unlabelled = [rock for rock, crop in cropped.items() if not crop.region.confirmed]
    log.info("terrain %s: %d rocks, without a seed box: %s", terrain_text(terrain), len(cropped), unlabelled or "none")
    made_from = PHOTOS if from_photos else SCANNED
    rows = [_row(rock, crop, points[rock], translations[rock], made_from) for rock, crop in cropped.items()]
    rock_clouds = {
        rock: surface_cloud(
            voxel_means(_apply_translations(points[rock], translations[rock]), options.rock_cell_mm / 1000)
        )
        for rock in cropped
    }
    walls = None if from_photos else measure_walls(terrain, sandbox, everything, float(np.median(sand.ground)))
    _write(rocks, cuboids, ids, clouds, rows, cropped, rock_clouds, ground_cloud(sand), walls, localised)


def detect_regions(
    sand: SandSurface, evidence: Evidence, options: RocksOptions
) -> tuple[SandSurface, list[RockRegion], Limits]:
    """Return the sand, the rocks on it by shape and by the seed boxes of the evidence, and the limits of rocks.

    Seeds with the name of another position are excluded.
    """
    limits = Limits(
        foot=FOOT_HEIGHT,
        height=options.min_height_mm / 1000,
        confirmed_height=CONFIRMED_HEIGHT,
        size=options.min_size_mm / 1000,
    )
    cut = cut_by_shape(sand, limits)
    evidence = _without_mislabelled(sand, limits, evidence, cut)
    sand, regions = add_annotated_rocks(sand, find_regions(sand, limits, evidence, cut), limits, evidence)
    sand, regions = add_carved_rocks(sand, regions, limits, evidence)
    sand, regions = add_bumps(sand, regions, limits, evidence)
    return sand, regions, limits


def _without_mislabelled(sand: SandSurface, limits: Limits, evidence: Evidence, cut: Cut) -> Evidence:
    """Exclude seeds with the name of another position, by rocks that were detected by shape only."""
    if not evidence.agreed or len(evidence.localised) < 2:
        return evidence
    by_shape = find_regions(sand, limits, replace(evidence, annotated={}), cut)
    return evidence.without_mislabelled([scanned_points(sand, region.seen) for region in by_shape])


def ground_cloud(sand: SandSurface) -> Cloud:
    """Return a point for each cell of visible ground, with the normal of the surface."""
    normals = upward_normals(sand.ground, sand.grid.cell)
    points = np.concatenate([sand.grid.centres(), sand.ground[..., None]], axis=-1)
    return Cloud(points[sand.is_ground], normals[sand.is_ground])


def read_scans(
    inventory: Inventory, localised: Mapping[str, LocalisedRig], files: Files, sandbox: Sandbox
) -> ScanPoints:
    """Return all scans of a terrain in the sandbox frame, by the poses of the cameras stage."""
    x, y = sandbox.half_width_m
    neighbourhood = Extent(-x, -y, x, y).grown(FLOOR_REACH if sandbox.raised else WALLS_REACH)
    scans = []
    for position in inventory.scanned:
        if position not in localised:
            log.warning(
                "terrain %s: the scan at %s has no pose and is excluded", terrain_text(inventory.terrain), position
            )
            continue
        if localised[position].unproven:
            log.warning(
                "terrain %s: the scan at %s has no confirmed pose, excluded", terrain_text(inventory.terrain), position
            )
            continue
        points_left = read_scan(inventory, position, localised[position].rig, files, interpolated=True)
        scan = scan_in_sandbox(points_left, localised[position].sandbox_from_left)
        scans.append(scan.select(neighbourhood.contains(scan.points)))
    return merge_scans(scans)


def _by_scan(points: ScanPoints, localised: Mapping[str, LocalisedRig]) -> dict[str, ScanPoints]:
    """Return the points of each position's scan, without positions that have none."""
    positions = sorted(localised)
    eyes = np.array([localised[position].sandbox_from_left.translation for position in positions])
    scanner = points.scanner(eyes)
    parts = {position: points.select(scanner == number) for number, position in enumerate(positions)}
    return {position: part for position, part in parts.items() if len(part)}


def _apply_translations(parts: Mapping[str, ScanPoints], translations: np.ndarray | None) -> ScanPoints:
    """Return the points of all scans of a rock, translated if translations (s, 3) are given."""
    if translations is None:
        return merge_scans(list(parts.values()))
    return merge_scans(
        [
            part.moved(Pose(np.eye(3), translation))
            for part, translation in zip(parts.values(), translations, strict=True)
        ]
    )


def _row(
    rock: int,
    cropped: CroppedRock,
    points: Mapping[str, ScanPoints],
    translations: np.ndarray | None,
    made_from: str,
) -> dict[str, object]:
    region = cropped.region
    return table.row(
        rock,
        cropped.cuboid,
        size=region.size,
        height=region.height,
        volume=region.volume,
        points={position: len(part) for position, part in points.items()},
        visible_share=len(region.seen) / len(region.footprint),
        scan_translation=math.nan if translations is None else float(np.linalg.norm(translations, axis=1).max()),
        source=made_from if cropped.source == SCANNED else cropped.source,
        confirmed=region.confirmed,
    )


def _write(
    rocks: Path,
    cuboids: Path,
    ids: Path,
    clouds: Path,
    rows: list[dict[str, object]],
    cropped: Mapping[int, CroppedRock],
    rock_clouds: Mapping[int, Cloud],
    ground: Cloud,
    walls: Walls | None,
    localised: Mapping[str, LocalisedRig],
) -> None:
    tripods = [(position, *rig.sandbox_from_left.translation) for position, rig in localised.items()]
    with writing_folder(clouds) as folder:
        ply.write_ply(folder / "ground.ply", ground)
        if walls is not None:
            write_walls(folder, walls)
        for rock, cloud in rock_clouds.items():
            ply.write_ply(folder / f"rock{rock}.ply", cloud)
        tables.write_csv(folder / "scanners.csv", pd.DataFrame(tripods, columns=["position", "x", "y", "z"]))
    write_cuboids(cuboids, {rock: crop.cuboid for rock, crop in cropped.items()})
    write_positions(ids, {rock: crop.region.centre for rock, crop in cropped.items()})
    tables.write_parquet(rocks, table.rock_table(rows))
