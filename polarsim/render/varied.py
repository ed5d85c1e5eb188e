"""Pictures of a terrain's variants from its real cameras, 12 bits, with exact boxes: to train judges on twins alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy import ndimage

from polarsim.formats import png, yolo
from polarsim.formats.files import writing_folder
from polarsim.formats.instances import BACKGROUND, GROUND, ROCK_IDS
from polarsim.formats.lamps import read_suns
from polarsim.formats.rigs import read_all_placed
from polarsim.formats.scene import read_terrain
from polarsim.photo import BLACK_LEVEL, BOX_CLASSES, ROCK, WHITE_LEVEL
from polarsim.progress import track
from polarsim.randomness import generator
from polarsim.render.automatic import boxes_of
from polarsim.render.lamps import lamps_of
from polarsim.render.layers import NO_LAMP, render_view
from polarsim.render.optics import through_lens
from polarsim.render.relief import smooth_noise
from polarsim.render.sensor import expose
from polarsim.render.surfaces import surfaces_of
from polarsim.render.variants import VariantOptions, draw_variant

_BRIGHT_SAND = 90  # percentile of the sand's light that an exposure is told by: walls and lamps would mislead it
_SEAM_PX = 2


def render_varied(
    *, terrain: int, cameras: Path, meshes: Path, pictures: Path, options: VariantOptions, threads: int
) -> None:
    """Write `images/NAME.png` and `labels/NAME.txt` (YOLO) of every view, Sun lamp and variant, rover light off.

    NAME is terrain, position, azimuth, camera and variant, such as `01_A_30_L_v02`; the pictures are 16-bit PNGs of
    12-bit values with black level 16.

    Parameters
    ----------
    cameras : Path
        Folder with the terrain's `PosX.json`.
    meshes : Path
        Folder with the terrain's meshes.
    pictures : Path
        Folder to write.

    Raises
    ------
    FormatError
        A mesh or pose is missing or broken.
    """
    rigs = read_all_placed(cameras)
    mesh = read_terrain(meshes, terrain)
    suns = read_suns(cameras, rigs)
    views = [(position, camera) for position in options.positions if position in rigs for camera in "LR"]
    with writing_folder(pictures) as folder:
        for kind in ("images", "labels"):
            (folder / kind).mkdir()
        for number in track(range(options.number), f"variants of terrain {terrain:02d}"):
            for position, camera in views:
                random = generator(options.seed, "varied", terrain, position, camera, number)
                variant = draw_variant(mesh, options, random)
                chosen, model = variant.options, variant.options.models[0]
                surfaces = surfaces_of(variant.mesh, chosen, {model: variant.albedo})
                rig = rigs[position]
                pose, lens = rig.sandbox_from(camera), rig.rig.lens(camera).scaled(options.scale)
                lamps = {
                    name: replace(
                        lamp,
                        position=lamp.position + options.lamp_shift_m * random.standard_normal(3) * [1, 1, 0.3],
                    )
                    for name, lamp in sorted(lamps_of(suns, rig).items())
                    if name in suns
                }
                rendering = render_view(surfaces, pose, lens, lamps, [model], sorted(lamps), chosen, threads)
                seen = through_lens(rendering.whole, lamps, surfaces, pose, lens, chosen, threads)
                bare = rendering.ids[NO_LAMP] == BACKGROUND
                for layer in rendering.layers.values():
                    bare &= layer == 0  # what is left has no surface, or a wall that no lamp meets
                for name in lamps:
                    radiance = seen[model, name]
                    sand = radiance[rendering.ids[NO_LAMP] == GROUND]
                    bright = float(np.percentile(sand, _BRIGHT_SAND)) if len(sand) else float(radiance.max())
                    found = [
                        label
                        for label in boxes_of(rendering.ids[name], chosen)
                        if label[0] != ROCK
                        or contrast_of_rock(rendering.ids[name], label[1], label[2], radiance)
                        >= options.least_contrast * bright
                    ]
                    hall = random.uniform(*options.hall) * bright
                    radiance = radiance + np.where(bare, hall * draw_hall(bare.shape, random), 0).astype(np.float32)
                    light = random.uniform(*options.exposure) * (WHITE_LEVEL - BLACK_LEVEL) / max(bright, 1e-9)
                    stem = f"{terrain:02d}_{position}_{name}_{camera}_v{number:02d}"
                    noise = random if chosen.noise else None
                    png.write(folder / "images" / f"{stem}.png", expose(radiance, light, chosen, noise))
                    classes = np.array([BOX_CLASSES.index(kind) for kind, _, _ in found], int)
                    corners = np.array([box for _, _, box in found], float).reshape(-1, 4)
                    size = (lens.width, lens.height)
                    yolo.write_boxes(folder / "labels" / f"{stem}.txt", classes, corners, size)


def contrast_of_rock(ids: np.ndarray, rock: int, box: np.ndarray, radiance: np.ndarray) -> float:
    """How far the radiance (h, w) of a rock in a picture of ids (h, w), and of a seam around it, goes apart.

    From the 5th to the 95th percentile. With the seam, for of a dark rock before lit sand people see the outline.
    """
    left, top, right, bottom = (box + _SEAM_PX * np.array([-1, -1, 1, 1])).round().astype(int).tolist()
    window = (slice(max(top, 0), bottom), slice(max(left, 0), right))
    seen = ndimage.binary_dilation(ids[window] == ROCK_IDS + rock, iterations=_SEAM_PX)
    dark, bright = np.percentile(radiance[window][seen], [5, 95])
    return float(bright - dark)


def draw_hall(shape: tuple[int, int], random: np.random.Generator) -> np.ndarray:
    """(h, w) brightness of the dark hall behind the walls: folds of cloth, upright and level bars; mean 1."""
    folds = np.exp(0.5 * smooth_noise(shape, shape[0] / 4, shape[1] / 200, np.pi / 2, random))
    for _ in range(random.integers(8)):
        row, column = random.integers(shape[0]), random.integers(shape[1])
        high, wide = random.integers(2, 60, 2)
        folds[row : row + high, column : column + wide] *= random.uniform(0, 4)
    return np.asarray(folds / folds.mean())
