"""8-bit training images of randomised scenes with exact labels."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from polarsim.errors import DetectError
from polarsim.formats import obj, png, yolo
from polarsim.formats.files import writing_folder
from polarsim.geometry.heightfields import smooth_noise
from polarsim.geometry.images import resize
from polarsim.photo import (
    BLACK_LEVEL,
    BOX_CLASSES,
    REFERENCE_SIZE_PX,
    REFERENCE_WIDTH_PX,
    WHITE_LEVEL,
    Terrain,
    terrain_text,
)
from polarsim.progress import track
from polarsim.randomness import generator
from polarsim.render.lamps import Lamp
from polarsim.render.olat import NO_LAMP, render_view
from polarsim.render.optics import apply_lens_to_olat_images
from polarsim.render.sensor import expose
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files import class_masks
from polarsim.run_files.instances import BACKGROUND, GROUND
from polarsim.scenes.field_options import FieldRanges
from polarsim.scenes.field_scenes import render_field_scene
from polarsim.scenes.layout import RandomScene, RockShape, draw_scene
from polarsim.scenes.options import Range, SceneOptions, SceneRanges
from polarsim.scenes.scene_image import SceneImage, labels_with_contrast, tone_curve
from polarsim.scenes.strokes import augment_with_annotations
from polarsim.scenes.viewpoints import coarse_sand, draw_lamp

log = logging.getLogger("polarsim")
_FIELD_SHAPES = 60  # number of shapes for scenes of the kind field
_BRIGHT_SAND = 90  # percentile of the sand radiance that defines the exposure, independent of walls and lamps


def render_scenes(
    *,
    terrain: Terrain,
    meshes: Path,
    pictures: Path,
    number: int,
    stored_px: int,
    options: SceneOptions,
    threads: int,
    ranges: SceneRanges | FieldRanges | None = None,
) -> None:
    """Write `images/NAME.png`, `masks/NAME.png` (classes) and `labels/NAME.txt` (YOLO) of every scene and lamp.

    NAME consists of terrain, scene and lamp, such as `t01_s007_l2`. Images are rendered at `options.scale` and stored
    with a width of `stored_px`.

    `meshes`: folder with closed rock meshes. `ranges`: ranges of the random parameters, of the kind of the options;
    `scale` is that of the options.
    """
    files = obj.rock_files(meshes)
    if not files:
        raise DetectError("no rock meshes found, expected at least one terrainNN_rockK.obj", path=meshes)
    ranges = replace(ranges or (FieldRanges() if options.kind == "field" else SceneRanges()), scale=options.scale)
    shapes = read_rock_shapes(list(files.values()), options)
    if len(shapes) < len(files):
        log.info("terrain %s: the shapes of %d of %d rocks are used", terrain_text(terrain), len(shapes), len(files))
    with writing_folder(pictures) as folder:
        for kind in ("images", "masks", "labels"):
            (folder / kind).mkdir()
        for scene in track(range(number), f"scenes of terrain {terrain_text(terrain)}"):
            write_scene(folder, shapes, terrain, scene, stored_px, options, ranges, threads)


def read_rock_shapes(files: Sequence[Path], options: SceneOptions) -> list[RockShape]:
    """Read the shapes of rocks. Scenes of the kind field deform shapes at random and need only some of them."""
    chosen = files[:_FIELD_SHAPES] if options.kind == "field" else files
    return [RockShape(obj.read_obj(path)) for path in chosen]


def write_scene(
    folder: Path,
    shapes: Sequence[RockShape],
    terrain: Terrain,
    scene: int,
    stored_px: int,
    options: SceneOptions,
    ranges: SceneRanges | FieldRanges,
    threads: int,
) -> None:
    """Write images, masks and labels of a scene, one of each per lamp. Scenes are independent of each other."""
    random = generator(options.seed, "covers", "scene", terrain, scene)
    if isinstance(ranges, FieldRanges):
        images = render_field_scene(shapes, stored_px, options.lamps, ranges, random, threads)
    else:
        images = render_random_scene(shapes, stored_px, options.lamps, ranges, random, threads)
    for lamp, rendered in enumerate(images):
        name = f"t{terrain_text(terrain)}_s{scene:03d}_l{lamp}"
        png.write_png(folder / "images" / f"{name}.png", rendered.image)
        class_masks.write_class_mask(folder / "masks" / f"{name}.png", rendered.mask)
        size = round(REFERENCE_WIDTH_PX * options.scale), round(REFERENCE_SIZE_PX[1] * options.scale)
        classes = np.array([BOX_CLASSES.index(kind) for kind, _, _ in rendered.labels], int)
        corners = np.array([box for _, _, box in rendered.labels], float).reshape(-1, 4)
        yolo.write_boxes(folder / "labels" / f"{name}.txt", classes, corners, size)


def render_random_scene(
    shapes: Sequence[RockShape],
    stored_px: int,
    lamps: int,
    ranges: SceneRanges,
    random: np.random.Generator,
    threads: int,
) -> Iterator[SceneImage]:
    """Generate a scene and yield image and mask, `stored_px` wide, and labels for each lamp."""
    scene = draw_scene(shapes, ranges, random)
    for radiance, ids in _rendered(scene, lamps, ranges, random, threads):
        light = random.uniform(*ranges.exposure) * (WHITE_LEVEL - BLACK_LEVEL)
        curve = tone_curve(random.uniform(*ranges.gamma))
        labels, mask = labels_with_contrast(ids, radiance, light, curve, scene.options, ranges.min_contrast)
        image = curve[expose(radiance, light, scene.options, random if ranges.noise else None)]
        width = min(stored_px, image.shape[1])
        stored = resize(image, (width, round(width * REFERENCE_SIZE_PX[1] / REFERENCE_WIDTH_PX)))
        stored = augment_with_annotations(stored, ranges.max_strokes, random, REFERENCE_WIDTH_PX)
        yield SceneImage(stored, class_masks.resized(mask, (stored.shape[1], stored.shape[0])), labels)


def _rendered(
    scene: RandomScene, count: int, ranges: SceneRanges, random: np.random.Generator, threads: int
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the radiance (h, w), relative to bright sand, and the id map (h, w) for each lamp."""
    options, model, camera = scene.options, scene.options.reflectance_models[0], scene.camera
    surfaces = build_surfaces(scene.mesh, options, {model: scene.albedo})
    coarse = coarse_sand(surfaces, camera, ranges)
    lamps: dict[str, Lamp] = {str(n): draw_lamp(surfaces, coarse, ranges, random) for n in range(count)}
    rendering = render_view(surfaces, camera, lamps, [model], sorted(lamps), options, threads)
    olat_images = apply_lens_to_olat_images(rendering.whole, lamps, surfaces, camera, options, threads)
    sand, around = (rendering.ids[NO_LAMP] == kind for kind in (GROUND, BACKGROUND))
    bare = around & ~np.any(
        [olat_image != 0 for olat_image in rendering.olat_images.values()], axis=0
    )  # includes unlit walls
    for name in lamps:
        radiance = olat_images[model, name]
        bright = max(float(np.percentile(radiance[sand] if sand.any() else radiance, _BRIGHT_SAND)), 1e-9)
        radiance = radiance / np.float32(bright)
        yield add_background(radiance, bare, ranges.background, random), rendering.ids[name]


def add_background(
    radiance: np.ndarray, bare: np.ndarray, brightness: Range, random: np.random.Generator
) -> np.ndarray:
    """Return the radiance (h, w) float32, relative to lit sand, with a dark hall at the unlit pixels `bare`.

    The hall has folds of cloth and vertical and horizontal bars; detectors trained without it report rocks in it. Cards
    and lens glare had no effect on the results on photos (docs/notes/detect.md).
    """
    if not bare.any():
        return np.asarray(radiance, np.float32)
    level, (height, width) = random.uniform(*brightness), bare.shape
    hall = np.exp(0.5 * smooth_noise((height, width), height / 4, width / 200, np.pi / 2, random))
    for _ in range(random.integers(8)):
        row, column = random.integers(height), random.integers(width)
        high, wide = random.integers(2, 60, 2)
        hall[row : row + high, column : column + wide] *= random.uniform(0, 4)
    return np.asarray(radiance + np.where(bare, level * (hall / hall.mean()), 0), np.float32)
