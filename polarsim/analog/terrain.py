"""Terrain of the analog: scene, ray caster and stations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.analog.ground import make_ground, pile_sand
from polarsim.analog.options import AnalogOptions
from polarsim.analog.placement import place_rocks
from polarsim.analog.presets import PRESETS
from polarsim.analog.rays import RayCaster
from polarsim.analog.sandbox import SandboxScene, build_scene
from polarsim.analog.stations import Stations, make_stations
from polarsim.photo import Terrain
from polarsim.randomness import generator


@dataclass(frozen=True)
class AnalogTerrain:
    """Scene, ray caster, tripod poses and lamps of a terrain."""

    terrain: Terrain
    scene: SandboxScene
    caster: RayCaster
    stations: Stations


def build_terrain(terrain: Terrain, options: AnalogOptions) -> AnalogTerrain:
    """Generate the sand, the rocks, the surrounding box, the tripod poses and the lamps of a terrain."""
    preset, seed = PRESETS[terrain], options.seed
    original = preset.like or terrain
    ground = make_ground(preset, options.ground_step_mm / 1000, generator(seed, "ground", original))
    rocks = place_rocks(preset, ground, generator(seed, "rocks", original), options.rock_detail)
    points = np.array([rock.centre for rock in rocks]).reshape(-1, 3)
    bottom = np.array([rock.vertices[:, 2].min() for rock in rocks])
    in_sand = bottom < ground.height_at(points[:, 0], points[:, 1])  # stacked rocks have no sand around the base
    radii = np.array([rock.radius for rock in rocks])
    ground = pile_sand(ground, generator(seed, "piles", original), points[in_sand, :2], radii[in_sand])
    scene = build_scene(preset, ground, rocks, options.rock_detail, generator(seed, "box", terrain))
    return AnalogTerrain(terrain, scene, scene.caster(), make_stations(terrain, options))
