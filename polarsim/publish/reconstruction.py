"""COLMAP models and nerfstudio's `transforms.json`: poses, lenses and a coloured point cloud."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from polarsim.errors import with_part
from polarsim.formats import colmap, gltf, obj
from polarsim.geometry.camera import Camera
from polarsim.geometry.meshes import Mesh
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import NO_ROCK
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, CatalogueImage, CatalogueTerrain
from polarsim.publish.detection_sets import tone_mapped
from polarsim.randomness import generator

POINTS = 60_000  # approximate number of points per terrain
CV_FROM_GL = np.diag([1.0, -1.0, -1.0, 1.0])  # camera frames: OpenGL -z forward and y up, OpenCV z forward and y down


def write_colmap(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `images/KEY.png` with 8 bits and `sparse/0/*.txt` into `<domain>/TerrainNN/`."""
    for domain, terrain, pictures in _scenes(catalogue):
        folder = f"{domain}/{terrain.name}"
        _write_images(bundle, folder, pictures)
        points, colours = cloud(terrain)
        by_moment: dict[str, dict[str, CatalogueImage]] = {}
        for picture in pictures:
            left = picture.key if picture.key.camera == "L" else picture.key.other_camera
            by_moment.setdefault(str(left), {})[picture.key.camera] = picture
        frames = [
            (
                {side: f"{picture.key}.png" for side, picture in sorted(pair.items())},
                _pose(terrain, next(iter(pair.values()))),
            )
            for pair in by_moment.values()
        ]
        bundle.folder_of(
            f"{folder}/sparse/0",
            ("cameras.txt", "rigs.txt", "frames.txt", "images.txt", "points3D.txt"),
            partial(
                colmap.write_pictures,
                rig=_rig(terrain, pictures[0]),
                frames=frames,
                points=points,
                colours=colours,
            ),
        )


def write_nerfstudio(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `images/KEY.png` with 8 bits, `transforms.json` and `points.ply` into `<domain>/TerrainNN/`."""
    for domain, terrain, pictures in _scenes(catalogue):
        folder = f"{domain}/{terrain.name}"
        _write_images(bundle, folder, pictures)
        frames = []
        for picture in pictures:
            camera = catalogue.camera(picture)
            assert camera is not None  # `_scenes` yields images of localised positions only
            frames.append(nerfstudio_frame(f"images/{picture.key}.png", camera))
        content = {
            "camera_model": "OPENCV",
            "applied_transform": np.eye(4)[:3].tolist(),
            "ply_file_path": "points.ply",
            "frames": frames,
        }
        bundle.json(f"{folder}/transforms.json", content)
        bundle.make(f"{folder}/points.ply", partial(_write_cloud, terrain))


def nerfstudio_frame(name: str, camera: Camera) -> dict[str, Any]:
    """Return the entry of an image in `transforms.json`; nerfstudio also has pixel centres at integer + 0.5."""
    lens = camera.lens
    k1, k2, p1, p2, k3 = lens.distortion
    return {
        "file_path": name,
        "transform_matrix": (camera.world_from_camera.matrix @ CV_FROM_GL).tolist(),
        "fl_x": lens.fx,
        "fl_y": lens.fy,
        "cx": lens.cx,
        "cy": lens.cy,
        "w": lens.width,
        "h": lens.height,
        "k1": k1,
        "k2": k2,
        "k3": k3,
        "p1": p1,
        "p2": p2,
    }


def cloud(terrain: CatalogueTerrain) -> tuple[np.ndarray, np.ndarray]:
    """Sample points (n, 3) uniformly on ground and rocks, with colours (n, 3) uint8; n is 0 without meshes."""
    parts = [(rock, obj.read_obj(path)) for rock, path in terrain.meshes.items()]
    areas = np.array([_areas(mesh).sum() for _, mesh in parts])
    points, colours = [np.zeros((0, 3))], [np.zeros((0, 3), np.uint8)]
    for (rock, mesh), area in zip(parts, areas, strict=True):
        count = max(100, round(POINTS * area / areas.sum()))
        points.append(_sample(mesh, count, generator(0, "publish", "cloud", terrain.number, rock)))
        colours.append(
            np.tile((gltf.SAND_COLOUR if rock == NO_ROCK else gltf.ROCK_COLOUR).astype(np.uint8), (count, 1))
        )
    return np.concatenate(points), np.concatenate(colours)


def _areas(mesh: Mesh) -> np.ndarray:
    a, b, c = (mesh.vertices[mesh.faces[:, corner]] for corner in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def _sample(mesh: Mesh, count: int, rng: np.random.Generator) -> np.ndarray:
    area = _areas(mesh)
    faces = mesh.faces[rng.choice(len(area), count, p=area / area.sum())]
    u, v = rng.random((2, count, 1))
    outside = u + v > 1  # reflect into the triangle
    u, v = np.where(outside, 1 - u, u), np.where(outside, 1 - v, v)
    a, b, c = (mesh.vertices[faces[:, corner]] for corner in range(3))
    return np.asarray(np.round(a + u * (b - a) + v * (c - a), 5))


def _write_cloud(terrain: CatalogueTerrain, path: Path) -> None:
    import trimesh

    points, colours = cloud(terrain)
    path.write_bytes(trimesh.PointCloud(points, colors=colours).export(file_type="ply"))


def _scenes(catalogue: Catalogue) -> Iterator[tuple[str, CatalogueTerrain, list[CatalogueImage]]]:
    """Yield domain, terrain and images of localised positions."""
    for domain in catalogue.domains:
        for terrain in catalogue.terrains.values():
            of_terrain = [picture for picture in catalogue.of_domain(domain) if picture.key.terrain == terrain.number]
            localised = [picture for picture in of_terrain if picture.key.position in terrain.rigs]
            if localised:
                yield domain, terrain, localised


def _write_images(bundle: Bundle, folder: str, pictures: list[CatalogueImage]) -> None:
    for picture in pictures:
        bundle.png(f"{folder}/images/{picture.key}.png", partial(tone_mapped, picture), [picture.path])


def _pose(terrain: CatalogueTerrain, picture: CatalogueImage) -> Pose:
    return terrain.rigs[picture.key.position].sandbox_from_left


def _rig(terrain: CatalogueTerrain, picture: CatalogueImage) -> StereoRig:
    """Return the stereo rig of a terrain scaled to the size of an image."""
    with with_part(terrain.name):
        rig = colmap.common_rig(terrain.rigs)
    factor = picture.width / rig.left.width
    return rig if factor == 1 else StereoRig(rig.left.scaled(factor), rig.right.scaled(factor), rig.left_from_right)
