"""Variants of a terrain: its rocks turned and moved on sand of made-up relief, in materials drawn at random."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import BaseModel, Field

from polarsim.formats.scene import TerrainMesh
from polarsim.photo import NO_ROCK
from polarsim.render.options import HapkeParameters, Material, Model, PrincipledParameters, RenderOptions

from .hall import HallOptions
from .relief import Range, ReliefOptions, draw_relief, grid_mesh, sand_height, smooth_noise, smooth_sand


class VariantOptions(BaseModel, extra="forbid", frozen=True):
    """Ranges, from least to most, that every variant of a terrain is drawn from."""

    number: int = Field(4, ge=1, description="Variants of each view.")
    positions: tuple[str, ...] = Field(("A", "C"), description="Tripod places that are rendered, where they are known.")
    scale: float = Field(0.5, gt=0, le=1, description="Size of the pictures over that of a photo.")
    seed: int = Field(0, ge=0, description="Seed of all that is drawn.")
    models: tuple[Model, ...] = Field(("hapke", "principled"), min_length=1, description="A variant has one of them.")

    relief: ReliefOptions | None = Field(
        ReliefOptions(), description="Relief of the sand; none: as fitted to the rocks."
    )
    moved_share: float = Field(0.5, ge=0, le=1, description="Share of the variants whose rocks are moved and turned.")
    move_within_m: float = Field(1.8, gt=0, description="Rocks are moved to places so near to the middle, each axis.")
    rock_scale: Range = Field((0.7, 1.4), description="Size of a moved rock over its own.")

    rock_albedo: Range = Field((0.7, 2.5), description="Reflectance of a variant's rocks over that of its sand.")
    rock_spread: float = Field(0.15, ge=0, description="Standard deviation of the rocks' albedos among each other.")
    patch_sd: Range = Field((0.0, 0.15), description="Standard deviation of the albedo of patches of sand.")
    rim: bool = Field(True, description="Walls of the sandbox.")
    rim_albedo: Range = Field((0.2, 0.9), description="Albedo of the walls.")
    rim_height_m: Range = Field((0.2, 0.36), description="Height of the walls.")
    hapke_w: Range = Field((0.15, 0.6), description="Single-scattering albedo.")
    hapke_b: Range = Field((0.15, 0.4), description="Width of the phase function's lobes.")
    hapke_c: Range = Field((-0.2, 0.6), description="Weight of the lobes.")
    hapke_theta_deg: Range = Field((10, 35), description="Macroscopic roughness.")
    roughness: Range = Field((0.5, 1.0), description="Of the principled model.")
    specular: Range = Field((0.0, 0.7), description="Of the principled model.")

    lamp_shift_m: float = Field(0.25, ge=0, description="Standard deviation of a lamp's place, each axis.")
    ambient: Range = Field((0.0, 0.03), description="Even light over a lamp's irradiance.")
    hall: HallOptions | None = Field(HallOptions(), description="What is around the sand; none: dark and bare.")
    blur_px: Range = Field((0.0, 1.0), description="Lens blur, pixels of the picture.")
    lens_flare: Range = Field((0.0, 0.003), description="Share of a lamp's light that the lens scatters.")
    noise: bool = Field(True, description="Shot and read noise.")
    electrons_per_grey_value: Range = Field((3, 20), description="The fewer, the noisier.")
    exposure: Range = Field((0.15, 1.0), description="Grey value of bright sand (90th percentile) over white.")
    least_contrast: float = Field(
        0.06,
        ge=0,
        description="Contrast of a rock and its edge, over the light of bright sand, below which it has no label: "
        "people do not draw what they cannot see.",
    )


@dataclass(frozen=True)
class Variant:
    """A scene to render: its mesh, its vertices' albedo factors (v,), and how."""

    mesh: TerrainMesh
    albedo: np.ndarray
    options: RenderOptions


def draw_variant(mesh: TerrainMesh, options: VariantOptions, random: np.random.Generator) -> Variant:
    """One variant of a terrain, labels and all: rocks keep their numbers."""
    model = options.models[int(random.random() * len(options.models))]
    chosen = _draw_options(model, options, random)
    moved = random.random() < options.moved_share
    quadric = smooth_sand(mesh.part(NO_ROCK).vertices)
    ground, relief = mesh.part(NO_ROCK), None
    if options.relief is not None:
        axis = np.arange(-chosen.rim_half_width_m, chosen.rim_half_width_m, options.relief.cell_m)
        x, y = np.meshgrid(axis, axis)
        relief = draw_relief(x, y, options.relief, random)
        ground = grid_mesh(x, y, sand_height(quadric, x, y) + relief)
    vertices, faces, rock_of_face = [ground.vertices], [ground.faces], [np.full(len(ground.faces), NO_ROCK)]
    albedo = [_patches(len(ground.vertices), relief, random.uniform(*options.patch_sd), random)]
    count = len(ground.vertices)
    rocks_albedo = random.uniform(*options.rock_albedo)
    taken: list[np.ndarray] = []
    for rock in mesh.rocks:
        part = mesh.part(rock)
        points = part.vertices
        centre = (points[:, :2].min(axis=0) + points[:, :2].max(axis=0)) / 2
        if moved:
            points, place = _moved(points, centre, quadric, taken, options, random)
        else:
            place = centre
        taken.append(place)
        if relief is not None:
            row, column = (np.abs(axis - value).argmin() for value in (place[1], place[0]))
            points = points + np.array([0, 0, relief[row, column]])
        vertices.append(points)
        faces.append(part.faces + count)
        rock_of_face.append(np.full(len(part.faces), rock))
        own = rocks_albedo * max(0.3, 1 + options.rock_spread * random.standard_normal())
        albedo.append(np.full(len(points), own, np.float32))
        count += len(points)
    changed = TerrainMesh(np.concatenate(vertices), np.concatenate(faces), np.concatenate(rock_of_face))
    return Variant(changed, np.concatenate(albedo).astype(np.float32), chosen)


def _draw_options(model: Model, options: VariantOptions, random: np.random.Generator) -> RenderOptions:
    def draw(limits: Range) -> float:
        return float(random.uniform(*limits))

    return RenderOptions(
        models=(model,),
        hapke=HapkeParameters(
            w=draw(options.hapke_w),
            b=draw(options.hapke_b),
            c=draw(options.hapke_c),
            b_s0=draw((0, 2)),
            h_s=draw((0.03, 0.1)),
            theta_bar_deg=draw(options.hapke_theta_deg),
        ),
        principled=PrincipledParameters(roughness=draw(options.roughness), specular=draw(options.specular)),
        materials={"rocks": Material()},
        rim=options.rim,
        rim_albedo=draw(options.rim_albedo),
        rim_height_m=draw(options.rim_height_m),
        falloff=bool(random.random() < 0.5),
        ambient=draw(options.ambient),
        blur_px=draw(options.blur_px),
        lens_flare=draw(options.lens_flare),
        noise=options.noise,
        electrons_per_grey_value=draw(options.electrons_per_grey_value),
        min_rock_px=max(1, round(60 * options.scale**2)),
        min_shadow_px=max(1, round(120 * options.scale**2)),
        min_shadow_width_px=max(1, round(3 * options.scale)),
        min_part_px=max(1, round(20 * options.scale**2)),
    )


def _moved(
    points: np.ndarray,
    centre: np.ndarray,
    quadric: np.ndarray,
    taken: list[np.ndarray],
    options: VariantOptions,
    random: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) of a rock turned about its upright axis, scaled, put far from others if it can be; its place."""
    places = random.uniform(-options.move_within_m, options.move_within_m, (8, 2))
    free = [min((float(np.hypot(*(place - other))) for other in taken), default=9.0) for place in places]
    place = next((place for place, gap in zip(places, free, strict=True) if gap > 0.25), places[int(np.argmax(free))])
    angle, scale = random.uniform(0, 2 * np.pi), random.uniform(*options.rock_scale)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    above = points[:, 2] - sand_height(quadric, *centre[:, None])
    flat = place + scale * (points[:, :2] - centre) @ turn.T
    return np.column_stack([flat, sand_height(quadric, *place[:, None]) + scale * above]), place


def _patches(count: int, relief: np.ndarray | None, sd: float, random: np.random.Generator) -> np.ndarray:
    """(count,) albedo factors of the sand's vertices."""
    if relief is None:
        return np.ones(count)
    noise = smooth_noise(relief.shape, 10, 10, 0, random) + random.standard_normal(relief.shape)
    return np.clip(1 + sd * noise.ravel(), 0.3, 2)
