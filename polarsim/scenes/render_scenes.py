"""Pictures of strewn scenes of one terrain's rocks, 8 bits, with exact boxes: to train detectors on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from polarsim.errors import DetectError
from polarsim.formats import obj, png, yolo
from polarsim.formats.files import writing_folder
from polarsim.geometry.images import resize
from polarsim.photo import BLACK_LEVEL, BOX_CLASSES, HEIGHT, ROCK, SHADOW, WHITE_LEVEL, WIDTH
from polarsim.progress import track
from polarsim.randomness import generator
from polarsim.render.ground_truth import boxes_of
from polarsim.render.lamps import Lamp
from polarsim.render.olat import NO_LAMP, render_view
from polarsim.render.optics import through_lens
from polarsim.render.sensor import expose
from polarsim.render.surfaces import surfaces_of
from polarsim.run_files import class_masks
from polarsim.run_files.instances import BACKGROUND, GROUND, ROCK_IDS, SHADOW_IDS
from polarsim.scenes.background import add_background
from polarsim.scenes.layout import Scene, Shape, draw_scene
from polarsim.scenes.names import scene_name
from polarsim.scenes.options import SceneOptions, SceneRanges
from polarsim.scenes.strokes import augment_with_annotations
from polarsim.scenes.viewpoints import coarse_sand, draw_lamp

_BRIGHT_SAND = 90  # percentile of the sand's light that an exposure is told by: walls and lamps would mislead it
_SEAM_PX = 2
_CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], np.uint8)  # pixels that share an edge
_EXTREMES = (0.05, 0.95)  # of the grey values of a rock, in order, that its contrast lies between
_WHITE = 255  # of the pictures
_NUMBERS = {ROCK: ROCK_IDS, SHADOW: SHADOW_IDS}
Label = tuple[str, int, np.ndarray]


@dataclass(frozen=True)
class Shown:
    """A picture of a scene under one lamp."""

    picture: np.ndarray  # (h, w) uint8
    mask: np.ndarray  # (h, w) uint8, what every pixel shows, see `formats.class_masks`
    labels: list[Label]  # in pixels of the rendered size


def render_scenes(
    *,
    terrain: int,
    meshes: Path,
    pictures: Path,
    number: int,
    stored_px: int,
    options: SceneOptions,
    threads: int,
    ranges: SceneRanges | None = None,
) -> None:
    """Write `images/NAME.png`, `masks/NAME.png` (classes) and `labels/NAME.txt` (YOLO) of every scene and lamp.

    NAME is terrain, scene and lamp, such as `t01_s007_l2`. Pictures are rendered at the options' scale and stored
    `stored_px` wide.

    Parameters
    ----------
    meshes : Path
        Folder with the terrain's rocks, closed.
    pictures : Path
        Folder to write.
    number : int
        Scenes to strew.
    ranges : SceneRanges, optional
        What scenes are drawn from, at the options' scale whatever its own.

    Raises
    ------
    PolarsimError
        A broken mesh, or no rock.
    """
    files = obj.rock_files(meshes)
    if not files:
        raise DetectError("no rock meshes are here: rocks of this terrain cannot be strewn", path=meshes)
    shapes = [Shape(obj.read(path)) for path in files.values()]
    ranges = replace(ranges or SceneRanges(), scale=options.scale)
    with writing_folder(pictures) as folder:
        for kind in ("images", "masks", "labels"):
            (folder / kind).mkdir()
        for scene in track(range(number), f"scenes of terrain {terrain:02d}"):
            random = generator(options.seed, "covers", "scene", terrain, scene)
            for lamp, shown in enumerate(draw_pictures(shapes, stored_px, options.lamps, ranges, random, threads)):
                name = scene_name(terrain, scene, lamp)
                png.write(folder / "images" / f"{name}.png", shown.picture)
                class_masks.write(folder / "masks" / f"{name}.png", shown.mask)
                size = round(WIDTH * options.scale), round(HEIGHT * options.scale)
                classes = np.array([BOX_CLASSES.index(kind) for kind, _, _ in shown.labels], int)
                corners = np.array([box for _, _, box in shown.labels], float).reshape(-1, 4)
                yolo.write_boxes(folder / "labels" / f"{name}.txt", classes, corners, size)


def draw_pictures(
    shapes: Sequence[Shape], stored_px: int, lamps: int, ranges: SceneRanges, random: np.random.Generator, threads: int
) -> Iterator[Shown]:
    """Pictures and masks, `stored_px` wide, and labels of one scene by lamp."""
    scene = draw_scene(shapes, ranges, random)
    for radiance, ids in _rendered(scene, lamps, ranges, random, threads):
        light = random.uniform(*ranges.exposure) * (WHITE_LEVEL - BLACK_LEVEL)
        curve = tone_curve(random.uniform(*ranges.gamma))
        labels = [
            (kind, rock, box)
            for kind, rock, box in boxes_of(ids, scene.options)
            if contrast(ids, _NUMBERS[kind] + rock, box, radiance, light, curve) >= ranges.least_contrast
        ]
        picture = curve[expose(radiance, light, scene.options, random if ranges.noise else None)]
        stored = augment_with_annotations(_stored(picture, stored_px), ranges.strokes, random, WIDTH)
        mask = class_masks.of_ids(ids, {_NUMBERS[kind] + rock for kind, rock, _ in labels})
        yield Shown(stored, class_masks.resized(mask, (stored.shape[1], stored.shape[0])), labels)


def _rendered(
    scene: Scene, count: int, ranges: SceneRanges, random: np.random.Generator, threads: int
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Radiance (h, w) over that of bright sand, and ids (h, w), by lamp."""
    chosen, model, camera = scene.options, scene.options.models[0], scene.camera
    surfaces = surfaces_of(scene.mesh, chosen, {model: scene.albedo})
    coarse = coarse_sand(surfaces, camera, ranges)
    lamps: dict[str, Lamp] = {str(n): draw_lamp(surfaces, coarse, ranges, random) for n in range(count)}
    rendering = render_view(surfaces, camera, lamps, [model], sorted(lamps), chosen, threads)
    seen = through_lens(rendering.whole, lamps, surfaces, camera, chosen, threads)
    sand, around = (rendering.ids[NO_LAMP] == kind for kind in (GROUND, BACKGROUND))
    bare = around & ~np.any(
        [olat_image != 0 for olat_image in rendering.olat_images.values()], axis=0
    )  # or a wall that no lamp meets
    for name in lamps:
        radiance = seen[model, name]
        bright = max(float(np.percentile(radiance[sand] if sand.any() else radiance, _BRIGHT_SAND)), 1e-9)
        radiance = radiance / np.float32(bright)
        yield add_background(radiance, bare, ranges.background, random), rendering.ids[name]


def contrast(
    ids: np.ndarray, number: int, box: np.ndarray, radiance: np.ndarray, light: float, curve: np.ndarray
) -> float:
    """How far the grey values of what has a number in a picture of ids (h, w), and of a seam around it, go apart.

    Of the picture without noise, from the 5th to the 95th of a hundred grey values, as a share of white. With the seam,
    for of a dark rock before lit sand people see the outline.
    """
    import cv2

    left, top, right, bottom = (box + _SEAM_PX * np.array([-1, -1, 1, 1])).round().astype(int).tolist()
    window = (slice(max(top, 0), bottom), slice(max(left, 0), right))
    seen = cv2.dilate((ids[window] == number).astype(np.uint8), _CROSS, iterations=_SEAM_PX)
    values = np.sort(radiance[window][seen > 0])
    extremes = values[[round(share * (len(values) - 1)) for share in _EXTREMES]]
    shown = curve[np.clip(BLACK_LEVEL + light * extremes, 0, WHITE_LEVEL).astype(int)]
    return float(int(shown[1]) - int(shown[0])) / _WHITE


def tone_curve(gamma: float) -> np.ndarray:
    """(4096,) uint8: the grey value of each of a photo's 12-bit ones, by a power of 1 / gamma."""
    light = np.clip((np.arange(WHITE_LEVEL + 1) - BLACK_LEVEL) / (WHITE_LEVEL - BLACK_LEVEL), 0, 1)
    return np.rint(_WHITE * light ** (1 / gamma)).astype(np.uint8)


def _stored(picture: np.ndarray, width: int) -> np.ndarray:
    """A picture (h, w) uint8 averaged to a width, with the aspect ratio of a photo; not made larger."""
    width = min(width, picture.shape[1])
    return resize(picture, (width, round(width * HEIGHT / WIDTH)))
