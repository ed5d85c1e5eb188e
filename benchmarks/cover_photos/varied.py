"""Pictures of a terrain's variants from its real cameras, 12 bits, with exact boxes: to train detectors on twins
alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
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
from polarsim.geometry.camera import Camera
from polarsim.photo import BLACK_LEVEL, BOX_CLASSES, ROCK, WHITE_LEVEL
from polarsim.progress import track
from polarsim.randomness import generator
from polarsim.render.ground_truth import boxes_of
from polarsim.render.lamps import Lamp, lamps_of
from polarsim.render.olat import NO_LAMP, render_view
from polarsim.render.optics import through_lens
from polarsim.render.sensor import expose
from polarsim.render.surfaces import surfaces_of

from .hall import furnish
from .variants import Variant, VariantOptions, draw_variant

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
                variant, rig = draw_variant(mesh, options, random), rigs[position]
                lamps = {name: lamp for name, lamp in sorted(lamps_of(suns, rig).items()) if name in suns}
                view = rig.camera(camera).scaled(options.scale)
                size = view.lens.width, view.lens.height
                pictured = _pictures(variant, view, lamps, options, random, threads)
                for name, picture, labels in pictured:
                    stem = f"{terrain:02d}_{position}_{name}_{camera}_v{number:02d}"
                    png.write(folder / "images" / f"{stem}.png", picture)
                    classes = np.array([BOX_CLASSES.index(kind) for kind, _, _ in labels], int)
                    corners = np.array([box for _, _, box in labels], float).reshape(-1, 4)
                    yolo.write_boxes(folder / "labels" / f"{stem}.txt", classes, corners, size)


def _pictures(
    variant: Variant,
    camera: Camera,
    lamps: Mapping[str, Lamp],
    options: VariantOptions,
    random: np.random.Generator,
    threads: int,
) -> Iterator[tuple[str, np.ndarray, list[tuple[str, int, np.ndarray]]]]:
    """Lamp, picture (h, w) uint16 and labels of a variant under each lamp, which is moved first."""
    chosen, model = variant.options, variant.options.models[0]
    surfaces = surfaces_of(variant.mesh, chosen, {model: variant.albedo})
    shifts = {name: options.lamp_shift_m * random.standard_normal(3) * [1, 1, 0.3] for name in lamps}
    lamps = {name: replace(lamp, position=lamp.position + shifts[name]) for name, lamp in lamps.items()}
    rendering = render_view(surfaces, camera, lamps, [model], sorted(lamps), chosen, threads)
    seen = through_lens(rendering.whole, lamps, surfaces, camera, chosen, threads)
    sand, around = (rendering.ids[NO_LAMP] == kind for kind in (GROUND, BACKGROUND))
    bare = around & ~np.any(
        [olat_image != 0 for olat_image in rendering.olat_images.values()], axis=0
    )  # or a wall that no lamp meets
    walls = (chosen.rim_half_width_m, variant.mesh.sand_level + chosen.rim_height_m)
    for name in lamps:
        radiance, ids = seen[model, name], rendering.ids[name]
        bright = max(float(np.percentile(radiance[sand] if sand.any() else radiance, _BRIGHT_SAND)), 1e-9)
        radiance = radiance / np.float32(bright)
        labels = [
            (kind, rock, box)
            for kind, rock, box in boxes_of(ids, chosen)
            if kind != ROCK or contrast_of_rock(ids, rock, box, radiance) >= options.least_contrast
        ]
        if options.hall is not None:
            radiance = furnish(radiance, around, bare, walls, camera.project, options.hall, random)
        light = random.uniform(*options.exposure) * (WHITE_LEVEL - BLACK_LEVEL)
        yield name, expose(radiance, light, chosen, random if chosen.noise else None), labels


def contrast_of_rock(ids: np.ndarray, rock: int, box: np.ndarray, radiance: np.ndarray) -> float:
    """How far the radiance (h, w) of a rock in a picture of ids (h, w), and of a seam around it, goes apart.

    From the 5th to the 95th percentile. With the seam, for of a dark rock before lit sand people see the outline.
    """
    left, top, right, bottom = (box + _SEAM_PX * np.array([-1, -1, 1, 1])).round().astype(int).tolist()
    window = (slice(max(top, 0), bottom), slice(max(left, 0), right))
    seen = ndimage.binary_dilation(ids[window] == ROCK_IDS + rock, iterations=_SEAM_PX)
    dark, bright = np.percentile(radiance[window][seen], [5, 95])
    return float(bright - dark)
