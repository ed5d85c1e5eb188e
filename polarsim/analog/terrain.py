"""Terrain of the analog: scene, ray casters and stations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.analog.ground import make_ground, pile_sand
from polarsim.analog.options import AnalogOptions
from polarsim.analog.placement import place_rocks
from polarsim.analog.presets import preset_of
from polarsim.analog.rays import RayCaster
from polarsim.analog.sandbox import Hall, SandboxScene, build_scene
from polarsim.analog.stations import Stations, make_stations
from polarsim.photo import Terrain
from polarsim.randomness import generator
from polarsim.site import Site


@dataclass(frozen=True)
class AnalogTerrain:
    """Scene, ray casters, tripod poses and lamps of a terrain."""

    terrain: Terrain
    scene: SandboxScene
    caster: RayCaster  # of all triangles
    rock_caster: RayCaster | None  # of the rocks only; None without rocks
    stations: Stations


def build_terrain(site: Site, terrain: Terrain, options: AnalogOptions, threads: int = 1) -> AnalogTerrain:
    """Generate the sand, the rocks, the surrounding box, the tripod poses and the lamps of a terrain.

    `threads`: number of threads of the ray casters.
    """
    (preset, original), seed, sandbox = preset_of(site, terrain), options.seed, site.sandbox_of(terrain)
    step = options.ground_step_mm / 1000
    ground = make_ground(preset, sandbox.half_width_m, step, generator(seed, "ground", original))
    rocks = place_rocks(preset, sandbox, ground, generator(seed, "rocks", original), options.rock_detail)
    points = np.array([rock.centre for rock in rocks]).reshape(-1, 3)
    bottom = np.array([rock.vertices[:, 2].min() for rock in rocks])
    in_sand = bottom < ground.height_at(points[:, 0], points[:, 1])  # stacked rocks have no sand around the base
    radii = np.array([rock.radius for rock in rocks])
    ground = pile_sand(ground, generator(seed, "piles", original), points[in_sand, :2], radii[in_sand])
    rng = generator(seed, "box", terrain)
    scene = build_scene(sandbox, Hall.of(site), ground, rocks, options.rock_detail, rng)
    of_rocks = scene.rock_caster(threads) if scene.rocks else None
    return AnalogTerrain(terrain, scene, scene.caster(threads), of_rocks, make_stations(site, terrain, options))
