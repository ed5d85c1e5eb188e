"""KITTI data set per domain: rectified pairs with calibration, boxes and disparity, in the layout of the devkit.

The origin of KITTI's pixel coordinates is the centre of the first pixel, that of polarsim its corner. Half a pixel is
subtracted on writing.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from polarsim.detect.stereo.rectify import Rectification, rectify
from polarsim.detect.stereo.truth import DepthTruth, depth_truth
from polarsim.detect.tone import to_8_bits
from polarsim.formats import png
from polarsim.formats.coco_annotations import Annotation
from polarsim.geometry.boxes import box_around_points
from polarsim.geometry.lens import HALF_PIXEL, Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.rays_embree import EmbreeCaster
from polarsim.geometry.stereo import StereoRig
from polarsim.photo import Terrain, terrain_text
from polarsim.publish.bundle import Bundle
from polarsim.publish.catalogue import Catalogue, CatalogueImage
from polarsim.publish.detection_sets import PARTS
from polarsim.run_files.scene import read_terrain

_FULLY_VISIBLE, _PARTLY_VISIBLE = 0.98, 0.5  # minimum visible shares of KITTI's occlusion states 0 and 1
DISPARITIES = ("disp_noc_0", "disp_occ_0")  # pixels visible in both cameras, and all pixels
_STEP_PX = 2.0  # spacing of points on the edges of a box for rectification
_DISPARITY_STEPS = 256  # grey levels per pixel of disparity; level 0: unknown, or 256 px and more
_UNKNOWN_3D = "-1 -1 -1 -1000 -1000 -1000 -10"  # the devkit's values for an unknown box in three dimensions
_MATRICES = ("P0", "P1", "P2", "P3", "R0_rect", "Tr_velo_to_cam", "Tr_imu_to_velo")  # in the order of the devkit


@dataclass(frozen=True)
class KittiObject:
    """Object in the left image: bounding box (4,) in polarsim's pixels, truncation and occlusion."""

    kind: str
    box: np.ndarray
    truncated: float  # share outside the image, 0 to 1
    occluded: int  # 0 fully visible, 1 partly occluded, 2 largely occluded, 3 unknown


def _write_objects(path: str | Path, objects: Sequence[KittiObject]) -> None:
    """Write an object per line with 2 decimals, as KITTI does. Boxes in three dimensions are unknown."""
    lines = []
    for item in objects:
        edges = " ".join(f"{edge - HALF_PIXEL:.2f}" for edge in item.box)
        lines.append(f"{item.kind} {item.truncated:.2f} {item.occluded} -10 {edges} {_UNKNOWN_3D}\n")
    Path(path).write_text("".join(lines), encoding="ascii")


def disparity_picture(disparity: np.ndarray) -> np.ndarray:
    """Encode disparities (h, w) in pixels, NaN where unknown, as a 16-bit image of the devkit."""
    steps = np.round(disparity * _DISPARITY_STEPS)
    return np.where((steps >= 1) & (steps <= np.iinfo(np.uint16).max), steps, 0).astype(np.uint16)


def _write_calibration(path: str | Path, matrices: Mapping[str, np.ndarray]) -> None:
    """Write the matrices `P0` to `Tr_imu_to_velo` in the order of the devkit, with 12 digits."""
    lines = [f"{name}: {' '.join(f'{value:.12e}' for value in matrices[name].ravel())}\n" for name in _MATRICES]
    Path(path).write_text("".join(lines), encoding="ascii")


def write_kitti(catalogue: Catalogue, bundle: Bundle) -> None:
    """Write `<domain>/training/{image_2,image_3,label_2,calib,disp_noc_0,disp_occ_0}/NNNNNN.*`, `ImageSets/` and
    `keys.csv`.
    """
    disparities = Disparities(catalogue)
    for domain in catalogue.domains:
        pairs = _pairs(catalogue, domain)
        names: dict[str, list[str]] = {}
        table = io.StringIO()
        rows = csv.writer(table, lineterminator="\n")
        rows.writerow(["name", "left", "right", "part", "origin"])
        rigs: dict[tuple[Terrain, str], Rectification] = {}  # by station
        for number, (left, right) in enumerate(pairs):
            name, part = f"{number:06d}", PARTS[left.part]
            names.setdefault(part, []).append(name)
            rows.writerow([name, left.key, right.key, part, catalogue.picture_origin(left)])
            if left.key.station not in rigs:
                rig = catalogue.terrains[left.key.terrain].rigs[left.key.position].rig
                rigs = {left.key.station: rectify(rig, left.width / rig.left.width)}
            target = (f"{domain}/training", name)
            _write_pair(catalogue, bundle, target, (left, right), rigs[left.key.station])
            if meshes := list(catalogue.terrains[left.key.terrain].meshes.values()):
                for kind in DISPARITIES:
                    file = f"{domain}/training/{kind}/{name}.png"
                    content = partial(disparities.write, left.key.station, rigs[left.key.station], kind)
                    bundle.make(file, content, [*meshes, catalogue.camera_file(left)])
        for part, listed in names.items():
            bundle.text(f"{domain}/ImageSets/{part}.txt", "".join(f"{name}\n" for name in listed))
        bundle.text(f"{domain}/keys.csv", table.getvalue())


class Disparities:
    """Disparity maps of stations, computed from meshes; shared by all lights, domains and exposures."""

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._pngs: dict[tuple[Terrain, str], dict[str, bytes]] = {}  # of the last station; pairs are sorted by station

    def write(self, station: tuple[Terrain, str], rig: Rectification, kind: str, path: Path) -> None:
        if station not in self._pngs:
            truth = self._truth(station, rig)
            disparity = rig.disparity(truth.depth)
            maps = zip(DISPARITIES, (np.where(truth.shared, disparity, np.nan), disparity), strict=True)
            self._pngs = {station: {name: png.encode_png(disparity_picture(values)) for name, values in maps}}
        path.write_bytes(self._pngs[station][kind])

    def _truth(self, station: tuple[Terrain, str], rig: Rectification) -> DepthTruth:
        terrain, position = station
        folder = self._catalogue.run / "meshes" / f"Terrain{terrain_text(terrain)}"
        mesh = read_terrain(folder, terrain, self._catalogue.site.sandbox_of(terrain))
        caster = EmbreeCaster(mesh.vertices, mesh.faces)
        return depth_truth(mesh, caster, self._catalogue.terrains[terrain].rigs[position], rig)


def _pairs(catalogue: Catalogue, domain: str) -> list[tuple[CatalogueImage, CatalogueImage]]:
    """Return the stereo pairs of localised positions."""
    by_key = {picture.key: picture for picture in catalogue.of_domain(domain)}
    return [
        (picture, by_key[key.other_camera])
        for key, picture in by_key.items()
        if key.camera == "L" and key.other_camera in by_key and catalogue.camera(picture)
    ]


def _write_pair(
    catalogue: Catalogue,
    bundle: Bundle,
    target: tuple[str, str],
    pair: tuple[CatalogueImage, CatalogueImage],
    rig: Rectification,
) -> None:
    (folder, name), (left, right) = target, pair
    localised, sources = catalogue.terrains[left.key.terrain].rigs[left.key.position], catalogue.sources(left)
    for side, picture, maps in (("image_2", left, rig.left_maps), ("image_3", right, rig.right_maps)):
        bundle.png(f"{folder}/{side}/{name}.png", partial(_rectified, picture, maps), [*sources, picture.path])
    objects = [kitti_object(label, localised.rig, rig, left) for label in catalogue.labels(left)]
    inside = [item for item in objects if item]
    bundle.make(f"{folder}/label_2/{name}.txt", partial(_write_objects, objects=inside))
    matrices = calibration(rig, localised.sandbox_from_left)
    bundle.make(f"{folder}/calib/{name}.txt", partial(_write_calibration, matrices=matrices))


def calibration(rig: Rectification, sandbox_from_left: Pose) -> dict[str, np.ndarray]:
    """Return KITTI's calibration matrices with the sandbox frame as laser frame."""
    left = np.hstack([rig.lens.opencv_matrix(), np.zeros((3, 1))])
    right = left.copy()
    right[0, 3] = -rig.lens.fx * rig.baseline
    rectified_from_sandbox = (sandbox_from_left @ rig.left_from_rectified).inverse().matrix[:3]
    cameras = {"P0": left, "P1": right, "P2": left, "P3": right, "R0_rect": np.eye(3)}
    return {**cameras, "Tr_velo_to_cam": rectified_from_sandbox, "Tr_imu_to_velo": np.eye(4)[:3]}


def kitti_object(
    label: Annotation, rig: StereoRig, rectification: Rectification, left: CatalogueImage
) -> KittiObject | None:
    """Return the label in the rectified image, or None if the box is outside the image."""
    full = box_around_points(rectified_edges(label.box, rig.left.scaled(left.width / rig.left.width), rectification))
    box = np.clip(full, 0, [left.width, left.height] * 2)
    if (box[2:] - box[:2] < 1e-2).any():
        return None
    inside = float(np.prod(box[2:] - box[:2]) / np.prod(full[2:] - full[:2]))
    share = label.visible_share
    occluded = 3 if label.amodal is None else 0 if share >= _FULLY_VISIBLE else 1 if share >= _PARTLY_VISIBLE else 2
    return KittiObject(label.kind.capitalize(), box, round(1 - inside, 2), occluded)


def rectified_edges(box: np.ndarray, lens: Lens, rectification: Rectification) -> np.ndarray:
    """Return points (n, 2) on the edges of a box in the rectified image, where straight edges become curves."""
    x0, y0, x1, y1 = box
    across = np.linspace(x0, x1, max(2, int((x1 - x0) / _STEP_PX) + 2))
    down = np.linspace(y0, y1, max(2, int((y1 - y0) / _STEP_PX) + 2))
    edges = [(across, np.full_like(across, y)) for y in (y0, y1)] + [(np.full_like(down, x), down) for x in (x0, x1)]
    points = np.concatenate([np.stack(edge, axis=1) for edge in edges])
    return rectification.lens.project(rectification.left_from_rectified.inverse().apply(lens.directions(points)))


def _rectified(picture: CatalogueImage, maps: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    import cv2

    return to_8_bits(np.asarray(cv2.remap(png.read_png(picture.path), *maps, cv2.INTER_LINEAR)))
