"""Scenes beyond the sandbox: rocks of many sizes on natural ground in any light, with exact labels."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from polarsim.geometry.heightfields import grid_mesh
from polarsim.geometry.images import resize
from polarsim.geometry.meshes import Mesh
from polarsim.photo import BLACK_LEVEL, NO_ROCK, REFERENCE_SIZE_PX, REFERENCE_WIDTH_PX, WHITE_LEVEL
from polarsim.render.hits import cast_strip
from polarsim.render.lamps import Lamp
from polarsim.render.olat import render_view
from polarsim.render.optics import apply_lens
from polarsim.render.options import RenderOptions
from polarsim.render.parameters import HapkeParameters, Material, PrincipledParameters
from polarsim.render.sensor import expose
from polarsim.render.surfaces import build_surfaces
from polarsim.run_files import class_masks
from polarsim.run_files.instances import GROUND, ROCK_IDS
from polarsim.run_files.scene import TerrainMesh
from polarsim.scenes.field_effects import Texture, add_sky, compress, draw_atmosphere
from polarsim.scenes.field_ground import draw_ground
from polarsim.scenes.field_options import FieldRanges, log_uniform
from polarsim.scenes.field_rocks import draw_parts, rock_noise, scatter_field_rocks, scatter_gravel
from polarsim.scenes.field_view import FieldView, draw_view
from polarsim.scenes.layout import FIRST_ROCK, RockShape
from polarsim.scenes.scene_image import SceneImage, labels_with_contrast, tone_curve

_SKY_LAMPS = 4  # directions from which the sky shines, in a ring
_SKY_ELEVATION_DEG = (25, 75)
_BRIGHT_GROUND = 90  # percentile of the radiance of the ground that defines the exposure
_MIN_BRIGHT = 0.4  # minimum radiance of bright ground over that of the image
_SPOT = 0.02  # smallest spots of albedo over the size of a rock
_LAMP_DISTANCE = 10.0  # distance of lamps over that of `Lamp.sun`, for parallel light on hills
# Minimum visible area at full photo width, px: 30 px for a rock in an image 640 px wide.
_MIN_ROCK_PX, _MIN_SHADOW_PX, _MIN_SHADOW_WIDTH_PX, _MIN_PART_PX = 275, 550, 9, 90


@dataclass(frozen=True)
class FieldScene:
    """Mesh, albedo factors of the vertices (v,), view, and render options."""

    mesh: TerrainMesh
    albedo: np.ndarray
    view: FieldView
    options: RenderOptions


def render_field_scene(
    shapes: Sequence[RockShape],
    stored_px: int,
    lamps: int,
    ranges: FieldRanges,
    random: np.random.Generator,
    threads: int,
) -> Iterator[SceneImage]:
    """Generate a scene and yield image and mask, at most `stored_px` wide, and labels for each position of the Sun."""
    scene = draw_field_scene(shapes, ranges, random)
    options, camera = scene.options, scene.view.camera
    model = options.reflectance_models[0]
    surfaces = build_surfaces(scene.mesh, options, {model: scene.albedo})
    suns = {f"sun{n}": _draw_sun(ranges, random) for n in range(lamps)}
    sky = _sky_lamps(random)
    rendering = render_view(surfaces, camera, suns | sky, [model], sorted(suns), options, threads)
    diffuse = sum(rendering.olat_images[model, name] for name in sky) / np.float32(len(sky))
    hits = cast_strip(surfaces, camera, slice(0, camera.lens.height))
    ids_of_hits = surfaces.id_of_face.take(hits.face)
    shape = camera.lens.shape
    for name, sun in suns.items():
        atmosphere = draw_atmosphere(ranges, random)
        texture = Texture.draw(ranges.texture, ranges.rock_texture, random)
        light = rendering.olat_images[model, name] + np.float32(atmosphere.fill) * diffuse
        detail = texture.factors(hits.point, ids_of_hits, scene.view, sun.position)
        light.reshape(-1)[hits.pixel] *= detail
        ids = rendering.ids[name]
        ground = light[(ids >= GROUND) & (ids < ROCK_IDS)]
        bright = max(
            float(np.percentile(ground, _BRIGHT_GROUND)) if ground.size else 0.0,
            _MIN_BRIGHT * float(np.percentile(light, _BRIGHT_GROUND)),  # most of the ground may be in shadow
            1e-9,
        )
        distance = np.full(shape, np.inf, np.float32)
        distance.reshape(-1)[hits.pixel] = np.linalg.norm(hits.point - camera.centre.astype(np.float32), axis=1)
        radiance = add_sky(light / np.float32(bright), distance, atmosphere, random)
        yield _photograph(radiance, ids, scene, stored_px, ranges, random)


def _photograph(
    radiance: np.ndarray,
    ids: np.ndarray,
    scene: FieldScene,
    stored_px: int,
    ranges: FieldRanges,
    random: np.random.Generator,
) -> SceneImage:
    """Return the 8-bit image of radiance (h, w), relative to bright ground, with the labels of visible objects."""
    light = random.uniform(*ranges.exposure) * (WHITE_LEVEL - BLACK_LEVEL)
    curve = tone_curve(random.uniform(*ranges.gamma))
    labels, mask = labels_with_contrast(ids, radiance, light, curve, scene.options, ranges.min_contrast)
    seen = apply_lens(radiance, scene.view.camera.lens, scene.options)
    image = curve[expose(seen, light, scene.options, random)]
    image = compress(image, ranges, random)
    width = min(stored_px, image.shape[1])
    size = width, round(width * REFERENCE_SIZE_PX[1] / REFERENCE_WIDTH_PX)
    return SceneImage(resize(image, size), class_masks.resized(mask, size), labels)


def draw_field_scene(shapes: Sequence[RockShape], ranges: FieldRanges, random: np.random.Generator) -> FieldScene:
    """Return a random scene of rocks with the given shapes."""
    view = draw_view(ranges, random)
    kind = ranges.grounds[random.integers(len(ranges.grounds))]
    heights, ground_albedo = draw_ground(view, kind, ranges, random)
    negative = random.random() < ranges.negative_share
    rocks = [] if negative else scatter_field_rocks(shapes, view, heights, ranges, random)
    gravel = scatter_gravel(view, heights, ranges, random)
    parts = draw_parts(view, random) if random.random() < ranges.parts_share else []
    meshes = [grid_mesh(*view.nodes, heights), gravel, *parts, *rocks]
    numbers = [NO_ROCK] * (2 + len(parts)) + list(range(FIRST_ROCK, FIRST_ROCK + len(rocks)))
    counts = np.array([len(mesh.vertices) for mesh in meshes])
    starts = np.cumsum(counts) - counts
    terrain_mesh = TerrainMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]),
        np.repeat(numbers, [len(mesh.faces) for mesh in meshes]),
    )
    ratio, dust = log_uniform(ranges.albedo_ratio, random), random.uniform(*ranges.dust)
    gravel_albedo = np.repeat(ratio * (1 + 0.3 * random.standard_normal(len(gravel.vertices) // 12)), 12)
    rock_albedo = ratio * np.maximum(0.3, 1 + ranges.rock_spread * random.standard_normal(len(rocks)))
    spotted = random.uniform(*ranges.rock_spots)
    albedo = np.concatenate(
        [
            ground_albedo.ravel(),
            np.clip(gravel_albedo, 0.2, 3),
            *(np.full(len(part.vertices), random.uniform(0.3, 3)) for part in parts),
            *(factor * _spots(rock, spotted, random) for rock, factor in zip(rocks, rock_albedo, strict=True)),
        ]
    )
    of_rocks = slice(int(counts[: 2 + len(parts)].sum()), None)
    dusty = dust * np.clip((terrain_mesh.normals[of_rocks, 2] - 0.3) / 0.4, 0, 1)
    albedo[of_rocks] = (1 - dusty) * albedo[of_rocks] + dusty
    return FieldScene(terrain_mesh, albedo.astype(np.float32), view, _draw_options(ranges, random))


def _spots(rock: Mesh, deviation: float, random: np.random.Generator) -> np.ndarray:
    """Return albedo factors (v,) of the vertices of a rock with minerals, coatings and dust in spots."""
    size = float(np.ptp(rock.vertices, axis=0).max())
    centred = (rock.vertices - rock.vertices.mean(axis=0)) / size
    return np.exp(deviation * rock_noise(centred, _SPOT, random.uniform(0.2, 1.0), random))


def _draw_options(ranges: FieldRanges, random: np.random.Generator) -> RenderOptions:
    model = "hapke" if random.random() < 0.4 else "principled"
    material = Material(
        hapke=HapkeParameters(w=random.uniform(0.15, 0.6), b=0.25, c=random.uniform(-0.2, 0.5), theta_bar_deg=20),
        principled=PrincipledParameters(roughness=random.uniform(0.5, 1.0), specular=random.uniform(0, 0.6)),
    )
    return RenderOptions(
        models=(model,),
        materials={"default": material},
        walls=False,
        skirt_m=0,  # the rocks are closed
        bounce=0,
        ambient=random.uniform(0.005, 0.03),
        blur_px=random.uniform(*ranges.blur_px),
        noise=True,
        electrons_per_dn=random.uniform(*ranges.electrons_per_dn),
        min_rock_area_px=max(1, round(_MIN_ROCK_PX * ranges.scale**2)),
        min_shadow_area_px=max(1, round(_MIN_SHADOW_PX * ranges.scale**2)),
        min_shadow_width_px=max(1, round(_MIN_SHADOW_WIDTH_PX * ranges.scale)),
        min_part_area_px=max(1, round(_MIN_PART_PX * ranges.scale**2)),
    )


def _draw_sun(ranges: FieldRanges, random: np.random.Generator) -> Lamp:
    sun = Lamp.sun(random.uniform(0, 360), random.uniform(*ranges.elevation_deg))
    return Lamp(_LAMP_DISTANCE * sun.position, distant=True)  # a point: penumbrae are thinner than a pixel


def _sky_lamps(random: np.random.Generator) -> dict[str, Lamp]:
    """Return distant lamps in a ring, which shade the ground around rocks as a sky does."""
    first = random.uniform(0, 360)
    elevations = random.uniform(*_SKY_ELEVATION_DEG, _SKY_LAMPS)
    return {
        f"sky{n}": Lamp(_LAMP_DISTANCE * Lamp.sun(first + 360 * n / _SKY_LAMPS, elevation).position, distant=True)
        for n, elevation in enumerate(elevations)
    }
