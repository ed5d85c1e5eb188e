"""Reconstruction of scans from a second simulator, which is independent of the analog.

`python benchmarks/foreign.py FOLDER [seed] [meshes] [--hard] [--bare] [--touching] [--without-boxes]`

Scanned rocks (OBJ files of the published release, rotated and scaled; lumpy ellipsoids without them) on waves, craters
and ripples, in a box of thick boards with loose cloth that moves between scans. Ranges have noise that grows with range
and incidence, stripes along rows and columns, mixed pixels by the width of the beam, gross outliers, and no returns
from grazing surfaces. Files are in NASA's format, full size.

Every left photo has boxes of the visible rocks of 12 px and more, with edges that are off by 2.5 px (standard
deviation); `--without-boxes` omits them.

`--hard` adds objects that are similar to small rocks: a slope, asymmetric ripples, tracks of wheels with cleats, heaps
of sand, and pebbles of 1 to 2.5 cm. `--bare` omits the rocks, so that every detection is false. `--touching` pushes
half of the rocks against a larger rock and puts a fifth on top of a rock.

No code is shared with the analog, except poses, lenses and file formats of the library.

Last metrics (seeds 1 and 2, rocks of terrains 01, 03, 04, 08, 11, three maps of 1936 x 1216, one thread of a 2-core
virtual machine): CPU seconds cameras 17 and 18, rocks 20 and 17, meshes 88 and 59, mostly for the ground with cells of
4 mm. Position C relative to A, without alignment: 0.3 mm and 0.005 degrees. In the frame of the cameras, the median
error of the ground is 0.16 and 0.15 mm, of rocks 0.47 and 0.48 mm (median of medians). Rocks of 8 cm and more: recall
and precision 1; all rocks closed, copies within 2.3 mm. Rocks of 35 to 95 mm without boxes, seeds 30, 31, 32, 46: 41 of
47 detected, 51 of 53 detections correct; on hard ground 41 of 48, 50 of 52.
"""

from __future__ import annotations

import shutil
import sys
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import open3d as o3d
import pandas as pd
from scipy import ndimage
from scipy.spatial import ConvexHull, KDTree

from polarsim.cameras.locate import locate_cameras
from polarsim.cameras.options import LocalisationOptions
from polarsim.formats import nasa, obj, tables, yolo
from polarsim.formats.calibrations import stated_rig
from polarsim.formats.obj import Mesh
from polarsim.geometry.boxes import area, box_around_points, clip
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.geometry.stereo import rectified_left
from polarsim.photo import PhotoKey
from polarsim.rocks.find import find_rocks
from polarsim.rocks.mesh import mesh_rocks
from polarsim.rocks.options import RocksOptions
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.rigs import LocalisedRig, read_localised, write_localised, write_rig
from polarsim.scoring.cameras import score_cameras
from polarsim.scoring.rock_pairs import pair_rocks
from polarsim.scoring.rocks import score_rocks
from polarsim.site import polar

TERRAIN = 2
TRIPODS = {"A": ((3.55, -0.35, 1.55), 179, 25), "B": ((6.1, -0.45, 1.55), 178, 23), "C": ((0.75, -3.6, 1.52), 103, 26)}
HALF, STEP = 2.0, 0.005  # metres: inner half width of the box, cell of the ground
BOARD, RIM, FLOOR = 0.076, 0.30, -0.6  # metres: thickness and top of the walls, level of the hall
LARGEST, SMALLEST = 0.34, 0.05  # metres: longest sides of rocks
ANNOTATION_SD_PX, SMALLEST_PX = 2.5, 12.0  # noise of an annotated edge, and minimum side of a box, sqrt(area)
BEAM_PX = 0.7  # half the width of the scanner's beam
SMALL = (0.035, 0.095)  # sizes of rocks with separate metrics, metres
COUNT = 26  # number of rocks of a scene
PEBBLES, HEAPS = 80, 8  # numbers on hard ground
PUSHED_SHARE, LAID_SHARE = (
    0.5,
    0.2,
)  # shares of the rocks of a touching scene that lean against, or are on top of, a larger rock
TOUCH = 0.004  # maximum distance between vertices of touching surfaces, metres


def ground_heights(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return coordinates (n,) along both sides, and heights (n, n) of waves, craters with rims, and ripples."""
    axis = np.arange(-HALF - BOARD, HALF + BOARD + STEP / 2, STEP)
    x, y = np.meshgrid(axis, axis)
    height = 0.02 * np.sin(1.1 * x + rng.uniform(0, 6)) + 0.02 * np.sin(0.9 * y + rng.uniform(0, 6))
    for _ in range(4):
        radius, (u, v) = rng.uniform(0.15, 0.5), rng.uniform(-1.5, 1.5, 2)
        r = np.hypot(x - u, y - v) / radius
        height += radius * (0.10 * np.exp(-(((r - 1) / 0.25) ** 2)) - 0.16 * np.exp(-((r / 0.7) ** 2)))
    for scale, size in ((0.10, 0.006), (0.03, 0.0015), (0.012, 0.0006)):
        noise = ndimage.gaussian_filter(rng.normal(size=x.shape), scale / STEP)
        height += size * noise / noise.std()
    return axis, height


def relief(axis: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return heights (n, n) to add to the ground of a hard scene: a slope, ripples, two tracks, heaps."""
    x, y = np.meshgrid(axis, axis)
    dip, towards = np.tan(np.radians(rng.uniform(2, 5))), rng.uniform(0, 2 * np.pi)
    height = dip * (x * np.cos(towards) + y * np.sin(towards))
    bent = ndimage.gaussian_filter(rng.normal(size=x.shape), 0.3 / STEP)
    wind, wave = rng.uniform(0, np.pi), rng.uniform(0.09, 0.16)
    phase = 2 * np.pi * (x * np.cos(wind) + y * np.sin(wind)) / wave + 2.5 * bent / bent.std()
    patch = ndimage.gaussian_filter(rng.normal(size=x.shape), 0.4 / STEP)
    height += 0.0025 * np.clip(patch / patch.std() + 0.5, 0, 1.5) * (np.sin(phase) + 0.3 * np.sin(2 * phase + 0.8))
    along, start = rng.uniform(0, np.pi), rng.uniform(-0.8, 0.8)
    for side in (0, 0.55):
        away = -x * np.sin(along) + y * np.cos(along) - start - side
        cleats = 0.003 * np.cos(2 * np.pi * (x * np.cos(along) + y * np.sin(along)) / 0.045)
        height += (cleats - 0.014) / (1 + (away / 0.05) ** 8) + 0.006 * np.exp(-(((np.abs(away) - 0.075) / 0.02) ** 2))
    for _ in range(HEAPS):
        u, v, width, top = *rng.uniform(-1.6, 1.6, 2), rng.uniform(0.04, 0.08), rng.uniform(0.006, 0.016)
        height += top * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * width**2))
    return height


def pebbles(axis: np.ndarray, height: np.ndarray, rng: np.random.Generator) -> list[Mesh]:
    """Return lumps of 1 to 2.5 cm, half sunk: smaller than the minimum size of rocks."""
    lumps = [_lump(rng) for _ in range(8)]
    return [_sink(lumps[n % 8], rng.uniform(0.010, 0.025), axis, height, rng) for n in range(PEBBLES)]


def _sink(lump: Mesh, size: float, axis: np.ndarray, height: np.ndarray, rng: np.random.Generator) -> Mesh:
    position = np.array([[*rng.uniform(-1.8, 1.8, 2)]])
    level = at(axis, height, position)[0] + rng.uniform(0.0, 0.25) * size
    return Mesh(size * lump.vertices + [*position[0], level], lump.faces)


def at(axis: np.ndarray, height: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return heights (n,) of the ground at points (n, 2 or 3)."""
    position = (points[:, [1, 0]] - axis[0]) / STEP
    return ndimage.map_coordinates(height, position.T, order=1, mode="nearest")


def shapes(meshes: Path | None, rng: np.random.Generator) -> list[Mesh]:
    """Return scanned rocks, or lumpy ellipsoids without meshes; centred, longest horizontal side 1."""
    files = sorted(meshes.glob("*/*_rock*.obj")) if meshes else []
    found = [obj.read_obj(path) for path in files if "decimate" not in path.name] or [_lump(rng) for _ in range(40)]
    solids = []
    for mesh in found:
        used, faces = np.unique(mesh.faces, return_inverse=True)
        vertices = mesh.vertices[used]
        centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        side = np.ptp(vertices[:, :2], axis=0).max()
        if np.ptp(vertices[:, 2]) > 0.25 * side:  # flatter rocks would be under the sand
            solids.append(Mesh((vertices - centre) / side, faces.reshape(-1, 3)))
    return solids


def _lump(rng: np.random.Generator) -> Mesh:
    ball = o3d.geometry.TriangleMesh.create_sphere(0.5, 60)
    points = np.asarray(ball.vertices).copy()
    for size in (0.12, 0.06, 0.03):
        along = rng.normal(size=(6, 3)) / size
        points += (
            size * 0.15 * points * np.sin(points @ along.T * 0.8 + rng.uniform(0, 6, 6)).sum(axis=1, keepdims=True)
        )
    return Mesh(points * rng.uniform(0.6, 1, 3), np.asarray(ball.triangles).astype(np.int64))


def place_rocks(
    axis: np.ndarray, height: np.ndarray, count: int, given: list[Mesh], rng: np.random.Generator
) -> list[Mesh]:
    """Place rocks with a power law of sizes, rotated about the vertical, sunk into the ground, without contact."""
    placed: list[Mesh] = []
    taken = np.zeros((0, 3))
    sizes = np.clip(SMALLEST * rng.uniform(0, 1, count) ** -0.8, SMALLEST, LARGEST)
    for size in np.sort(sizes)[::-1]:
        shape = given[rng.integers(len(given))]
        rotation = Pose.from_rotvec(np.array([0, 0, rng.uniform(0, 6.28)]), np.zeros(3))
        vertices = size * rotation.apply(shape.vertices)
        for _ in range(200):
            x, y = rng.uniform(-1.75, 1.75, 2)
            if (np.hypot(*(taken[:, :2] - [x, y]).T) > taken[:, 2] + 0.6 * size + 0.02).all():
                break
        else:
            continue
        vertices = vertices + np.array([x, y, 0])
        foot = vertices[vertices[:, 2] < np.quantile(vertices[:, 2], 0.1)]
        sunk = rng.uniform(0.05, 0.3) * np.ptp(vertices[:, 2])
        vertices[:, 2] += np.median(at(axis, height, foot) - foot[:, 2]) - sunk
        placed.append(Mesh(vertices, shape.faces))
        taken = np.vstack([taken, [x, y, 0.6 * size]])
    return placed


def push_together(rocks: list[Mesh], axis: np.ndarray, height: np.ndarray, rng: np.random.Generator) -> list[Mesh]:
    """Move many of the rocks next to or on top of a larger rock."""
    placed = rocks[:1]
    for rock in rocks[1:]:
        chance, moved = rng.random(), None
        for _ in range(20 if chance < PUSHED_SHARE + LAID_SHARE else 0):
            parent = placed[rng.integers(len(placed))]
            moved = (
                _push_against(rock, parent, axis, height, rng)
                if chance < PUSHED_SHARE
                else _put_on_top(rock, parent, placed, rng)
            )
            if moved is not None and all(other is parent or _is_apart(moved, other) for other in placed):
                break
            moved = None
        if moved is None and all(_is_apart(rock, other) for other in placed):
            moved = rock
        if moved is not None:
            placed.append(moved)
    return placed


def _push_against(
    rock: Mesh, parent: Mesh, axis: np.ndarray, height: np.ndarray, rng: np.random.Generator
) -> Mesh | None:
    """Slide a rock over the ground from a random direction until it touches its parent; None at the walls."""
    centres = [(mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))[:2] / 2 for mesh in (rock, parent)]
    angle, tree = rng.uniform(0, 2 * np.pi), KDTree(parent.vertices)
    near, far = 0.0, sum(np.ptp(mesh.vertices[:, :2], axis=0).max() for mesh in (rock, parent))
    foot = rock.vertices[rock.vertices[:, 2] < np.quantile(rock.vertices[:, 2], 0.1)]
    for _ in range(10):
        apart = (near + far) / 2
        position = centres[1] + apart * np.array([np.cos(angle), np.sin(angle)])
        translation = np.append(position - centres[0], 0.0)
        translation[2] = np.median(at(axis, height, foot + translation) - at(axis, height, foot))
        vertices = rock.vertices + translation
        meets = np.isfinite(tree.query(vertices, distance_upper_bound=TOUCH)[0]).any()
        near, far = (apart, far) if meets or apart < 0.02 else (near, apart)
    return Mesh(vertices, rock.faces) if (np.abs(position) < 1.75).all() else None


def _put_on_top(rock: Mesh, parent: Mesh, placed: list[Mesh], rng: np.random.Generator) -> Mesh | None:
    """Drop a rock, closed from below by its hull, onto its parent; None if the parent is not clearly larger."""
    size, larger = (np.ptp(mesh.vertices[:, :2], axis=0).max() for mesh in (rock, parent))
    if size > 0.8 * larger:
        return None
    hull = ConvexHull(rock.vertices)
    centres = [(mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2 for mesh in (rock, parent)]
    above = np.append((centres[1] - centres[0])[:2] + rng.normal(0, 0.2 * larger, 2), 1.0)
    start = rock.vertices + above
    down = np.broadcast_to([0.0, 0.0, -1.0], start.shape)
    rays = np.concatenate([start, down], axis=1).astype(np.float32)
    fall = _scene(placed).cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy().min()
    if not np.isfinite(fall):
        return None
    below = hull.simplices[hull.equations[:, 2] < 0]
    return Mesh(start - [0, 0, fall + 0.003], np.concatenate([rock.faces, below]))


def _is_apart(one: Mesh, other: Mesh) -> bool:
    return not np.isfinite(KDTree(other.vertices).query(one.vertices, distance_upper_bound=TOUCH)[0]).any()


def box(cloth: float, rng: np.random.Generator) -> Mesh:
    """Return boards around the sand, with cloth that bulges by up to `cloth` metres, different in every scan."""
    parts, faces, start = [], [], 0
    along = np.linspace(-HALF - BOARD, HALF + BOARD, 300)
    profile = [(0.0, FLOOR), (0.0, RIM), (BOARD, RIM), (BOARD, FLOOR)]
    steps = np.concatenate([np.linspace(a, b, 25)[:-1] for a, b in pairwise(profile)])
    for side in range(4):
        bulge = ndimage.gaussian_filter(rng.normal(size=(len(steps), len(along))), (4, 9))
        bulge *= cloth / np.abs(bulge).max()
        outward = HALF + steps[:, :1] + bulge
        wall = np.stack(
            [outward, np.broadcast_to(along, outward.shape), np.broadcast_to(steps[:, 1:], outward.shape)], -1
        )
        rotation = Pose.from_rotvec(np.array([0, 0, side * np.pi / 2]), np.zeros(3))
        parts.append(rotation.apply(wall.reshape(-1, 3)))
        faces.append(_grid_faces(*outward.shape) + start)
        start += outward.size
    floor = np.array([[-9, -9, FLOOR], [9, -9, FLOOR], [9, 9, FLOOR], [-9, 9, FLOOR]], float)
    parts.append(floor)
    faces.append(np.array([[0, 1, 2], [0, 2, 3]]) + start)
    return Mesh(np.concatenate(parts), np.concatenate(faces))


def _grid_faces(rows: int, columns: int) -> np.ndarray:
    a = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    return np.concatenate([np.stack([a, a + 1, a + columns], 1), np.stack([a + 1, a + columns + 1, a + columns], 1)])


def scan(solids: list[Mesh], sandbox_from_eye: Pose, directions: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return points (h, w, 3) float32 in the scanner's frame along directions (h, w, 3); NaN without a return."""
    scene = _scene(solids)
    rays = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    distance, cosine = _hits(scene, sandbox_from_eye, rays)
    pixel = np.abs(np.diff(rays[:, :, 0], axis=1)).mean()
    beside = rays.copy()
    beside[..., :2] += BEAM_PX * pixel * rng.choice([-1.0, 1.0], (*distance.shape, 2))
    other = _hits(scene, sandbox_from_eye, beside / np.linalg.norm(beside, axis=-1, keepdims=True))[0]
    mixed = (np.abs(other - distance) > 0.015) & (rng.random(distance.shape) < 0.6)
    share = rng.random(distance.shape)
    distance = np.where(mixed, share * distance + (1 - share) * other, distance)
    noise = 0.002 * (0.4 + 0.15 * distance + 0.3 * np.minimum(1 / np.maximum(cosine, 0.05) - 1, 6))
    rows, columns = np.indices(distance.shape)
    stripes = 0.0006 * np.sin(rows / 3.1) + 0.0012 * (rows % 48 == 0) - 0.0010 * (columns % 61 == 0)
    measured = distance + noise * rng.normal(size=distance.shape) + stripes
    wild = rng.random(distance.shape) < 0.002
    measured[wild] *= rng.uniform(0.6, 1.4, wild.sum())
    lost = rng.random(distance.shape) < 0.003 + 0.95 * np.clip((0.12 - cosine) / 0.12, 0, 1) ** 1.5
    measured[lost] = np.nan
    return (measured[..., None] * rays).astype(np.float32)


def _scene(solids: list[Mesh]) -> o3d.t.geometry.RaycastingScene:
    scene = o3d.t.geometry.RaycastingScene()
    for solid in solids:
        scene.add_triangles(
            o3d.core.Tensor(solid.vertices.astype(np.float32)), o3d.core.Tensor(solid.faces.astype(np.uint32))
        )
    return scene


def _hits(scene: o3d.t.geometry.RaycastingScene, pose: Pose, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return distances and cosines of incidence (h, w) along unit rays (h, w, 3)."""
    rotated = pose.rotate(rays.reshape(-1, 3)).reshape(rays.shape)
    start = np.broadcast_to(pose.translation, rotated.shape)
    hit = scene.cast_rays(o3d.core.Tensor(np.concatenate([start, rotated], axis=-1).astype(np.float32)))
    distance, normals = hit["t_hit"].numpy().astype(float), hit["primitive_normals"].numpy()
    return np.where(distance < 10, distance, np.nan), np.abs((normals * rotated).sum(axis=-1))


def make(
    folder: Path, seed: int, meshes: Path | None, count: int = COUNT, *, hard: bool = False, touching: bool = False
) -> None:
    """Write range maps and calibration in NASA's format, and the ground truth."""
    rng, of_hard = np.random.default_rng(seed), np.random.default_rng([seed, 2])
    axis, height = ground_heights(rng)
    height += relief(axis, of_hard) if hard else 0.0
    clutter = pebbles(axis, height, of_hard) if hard else []
    x, y = np.meshgrid(axis, axis)
    ground = Mesh(np.stack([x, y, height], -1).reshape(-1, 3), _grid_faces(len(axis), len(axis)))
    rocks = place_rocks(axis, height, count, shapes(meshes, rng), rng)
    if touching:
        rocks = push_together(rocks, axis, height, np.random.default_rng([seed, 3]))
    rig = stated_rig(polar())
    grid = rectified_left(rig)
    maps = {}
    for position, (tripod, yaw, pitch) in TRIPODS.items():
        centre = np.array(tripod) + rng.normal(0, 0.08, 3)
        angles = np.radians([yaw + rng.normal(0, 2), pitch + rng.normal(0, 1.5), rng.normal(0, 1)])
        sandbox_from_left = camera_pose(centre, *angles)
        solids = [ground, *rocks, *clutter, box(0.02, rng)]
        points = scan(solids, sandbox_from_left @ grid.left_from_rectified, grid.lens.pixel_directions(), rng)
        maps[position] = str(folder / f"Pos{position}_org-XYZ.tif")
        nasa.write_range_map(maps[position], points)
        write_localised(folder / f"truth/cameras/Pos{position}.json", LocalisedRig(rig, sandbox_from_left, "truth"))
    write_inventory(folder / "inventory.json", Inventory(TERRAIN, "files", range_maps=maps))
    write_rig(folder / "calibration.json", rig, "stated")
    _write_truth(folder / "truth", ground, rocks, axis, height)


def _write_truth(truth: Path, ground: Mesh, rocks: list[Mesh], axis: np.ndarray, height: np.ndarray) -> None:
    rows = []
    for number, rock in enumerate(rocks, 1):
        above = rock.vertices[:, 2] - at(axis, height, rock.vertices)
        faces = rock.faces[(above > -0.003)[rock.faces].any(axis=1)]
        if not len(faces):  # completely under the sand
            continue
        used, index = np.unique(faces, return_inverse=True)
        part = rock.vertices[used]
        low, high = part.min(axis=0), part.max(axis=0)
        name = obj.rock_name(TERRAIN, number)
        obj.write_obj(truth / "meshes" / name, Mesh(part, index.reshape(-1, 3)), Path(name).stem)
        rows.append((number, *(low + high) / 2, (high - low)[:2].max(), above[used].max(), np.nan))
    columns = ["rock", "x", "y", "z", "size_m", "height_m", "volume_m3"]
    tables.write_parquet(truth / "rocks.parquet", pd.DataFrame(rows, columns=columns))
    name = obj.ground_name(TERRAIN)
    obj.write_obj(truth / "meshes" / name, ground, Path(name).stem)


def annotate(folder: Path, seed: int) -> None:
    """Write a file of annotated rock boxes per position, from the ground truth in a folder."""
    rng = np.random.default_rng([seed, 1])
    rocks = [obj.read_obj(path) for path in obj.rock_files(folder / "truth/meshes").values()]
    scene = _scene([obj.read_obj(folder / "truth/meshes" / obj.ground_name(TERRAIN)), *rocks])
    for position in TRIPODS:
        placed = read_localised(folder / f"truth/cameras/Pos{position}.json")
        lens, boxes = placed.rig.left, []
        for rock in rocks:
            pixels = placed.project("L", rock.vertices)
            inside = ((pixels > 0) & (pixels < [lens.width, lens.height])).all(axis=1)
            seen = pixels[inside & _in_sight(scene, placed.sandbox_from_left.translation, rock.vertices)]
            if len(seen):
                box = clip(box_around_points(seen)[None] + rng.normal(0, ANNOTATION_SD_PX, 4), 1936, 1216)[0]
                if np.sqrt(area(box)) >= SMALLEST_PX:
                    boxes.append(np.round(box))
        key = PhotoKey(TERRAIN, position, "off", "30", "L", 256)
        yolo.write_boxes(
            folder / f"seeds/{key}.txt", np.zeros(len(boxes), int), np.array(boxes), size=polar().images.size
        )


def _in_sight(scene: o3d.t.geometry.RaycastingScene, eye: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return whether points (n, 3) are visible from a position, (n,)."""
    away = points - eye
    rays = np.concatenate([np.broadcast_to(eye, away.shape), away], axis=1).astype(np.float32)
    return np.asarray(scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy() > 0.999)


def reconstruct(folder: Path, rocks_options: RocksOptions | None = None) -> dict[str, float]:
    """Reconstruct cameras, rocks and meshes from the scans in a folder; return the CPU seconds of each stage."""
    options = rocks_options or RocksOptions()
    (folder / "seeds").mkdir(exist_ok=True)
    seconds, start = {}, time.process_time()
    locate_cameras(
        site=polar(),
        terrain=TERRAIN,
        positions=sorted(TRIPODS),
        inventory=folder / "inventory.json",
        calibration=folder / "calibration.json",
        seeds=folder / "seeds",
        cameras=folder / "cameras",
        options=LocalisationOptions(),
    )
    seconds["cameras"], start = time.process_time() - start, time.process_time()
    find_rocks(
        site=polar(),
        terrain=TERRAIN,
        inventory=folder / "inventory.json",
        cameras=folder / "cameras",
        seeds=folder / "seeds",
        overrides=None,
        rocks=folder / "rocks.parquet",
        cuboids=folder / "cuboids.yaml",
        ids=folder / "ids.yaml",
        clouds=folder / "clouds",
        options=options,
    )
    seconds["find"], start = time.process_time() - start, time.process_time()
    mesh_rocks(
        site=polar(),
        terrain=TERRAIN,
        rocks=folder / "rocks.parquet",
        clouds=folder / "clouds",
        meshes=folder / "meshes",
        options=options,
    )
    seconds["mesh"] = time.process_time() - start
    return seconds


def score(folder: Path) -> pd.DataFrame:
    """Return metrics of cameras and rocks against the ground truth."""
    common = {"site": polar(), "terrain": TERRAIN, "cameras": folder / "cameras", "truth": folder / "truth"}
    common |= {"meshes": folder / "meshes"}
    score_cameras(**common, matches=None, annotated=None, evaluation=folder / "cameras.csv")
    rocks = {"rocks": folder / "rocks.parquet", "evaluation": folder / "rocks.csv", "scores": folder / "scores.csv"}
    rocks |= {"inventory": folder / "inventory.json", "offsets": folder / "offsets.parquet"}
    score_rocks(**common, **rocks, located=folder / "cameras")
    return pd.concat([pd.read_csv(folder / f"{name}.csv") for name in ("cameras", "rocks")], ignore_index=True)


def score_small_rocks(folder: Path) -> dict[str, float]:
    """Count small rocks and detections, correct and missed, and the errors of the rest.

    Rocks are classified by their size, in the frame of position A, and matched with detections of any size.
    """
    true, found = (pd.read_parquet(folder / name) for name in ("truth/rocks.parquet", "rocks.parquet"))
    placed = [
        read_localised(folder / source / "PosA.json").sandbox_from_left for source in ("truth/cameras", "cameras")
    ]
    true_from_sandbox = placed[0] @ placed[1].inverse()
    found[["x", "y", "z"]] = true_from_sandbox.apply(found[["x", "y", "z"]].to_numpy(float).reshape(-1, 3))
    pairs = pair_rocks(true, found)
    wanted, given = (table["size_m"].between(*SMALL).to_numpy() for table in (true, found))
    hit, right = np.isin(np.arange(len(true)), pairs.true), np.isin(np.arange(len(found)), pairs.found)
    return {
        "small rocks": int(wanted.sum()),
        "small rocks found": int((wanted & hit).sum()),
        "small finds": int(given.sum()),
        "small finds that are true": int((given & right).sum()),
        "other rocks missed": int((~wanted & ~hit).sum()),
        "other finds that are false": int((~given & ~right).sum()),
    }


def main() -> None:
    flags = {"--without-boxes", "--hard", "--bare", "--touching"}
    given = [argument for argument in sys.argv[1:] if argument not in flags]
    folder, seed = Path(given[0]), int(given[1]) if len(given) > 1 else 1
    meshes = Path(given[2]) if len(given) > 2 else None
    if not (folder / "truth").exists():
        count = 0 if "--bare" in sys.argv else COUNT
        make(folder, seed, meshes, count, hard="--hard" in sys.argv, touching="--touching" in sys.argv)
    shutil.rmtree(folder / "seeds", ignore_errors=True)
    if "--without-boxes" not in sys.argv:
        annotate(folder, seed)
    print("CPU seconds:", {name: round(value, 1) for name, value in reconstruct(folder).items()})
    print(score_small_rocks(folder))
    if "--bare" not in sys.argv:
        print(score(folder)[["stage", "subject", "metric", "value", "unit", "n"]].to_string(index=False))


if __name__ == "__main__":
    main()
