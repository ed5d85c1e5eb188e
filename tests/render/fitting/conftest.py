"""Sandbox with known albedo and lamp brightness, photographed from two positions."""

from dataclasses import dataclass

import numpy as np
import pytest

from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose, camera_pose
from polarsim.photo import BLACK_LEVEL, NO_ROCK, WHITE_LEVEL
from polarsim.render import brdf_numba
from polarsim.render.fitting import samples as sampling
from polarsim.render.fitting.exposures import merge_exposures
from polarsim.render.fitting.samples import FitSamples, samples_of_view
from polarsim.render.lamps import ROVER, Lamp, lamp_names
from polarsim.render.olat import render_view
from polarsim.render.options import FittingOptions, RenderOptions
from polarsim.render.surfaces import box_mesh, build_surfaces
from polarsim.run_files.scene import TerrainMesh
from polarsim.site import polar

LAMPS = lamp_names(polar())
LENS = Lens(260.0, 260.0, 120.0, 80.0, (0.0, 0.0, 0.0, 0.0, 0.0), width=240, height=160)
PLACES = (
    camera_pose(np.array([2.4, -0.3, 1.8]), np.pi, np.radians(37)),
    camera_pose(np.array([-0.2, -2.4, 1.8]), np.pi / 2, np.radians(37)),
)
LIGHTS = {
    "30": Lamp(np.array([3.5, 1.8, 1.6])),
    "180": Lamp(np.array([-3.6, 0.3, 1.5])),
    "270": Lamp(np.array([0.2, -3.6, 1.7])),
    ROVER: Lamp(np.array([2.5, -0.3, 2.3]), 0.2),
}
GAINS = {"30": 60.0, "180": 300.0, "270": 90.0, ROVER: 200.0}  # DN per ms per unit radiance
UNSEEN, SEEN = 7, 1  # rock numbers: outside and inside the photos


@dataclass(frozen=True)
class Studio:
    mesh: TerrainMesh
    albedo: np.ndarray  # (v,) true factors; the ground's median is 1
    options: RenderOptions
    samples: FitSamples


def sandbox() -> TerrainMesh:
    """Return ground of 5 cm triangles, 2 m wide, with a block in the centre and a block outside the photos."""
    axis = np.linspace(-1, 1, 41)
    x, y = (part.ravel() for part in np.meshgrid(axis, axis, indexing="ij"))
    vertices = [np.stack([x, y, 0.02 * np.sin(3 * x) * np.cos(4 * y)], axis=1)]
    k = (np.arange(40)[:, None] * 41 + np.arange(40)).ravel()
    faces = [np.concatenate([np.stack([k, k + 41, k + 1], 1), np.stack([k + 1, k + 41, k + 42], 1)])]
    rocks = [np.full(len(faces[0]), NO_ROCK)]
    for rock, position in ((SEEN, [0.1, 0.1, 0.0]), (UNSEEN, [40.0, 0.0, 0.0])):
        v, f, _ = box_mesh(np.add(position, [-0.15, -0.15, -0.1]), np.add(position, 0.15))
        faces.append(f + sum(map(len, vertices)))
        vertices.append(v)
        rocks.append(np.full(len(f), rock))
    return TerrainMesh(*(np.concatenate(parts) for parts in (vertices, faces, rocks)))


def pattern(mesh: TerrainMesh) -> np.ndarray:
    """Return albedo factors: patches with an amplitude of 25 % on the ground, and 1.5 for rocks."""
    x, y, _ = mesh.vertices.T
    factor = np.exp(0.25 * np.sin(6 * x + 1) * np.cos(5 * y))
    factor[np.unique(mesh.faces[mesh.rock_of_face != NO_ROCK])] = 1.5
    ground = np.unique(mesh.faces[mesh.rock_of_face == NO_ROCK])
    return (factor / np.median(factor[ground])).astype(np.float32)


def photographed(olat_image: np.ndarray, gain: float, rng: np.random.Generator) -> list[tuple[np.ndarray, float]]:
    """Return noisy, partly clipped 12-bit photos of an OLAT image."""
    photos = []
    for exposure_ms in (32.0, 128.0, 512.0):
        light = gain * exposure_ms * olat_image
        noisy = light + np.sqrt(light / 8 + 0.8) * rng.standard_normal(olat_image.shape)
        photos.append((np.clip(np.rint(noisy + BLACK_LEVEL), 0, WHITE_LEVEL).astype(np.uint16), exposure_ms))
    return photos


def shoot(
    mesh: TerrainMesh, albedo: np.ndarray, options: RenderOptions, points: tuple[Pose, ...] = PLACES
) -> FitSamples:
    """Return the samples of photos of the sandbox with the true albedo."""
    rng = np.random.default_rng(3)
    painted, plain = build_surfaces(mesh, options, {"lambert": albedo, "hapke": albedo}), build_surfaces(mesh, options)
    model = "hapke" if options.models == ("hapke",) else "lambert"
    parts = []
    for number, position in enumerate(points):
        olat_images = render_view(painted, Camera(position, LENS), LIGHTS, [model], None, options).olat_images
        photos = {name: merge_exposures(photographed(olat_images[model, name], GAINS[name], rng)) for name in LIGHTS}
        parts += samples_of_view(plain, number, Camera(position, LENS), LIGHTS, photos, LAMPS)
    return FitSamples.joined(parts)


@pytest.fixture(scope="package", autouse=True)
def small_pictures():
    """Sample every pixel up to the edges, because the photos are small."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sampling, "STEP_PX", 1)
        patch.setattr(sampling, "BORDER_PX", 1)
        yield


@pytest.fixture(scope="package")
def studio(small_pictures) -> Studio:
    options = RenderOptions(
        models=("lambert",),
        walls=False,
        bounce=0,
        falloff=True,
        skirt_m=0,
        fitting=FittingOptions(parameters={}, held_out="30"),
    )
    mesh = sandbox()
    albedo = pattern(mesh)
    return Studio(mesh, albedo, options, shoot(mesh, albedo, options))


@pytest.fixture(scope="package")
def engine():
    return brdf_numba.reflectance
