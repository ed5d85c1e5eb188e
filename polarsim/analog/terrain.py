"""A terrain as it stands while scans and photos are taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.analog.ground import make_ground, pile_sand
from polarsim.analog.options import AnalogOptions
from polarsim.analog.placement import place_rocks
from polarsim.analog.presets import PRESETS
from polarsim.analog.rays import Caster
from polarsim.analog.sandbox import Scene, build_scene
from polarsim.analog.stations import Stations, make_stations
from polarsim.randomness import generator


@dataclass(frozen=True)
class Terrain:
    """Scene, its ray caster, and where tripods and lamps stood."""

    terrain: int
    scene: Scene
    caster: Caster
    stations: Stations


def build_terrain(terrain: int, options: AnalogOptions) -> Terrain:
    """Shape the sand, lay the rocks, put the box around them, set up tripods and lamps."""
    preset, seed = PRESETS[terrain], options.seed
    own = preset.like or terrain
    ground = make_ground(preset, options.ground_step_mm / 1000, generator(seed, "ground", own))
    rocks = place_rocks(preset, ground, generator(seed, "rocks", own), options.rock_detail)
    points = np.array([rock.centre for rock in rocks]).reshape(-1, 3)
    foot = np.array([rock.vertices[:, 2].min() for rock in rocks])
    standing = foot < ground.height_at(points[:, 0], points[:, 1])  # stones on stones have no sand at their feet
    radii = np.array([rock.radius for rock in rocks])
    ground = pile_sand(ground, generator(seed, "piles", own), points[standing, :2], radii[standing])
    scene = build_scene(preset, ground, rocks, options.rock_detail, generator(seed, "box", terrain))
    return Terrain(terrain, scene, scene.caster(), make_stations(terrain, options))
