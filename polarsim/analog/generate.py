"""Generator of the analog: photos, scans, calibration and seed labels of a terrain in NASA's formats."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from polarsim.analog import scanner
from polarsim.analog.options import AnalogOptions
from polarsim.analog.photographs import take_photos
from polarsim.analog.presets import PRESETS
from polarsim.analog.rocks import carve, icosphere
from polarsim.analog.terrain import AnalogTerrain, build_terrain
from polarsim.analog.truth import AlbedoMap, write_truth
from polarsim.errors import ConfigError
from polarsim.formats import nasa, nasa_layout, obj, tables
from polarsim.formats.files import write_json, writing_folder
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose, camera_pose, yaw_pitch_roll
from polarsim.geometry.stereo import RectifiedGrid, StereoRig, rectified_left
from polarsim.photo import PhotoKey, Terrain, positions, terrain_text
from polarsim.randomness import generator
from polarsim.survey import terrain_folder

_SCANNER_OFFSET = 0.06  # metres, standard deviation: offset of the scanner from the left camera
_CARVED_SIZE_M = (0.06, 0.4)  # longest extent of rocks without a sandbox, log-uniform
_CARVED_DETAIL = 5  # subdivisions: 20,480 triangles per rock
_CAMERA_FROM_UPRIGHT = Pose(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), np.zeros(3))  # x ahead, y left, z up


def generate_terrain(
    *, root: Path, receipt: Path, terrain: Terrain, keys: Sequence[PhotoKey], options: AnalogOptions, threads: int
) -> None:
    """Generate a terrain in the layout of docs/formats.md below `root`; the receipt is written last.

    Photos are rendered for `keys`. With `options.photos` false, no photos and no labels are written. Existing folders
    of the terrain are replaced at the end.

    `truth/labels.parquet` has a row for every rock and cast shadow with at least 12 visible pixels, lit or not.
    `contrast` is the mean of the region minus the mean of the surroundings in the photo, DN; scoring uses it to exclude
    regions that are not visible.
    """
    if terrain not in PRESETS:
        raise ConfigError(f"unknown terrain {terrain}, expected {min(PRESETS)} to {max(PRESETS)}")
    mismatched = [key for key in keys if key.terrain != terrain or key.position not in positions(terrain)]
    if mismatched:
        raise ConfigError(f"{mismatched[0]}: not a photo of terrain {terrain_text(terrain)}")
    receipt.unlink(missing_ok=True)
    made = build_terrain(terrain, options)
    name = f"Terrain{terrain_text(terrain)}"
    places = (terrain_folder(terrain), f"{nasa_layout.RANGE_FOLDER}/{name}", f"Labels/{name}", f"truth/{name}")
    with ExitStack() as stack:
        raw, ranges, seeds, truth = (stack.enter_context(writing_folder(root / place)) for place in places)
        nasa.write_calibration(raw / nasa_layout.CALIBRATION_NAME, made.stations.calibration)
        calibration = nasa.read_calibration(raw / nasa_layout.CALIBRATION_NAME)  # with the rounding of the file
        _write_scans(made, calibration, raw, ranges, options, threads)
        write_truth(made, truth, options)
        albedo = AlbedoMap()
        labels = take_photos(made, sorted(keys) if options.photos else [], raw, seeds, albedo, options, threads)
        tables.write_parquet(truth / "labels.parquet", labels)
        tables.write_parquet(truth / "albedo.parquet", albedo.table())
    photos = sum(1 for _ in (root / places[0]).rglob("Cam?_*.png"))
    content = {"terrain": terrain, "folder": places[0], "photos": photos, "options": options.model_dump(mode="json")}
    write_json(receipt, content)


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


def carve_rocks(*, number: int, terrain: Terrain, seed: int, meshes: Path) -> None:
    """Write a folder of closed rock meshes, metres, centred at the origin; each depends only on seed and number."""
    _, faces = icosphere(_CARVED_DETAIL)
    with writing_folder(meshes) as folder:
        for rock in range(number):
            random = generator(seed, "analog", "carved", rock)
            size = float(np.exp(random.uniform(*np.log(_CARVED_SIZE_M))))
            vertices = carve(random, rock, size, _CARVED_DETAIL).vertices
            obj.write_obj(folder / obj.rock_name(terrain, rock), Mesh(vertices, faces), f"rock{rock}")
