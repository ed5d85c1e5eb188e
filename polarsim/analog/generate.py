"""Generator of the analog: photos, scans, calibration and seed labels of a terrain in NASA's formats."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from polarsim.analog import scanner
from polarsim.analog.options import AnalogOptions
from polarsim.analog.photographs import empty_labels, take_photos
from polarsim.analog.presets import PRESETS
from polarsim.analog.terrain import AnalogTerrain, build_terrain
from polarsim.analog.truth import AlbedoMap, write_truth
from polarsim.errors import ConfigError
from polarsim.formats import nasa, tables
from polarsim.formats.files import write_json, writing_folder
from polarsim.geometry.poses import Pose, camera_pose, yaw_pitch_roll
from polarsim.geometry.stereo import RectifiedGrid, StereoRig, rectified_left
from polarsim.photo import PhotoKey, positions
from polarsim.randomness import generator
from polarsim.survey import terrain_folder

_SCANNER_OFFSET = 0.06  # metres, standard deviation: offset of the scanner from the left camera
_CAMERA_FROM_UPRIGHT = Pose(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), np.zeros(3))  # x ahead, y left, z up


def generate_terrain(
    *, terrain: int, keys: Sequence[PhotoKey], raw: Path, ranges: Path, seeds: Path, truth: Path,
    options: AnalogOptions, threads: int,
) -> None:  # fmt: skip
    """Generate a terrain and write four folders in the layout of docs/formats.md.

    Parameters
    ----------
    keys : list[PhotoKey]
        Photos to render. With `options.photos` false, no photos and no labels are written.
    raw, ranges, seeds, truth : Path
        Folders `TerrainTT_Name` (calibration, clouds, photos), `TerrainTT` of range maps, of seed labels and of ground
        truth. Existing folders are replaced at the end.
    threads : int
        Threads for ray casting and for writing photos.

    Notes
    -----
    `truth/labels.parquet` has a row for every rock and cast shadow with at least 12 visible pixels, lit or not.
    `contrast` is the mean of the region minus the mean of the surroundings in the photo, DN; scoring uses it to exclude
    regions that are not visible.

    Raises
    ------
    ConfigError
        The terrain is unknown, or keys belong to a different terrain.
    """
    if terrain not in PRESETS:
        raise ConfigError(f"unknown terrain {terrain}, expected {min(PRESETS)} to {max(PRESETS)}")
    mismatched = [key for key in keys if key.terrain != terrain or key.position not in positions(terrain)]
    if mismatched:
        raise ConfigError(f"{mismatched[0]}: not a photo of terrain {terrain:02d}")
    made = build_terrain(terrain, options)
    with ExitStack() as stack:
        folders = {
            name: stack.enter_context(writing_folder(folder))
            for name, folder in (("raw", raw), ("ranges", ranges), ("seeds", seeds), ("truth", truth))
        }
        nasa.write_calibration(folders["raw"] / nasa.CALIBRATION_NAME, made.stations.calibration)
        calibration = nasa.read_calibration(folders["raw"] / nasa.CALIBRATION_NAME)  # with the rounding of the file
        _write_scans(made, calibration, folders["raw"], folders["ranges"], options, threads)
        write_truth(made, folders["truth"], options)
        labels, albedo = empty_labels(), AlbedoMap()
        if options.photos:
            labels = take_photos(made, sorted(keys), folders["raw"], folders["seeds"], albedo, options, threads)
        tables.write_parquet(folders["truth"] / "labels.parquet", labels)
        tables.write_parquet(folders["truth"] / "albedo.parquet", albedo.table())


def _write_scans(
    made: AnalogTerrain, calibration: StereoRig, raw: Path, ranges: Path, options: AnalogOptions, threads: int
) -> None:
    """Write clouds and range maps of the scanned positions, and a range map of B from the surfaces of both scans."""
    grid = rectified_left(calibration)
    surfaces = []
    for position in scanner.SCANNED:
        rng = generator(options.seed, "scan", made.terrain, position)
        left = made.stations.sandbox_from_left[position]
        centre = left.translation + rng.normal(0, _SCANNER_OFFSET, 3)
        level = camera_pose(centre, yaw_pitch_roll(left)[0], 0.0)
        scan = scanner.scan(made.scene, made.caster, level @ _CAMERA_FROM_UPRIGHT, rng, options, threads)
        grid_from_sandbox = _registered(made, position, grid, rng)
        surface = scanner.join_points(scan, centre)
        surfaces.append(surface)
        valid = np.isfinite(scan.points[..., 0])
        points = grid_from_sandbox.apply(scan.points[valid])
        nasa.write_cloud(raw / f"Pos{position}.xyz", points, scan.intensity[valid])
        _write_map(ranges, position, [surface], grid, grid_from_sandbox, threads)
    if "B" in made.stations.sandbox_from_left:
        rng = generator(options.seed, "scan", made.terrain, "B")
        _write_map(ranges, "B", surfaces, grid, _registered(made, "B", grid, rng), threads)


def _registered(made: AnalogTerrain, position: str, grid: RectifiedGrid, rng: np.random.Generator) -> Pose:
    """Return the pose of the rectified left frame with the registration error of NASA's data."""
    exact = (made.stations.sandbox_from_left[position] @ grid.left_from_rectified).inverse()
    return scanner.registration_error(rng) @ exact


def _write_map(
    folder: Path, position: str, surfaces: Sequence[tuple[np.ndarray, np.ndarray]], grid: RectifiedGrid,
    grid_from_sandbox: Pose, threads: int,
) -> None:  # fmt: skip
    in_grid = [(grid_from_sandbox.apply(vertices), faces) for vertices, faces in surfaces]
    points = scanner.range_map(in_grid, grid.lens, threads)
    nasa.write_range_map(nasa.range_map_path(folder, position), points)


def generate_terrain_at(
    *, root: Path, receipt: Path, terrain: int, keys: list[PhotoKey], options: AnalogOptions, threads: int
) -> None:
    """Generate a terrain in the layout of `docs/formats.md`; the receipt is written last."""
    receipt.unlink(missing_ok=True)
    raw = root / terrain_folder(terrain)
    generate_terrain(
        terrain=terrain,
        keys=keys,
        raw=raw,
        ranges=root / "GroundTruth_RectifiedRangeMaps" / f"Terrain{terrain:02d}",
        seeds=root / "Labels" / f"Terrain{terrain:02d}",
        truth=root / "truth" / f"Terrain{terrain:02d}",
        options=options,
        threads=threads,
    )
    write_json(
        receipt,
        {
            "terrain": terrain,
            "folder": raw.name,
            "photos": sum(1 for _ in raw.rglob("Cam?_*.png")),
            "options": options.model_dump(mode="json"),
        },
    )
