"""Texture, sky, haze and compression of images of scenes beyond the sandbox."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.geometry.heightfields import smooth_noise
from polarsim.run_files.instances import ROCK_IDS, SHADOW_IDS
from polarsim.scenes.field_options import TARGET_M, FieldRanges, log_uniform
from polarsim.scenes.field_view import FieldView
from polarsim.scenes.options import Range

_TILE = 256  # side of the periodic noise, px
_ROW = 1024
_COARSEST = 0.04  # largest structure of the texture over the width of the image
_MIN_FACTOR, _MAX_FACTOR = 0.3, 2.0
_FOLDS = 4  # structure of the sky: the shorter side of the image over its clouds


@dataclass(frozen=True)
class Atmosphere:
    """Light of the sky over that of the Sun, radiance of the sky over bright ground, and distance of haze, metres."""

    fill: float
    sky: float
    haze_m: float


def draw_atmosphere(ranges: FieldRanges, random: np.random.Generator) -> Atmosphere:
    """Return a random atmosphere; a black sky neither shines nor dims distant hills."""
    if random.random() < ranges.black_sky_share:
        return Atmosphere(0.0, 0.0, np.inf)
    return Atmosphere(
        random.uniform(*ranges.sky_fill), random.uniform(*ranges.sky), TARGET_M * log_uniform(ranges.haze, random)
    )


def add_sky(
    radiance: np.ndarray, distance: np.ndarray, atmosphere: Atmosphere, random: np.random.Generator
) -> np.ndarray:
    """Return radiance (h, w) with the sky at infinite distance (h, w), and haze in front of distant ground."""
    if not atmosphere.sky:
        return radiance
    rows = np.linspace(random.uniform(0.6, 1.2), 1, len(radiance), dtype=np.float32)[:, None]  # brighter below
    clouds = 1 + random.uniform(0, 0.08) * smooth_noise(radiance.shape, radiance.shape[0] / _FOLDS, 20, 0, random)
    shown = np.exp(-distance / np.float32(atmosphere.haze_m))
    return np.asarray(shown * radiance + (1 - shown) * np.float32(atmosphere.sky) * rows * clouds, np.float32)


@dataclass(frozen=True)
class Texture:
    """Random texture that is finer than the meshes: albedo, and relief under the Sun; by kind of surface."""

    axes: np.ndarray  # (3, 2) of the noise: horizontal, and leaning so that steep faces have texture
    ground: float
    rocks: float
    relief: float  # share of relief, the rest is albedo
    offsets: np.ndarray  # (SHADOW_IDS, 2) position of each object in the noise, px

    @classmethod
    def draw(cls, ground: Range, rocks: Range, random: np.random.Generator) -> Texture:
        """Return a random texture with ranges of contrasts on the ground and on rocks."""
        turn = Rotation.from_euler("z", random.uniform(0, 2 * np.pi)).as_matrix()[:, :2]
        axes = (turn + np.outer([0, 0, 1], random.uniform(-1, 1, 2))) * [1, random.uniform(1, 1.8)]
        contrasts = log_uniform(ground, random), log_uniform(rocks, random)
        return cls(axes, *contrasts, random.uniform(0, 1), random.uniform(0, _TILE, (SHADOW_IDS, 2)))

    def factors(self, points: np.ndarray, ids: np.ndarray, view: FieldView, towards_sun: np.ndarray) -> np.ndarray:
        """Return factors (n,) float32 of the radiance at points (n, 3) of the surfaces with ids (n,)."""
        import cv2

        plane = points @ self.axes.astype(np.float32)
        sun = towards_sun / np.linalg.norm(towards_sun) @ self.axes
        shift = np.rint(2 * sun / max(float(np.linalg.norm(sun)), 1e-6)).astype(int)
        tile = _tile()
        raised = tile - np.roll(tile, shift, axis=(1, 0))
        tile = self.relief * raised / raised.std() + (1 - self.relief) * tile
        depth = (points - view.camera.centre.astype(np.float32)) @ view.camera.world_from_camera.rotation[:, 2]
        pixel_m = np.maximum(depth, 1e-3).astype(np.float32) / np.float32(view.camera.lens.fx)
        total = np.zeros(len(points), np.float32)
        length = _COARSEST * view.width
        while length > 2 * float(pixel_m.min()):
            u, v = (plane[:, n] / np.float32(length / 8) + self.offsets[ids, n].astype(np.float32) for n in (0, 1))
            value = cv2.remap(tile, _in_rows(u), _in_rows(v), cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
            total += np.clip(np.float32(length) / (2 * pixel_m) - 1, 0, 1) * value.reshape(-1)[: len(points)]
            length /= 2
        contrast = np.where((ids >= ROCK_IDS) & (ids < SHADOW_IDS), self.rocks, self.ground).astype(np.float32)
        return np.asarray(np.clip(1 + 0.6 * contrast * total, _MIN_FACTOR, _MAX_FACTOR))


def _in_rows(place: np.ndarray) -> np.ndarray:
    """Return positions (n,) in the periodic noise as rows (m, 1024), because OpenCV limits the length of a row."""
    return np.pad(place % _TILE, (0, -len(place) % _ROW)).reshape(-1, _ROW)


@cache
def _tile() -> np.ndarray:
    """Return periodic normal noise (side, side) float32 with a correlation length of an eighth of 64 px."""
    from scipy import ndimage

    noise = np.random.default_rng(0).standard_normal((_TILE, _TILE))
    noise = ndimage.gaussian_filter(noise, 2, mode="wrap")
    return np.asarray(noise / noise.std(), np.float32)


def compress(image: np.ndarray, ranges: FieldRanges, random: np.random.Generator) -> np.ndarray:
    """Return an image (h, w) uint8 with the artefacts of JPEG, or the same image."""
    import cv2

    if random.random() >= ranges.jpeg_share:
        return image
    quality = int(random.integers(int(ranges.jpeg_quality[0]), int(ranges.jpeg_quality[1]) + 1))
    content = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
    return np.asarray(cv2.imdecode(content, cv2.IMREAD_GRAYSCALE))
