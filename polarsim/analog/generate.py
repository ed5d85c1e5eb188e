"""Generator of the analog: photos, scans, calibration and seed labels of a terrain in the formats of the site."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.analog import scanner
from polarsim.analog.options import AnalogOptions
from polarsim.analog.photographs import take_photos
from polarsim.analog.raw_files import RawFiles, raw_folders, writing_raw_files
from polarsim.analog.rocks import carve, icosphere
from polarsim.analog.stations import Stations
from polarsim.analog.terrain import AnalogTerrain, build_terrain
from polarsim.analog.truth import AlbedoMap, write_truth
from polarsim.errors import ConfigError
from polarsim.formats import nasa, obj, tables
from polarsim.formats.calibrations import read_calibration
from polarsim.formats.clouds import write_cloud
from polarsim.formats.files import write_json, writing_folder
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose, yaw_pitch_roll
from polarsim.geometry.stereo import RectifiedGrid, StereoRig, rectified_left
from polarsim.photo import PhotoKey, Terrain, terrain_text
from polarsim.randomness import generator
from polarsim.site import Site

_SCANNER_OFFSET = 0.06  # metres, standard deviation: offset of the scanner from the left camera
_CARVED_SIZE_M = (0.06, 0.4)  # longest extent of rocks without a sandbox, log-uniform
_CARVED_DETAIL = 5  # subdivisions: 20,480 triangles per rock
_CAMERA_FROM_UPRIGHT = Pose(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), np.zeros(3))  # x ahead, y left, z up


def generate_terrain(
    *,
    site: Site,
    root: Path,
    receipt: Path,
    terrain: Terrain,
    keys: Sequence[PhotoKey],
    options: AnalogOptions,
    threads: int,
) -> None:
    """Generate a terrain of a site below `root`, in the formats of the site; the receipt is written last.

    Photos are rendered for `keys`. With `options.photos` false, no photos and no labels are written. Folders of an
    earlier simulation are replaced at the end; other data of the terrain are an error.

    `truth/labels.parquet` has a row for every rock and cast shadow with at least 12 visible pixels, lit or not.
    `contrast` is the mean of the region minus the mean of the surroundings in the photo, DN; scoring uses it to exclude
    regions that are not visible.
    """
    if terrain not in site.terrains:
        raise ConfigError(f"unknown terrain {terrain}, expected {site.terrains_text}")
    mismatched = [key for key in keys if key.terrain != terrain or key.position not in site.positions_of(terrain)]
    if mismatched:
        raise ConfigError(f"{mismatched[0]}: not a photo of terrain {terrain_text(terrain)}")
    places = (f"Labels/Terrain{terrain_text(terrain)}", f"truth/Terrain{terrain_text(terrain)}")
    _refuse_real_data(root, [*raw_folders(site, terrain), places[0]], root / places[1])
    receipt.unlink(missing_ok=True)
    made = build_terrain(site, terrain, options, threads)
    chosen = sorted(keys) if options.photos else []
    with ExitStack() as stack:
        raw = stack.enter_context(writing_raw_files(site, terrain, root))
        seeds, truth = (stack.enter_context(writing_folder(root / place)) for place in places)
        calibration = _write_calibration(site, made.stations, raw)
        albedo = AlbedoMap()
        with ThreadPoolExecutor(max(1, threads)) as pool:  # a scan or a view at a time in each thread
            scans = _start_scans(made, site, calibration, raw, options, pool)
            write_truth(made, truth, options)
            labels = take_photos(made, site, chosen, raw, seeds, albedo, options, pool)
            for scan in scans:
                scan.result()
        tables.write_parquet(truth / "labels.parquet", labels)
        tables.write_parquet(truth / "albedo.parquet", albedo.table())
    content = {"terrain": terrain, "folder": raw.folder, "photos": len(chosen)}
    write_json(receipt, content | {"options": options.model_dump(mode="json")})


def _refuse_real_data(root: Path, folders: Sequence[str], truth: Path) -> None:
    """Raise ConfigError for existing folders without ground truth: they were not simulated and would be replaced."""
    if truth.exists():
        return
    for folder in (root / name for name in folders):
        if folder.is_dir() and any(folder.iterdir()):
            raise ConfigError(
                "exists and was not simulated: use source.kind: files for real data, or another source.root",
                path=folder,
            )


def _write_calibration(site: Site, stations: Stations, raw: RawFiles) -> StereoRig:
    """Write the calibration, and return it with the rounding of the file."""
    if raw.calibration is None:
        return stations.calibration
    nasa.write_calibration(raw.calibration, stations.calibration)
    return read_calibration(raw.calibration, site)


def _start_scans(
    made: AnalogTerrain, site: Site, calibration: StereoRig, raw: RawFiles, options: AnalogOptions,
    pool: ThreadPoolExecutor,
) -> list[Future[Any]]:  # fmt: skip
    """Write clouds and range maps of scanned positions, and range maps of other surveyed positions from all scans.

    The threads of the pool write them while the caller continues. Returns their tasks, whose results raise errors.
    """
    if site.files.clouds is None and site.files.range_maps is None:
        return []
    grid = rectified_left(calibration)
    poses, scanned = made.stations.sandbox_from_left, site.analog.scanned
    chosen = [position for position in poses if scanned is None or position in scanned]

    def write_scan(position: str) -> tuple[np.ndarray, np.ndarray]:
        rng = generator(options.seed, "scan", made.terrain, position)
        left = poses[position]
        centre = left.translation + rng.normal(0, _SCANNER_OFFSET, 3)
        level = camera_pose(centre, yaw_pitch_roll(left)[0], 0.0)
        sandbox_from_scanner = level @ _CAMERA_FROM_UPRIGHT
        scan = scanner.scan(made.scene, made.caster, sandbox_from_scanner, rng, options)
        error = scanner.registration_error(rng)
        frames = {"left": error @ left.inverse(), "rectified": error @ (left @ grid.left_from_rectified).inverse()}
        surface = scanner.join_points(scan, centre)
        valid = np.isfinite(scan.points[..., 0])
        if cloud := raw.cloud(position):
            points = frames[site.files.cloud_frame].apply(scan.points[valid])
            write_cloud(cloud, points, scan.intensity[valid], site.files.cloud_unit)
        _write_map(raw.range_map(position), [surface], grid, frames["rectified"])
        return surface

    scans = [pool.submit(write_scan, position) for position in chosen]

    def write_joint_map(position: str) -> None:
        rng = generator(options.seed, "scan", made.terrain, position)
        sandbox_from_rectified = poses[position] @ grid.left_from_rectified
        grid_from_sandbox = scanner.registration_error(rng) @ sandbox_from_rectified.inverse()
        _write_map(raw.range_map(position), [scan.result() for scan in scans], grid, grid_from_sandbox)

    others = [position for position in site.tripods if position in poses and position not in chosen]
    return [*scans, *(pool.submit(write_joint_map, position) for position in others)]


def _write_map(
    path: Path | None, surfaces: Sequence[tuple[np.ndarray, np.ndarray]], grid: RectifiedGrid, grid_from_sandbox: Pose
) -> None:
    if path is None:
        return
    in_grid = [(grid_from_sandbox.apply(vertices), faces) for vertices, faces in surfaces]
    nasa.write_range_map(path, scanner.range_map(in_grid, grid.lens))


def carve_rocks(*, number: int, terrain: Terrain, seed: int, meshes: Path) -> None:
    """Write a folder of closed rock meshes, metres, centred at the origin; each depends only on seed and number."""
    _, faces = icosphere(_CARVED_DETAIL)
    with writing_folder(meshes) as folder:
        for rock in range(number):
            random = generator(seed, "analog", "carved", rock)
            size = float(np.exp(random.uniform(*np.log(_CARVED_SIZE_M))))
            vertices = carve(random, rock, size, _CARVED_DETAIL).vertices
            obj.write_obj(folder / obj.rock_name(terrain, rock), Mesh(vertices, faces), f"rock{rock}")
