"""Placement of rocks in the sand by preset: some half buried, some touching, some stacked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from polarsim.analog.ground import CRATER_CENTRE, PRESET_HALF_WIDTH, HeightField, area_share, crater_scale
from polarsim.analog.presets import Preset
from polarsim.analog.rays import RayCaster
from polarsim.analog.rocks import SimulatedRock, carve, icosphere
from polarsim.geometry.meshes import Mesh, join_meshes
from polarsim.site_parts import Sandbox

_PROBES = 642  # vertices of a rock that are tested against neighbours: a sphere of three subdivisions
_X_RANGE, _Y_RANGE = (-1.6, 1.6), (-1.75, 1.6)  # range of rock centres in NASA's scenes, metres
_PILE = np.array([-0.1, 0.0])
_TRIES = 300


@dataclass(frozen=True)
class _Room:
    """Part of the sand in which the centres of rocks are placed."""

    scale: np.ndarray  # (2,) size of the sand along x and y relative to that of the presets
    low: np.ndarray  # (2,) metres
    high: np.ndarray
    crater: float  # size of the crater relative to that of the presets
    raised: bool

    @classmethod
    def of(cls, sandbox: Sandbox) -> _Room:
        half = np.array(sandbox.half_width_m)
        scale = half / PRESET_HALF_WIDTH
        low, high = (scale * [_X_RANGE[end], _Y_RANGE[end]] for end in (0, 1))
        if sandbox.raised:
            low, high = -0.7 * half, 0.7 * half
        return cls(scale, low, high, crater_scale(sandbox.half_width_m), sandbox.raised)


def place_rocks(
    preset: Preset, sandbox: Sandbox, ground: HeightField, rng: np.random.Generator, detail: int
) -> list[SimulatedRock]:
    """Return the rocks of a preset on a ground, numbered from 1 in order of increasing x.

    The number of rocks grows with the area of the sand, but not in a raised box.
    """
    room = _Room.of(sandbox)
    if preset.rocks and not sandbox.raised:
        preset = replace(preset, rocks=max(preset.stacked + 1, round(preset.rocks * area_share(sandbox.half_width_m))))
    sizes = _sizes(preset, rng)
    shapes = [carve(rng, number, size, detail) for number, size in enumerate(sizes)]
    placed: list[SimulatedRock] = []
    supports = 3 if preset.layout == "pile" else 0
    leaning = rng.random(len(shapes)) < preset.touching
    for number, shape in enumerate(shapes[: len(shapes) - preset.stacked]):
        rock = None
        if placed and (number < supports or leaning[number]):
            parent = placed[-1] if number < supports else placed[int(rng.integers(len(placed)))]
            rock = _lean(shape, parent, placed, ground, rng, preset, room)
        if rock is None:
            rock = _stand_alone(shape, placed, ground, rng, preset, room, in_pile=number < supports)
        placed.append(rock)
    bases = list(placed[: max(supports, 2)])
    for shape in shapes[len(shapes) - preset.stacked :]:
        placed.append(_stack(shape, bases, placed, rng))
    if preset.giant:
        placed = _with_giant(preset, room, placed, ground, rng, detail)
    order = np.argsort([rock.centre[0] for rock in placed], kind="stable")
    if preset.giant:  # all other rocks have the same numbers as in the terrain without the giant
        order = np.append(order[order != len(placed) - 1], len(placed) - 1)
    return [replace(placed[index], rock=number) for number, index in enumerate(order, 1)]


def _sizes(preset: Preset, rng: np.random.Generator) -> np.ndarray:
    """Return the longest sides: log-uniform on both sides of the median, stratified, descending; stacked rocks last."""
    if not preset.rocks:
        return np.zeros(0)
    small, median, large = np.log(preset.sizes)
    quantile = (np.arange(preset.rocks) + rng.random(preset.rocks)) / preset.rocks
    log_size = np.interp(quantile, [0, 0.5, 1], [small, median, large])
    sizes = np.exp(log_size)[::-1]
    if preset.layout == "pile" and preset.stacked:  # the pile consists of the largest rocks
        top = 3 + np.arange(preset.stacked)
        sizes[:3] = preset.sizes[2] * rng.uniform(0.85, 1.0, 3)
        sizes[top] = preset.sizes[2] * rng.uniform(0.6, 0.85, preset.stacked)
    else:
        top = len(sizes) // 2 + np.arange(preset.stacked)
    return np.concatenate([np.delete(sizes, top), sizes[top]])


def _candidate(
    rock: SimulatedRock, rng: np.random.Generator, preset: Preset, room: _Room, *, in_pile: bool
) -> np.ndarray:
    """Return a random position (2,) for the layout of the preset."""
    if room.raised:
        return rng.uniform(-0.6, 0.6, 2) * room.scale * PRESET_HALF_WIDTH
    spot = np.array([rng.uniform(*ends) for ends in zip(room.low, room.high, strict=True)])
    large = rock.radius > 0.08
    if in_pile:
        return _PILE * room.scale + rng.normal(0, 0.05, 2)
    if preset.layout == "cluster" and large:
        return room.scale * [-0.8, 0.8] + rng.normal(0, 0.35, 2)
    if preset.layout == "sides":
        y = rng.uniform(-1.6, 0.2) if large else rng.uniform(0.2, 1.6)
        return np.array([spot[0], room.scale[1] * y])
    if preset.layout == "in_crater" and large:
        return room.crater * CRATER_CENTRE + rng.normal(0, 0.6 * room.crater, 2)
    if preset.layout == "diagonal":
        along = np.array([-1.2, -1.3]) + rng.random() * np.array([2.3, 2.5])
        return room.scale * along + rng.normal(0, 0.3, 2)
    return spot


def _fits(
    spot: np.ndarray, radius: float, placed: Sequence[SimulatedRock], preset: Preset, room: _Room, gap: float
) -> bool:
    inside = bool(np.all(room.low <= spot) and np.all(spot <= room.high))
    if preset.layout == "around" and np.linalg.norm(spot - room.crater * CRATER_CENTRE) < 1.25 * room.crater:
        return False
    return inside and all(np.linalg.norm(spot - r.centre[:2]) > radius + r.radius + gap for r in placed)


def _stand_alone(
    shape: SimulatedRock,
    placed: Sequence[SimulatedRock],
    ground: HeightField,
    rng: np.random.Generator,
    preset: Preset,
    room: _Room,
    *,
    in_pile: bool,
) -> SimulatedRock:
    gap = 0.05
    for attempt in range(4 * _TRIES):
        spot = _candidate(shape, rng, preset, room, in_pile=in_pile)
        if in_pile or _fits(spot, shape.radius, placed, preset, room, gap):
            break
        if attempt % _TRIES == _TRIES - 1:
            gap /= 4  # crowded scene: reduce the gap
    return _set_down(shape, spot, ground, rng)


def _set_down(shape: SimulatedRock, spot: np.ndarray, ground: HeightField, rng: np.random.Generator) -> SimulatedRock:
    """Place a rock on the ground at a point with the base in the sand; 30 % of the rocks are about half buried."""
    extent = np.ptp(shape.vertices, axis=0)
    share = rng.uniform(0.35, 0.55) if rng.random() < 0.3 else rng.uniform(0.08, 0.2)
    low = shape.vertices[shape.vertices[:, 2] < shape.vertices[:, 2].min() + 0.3 * extent[2], :2] + spot
    level = np.median(ground.height_at(low[:, 0], low[:, 1]))
    bottom = level - max(share * extent[2], 0.012)
    return shape.moved(np.array([*spot, bottom - shape.vertices[:, 2].min()]))


def _surfaces(rocks: Sequence[SimulatedRock]) -> RayCaster:
    whole = join_meshes([Mesh(rock.vertices, icosphere(rock.detail)[1]) for rock in rocks])
    return RayCaster(whole.vertices, whole.faces)


def _gap(rock: SimulatedRock, surfaces: RayCaster) -> float:
    """Return the minimum distance of the probes of a rock from surfaces, metres; negative if they overlap."""
    return float(surfaces.signed_distance(rock.vertices[:_PROBES]).min())


def _lean(
    shape: SimulatedRock,
    parent: SimulatedRock,
    placed: Sequence[SimulatedRock],
    ground: HeightField,
    rng: np.random.Generator,
    preset: Preset,
    room: _Room,
) -> SimulatedRock | None:
    """Place a rock next to a parent so that both touch; None if there is no room."""
    against, others = _surfaces([parent]), [rock for rock in placed if rock is not parent]
    for _ in range(12):
        angle = rng.uniform(0, 2 * np.pi)
        towards = np.array([np.cos(angle), np.sin(angle)])
        here = np.random.default_rng(int(rng.integers(1 << 32)))
        burial = here.bit_generator.state
        distance, near, far = 0.0, 0.0, 2 * (shape.radius + parent.radius)
        for _ in range(14):
            distance = (near + far) / 2
            here.bit_generator.state = burial  # the same depth at every step
            rock = _set_down(shape, parent.centre[:2] + distance * towards, ground, here)
            near, far = (distance, far) if _gap(rock, against) < 0 else (near, distance)
        spot = rock.centre[:2]
        if not _fits(spot, 0.0, [], preset, room, 0):
            continue
        close = [r for r in others if np.linalg.norm(r.centre[:2] - spot) < r.radius + rock.radius + 0.15]
        if not close or _gap(rock, _surfaces(close)) > 0.002:
            return rock
    return None


def _stack(
    shape: SimulatedRock, bases: Sequence[SimulatedRock], placed: Sequence[SimulatedRock], rng: np.random.Generator
) -> SimulatedRock:
    """Drop a rock from above between the bases until it touches a rock."""
    below = _surfaces(placed)
    spot = np.mean([rock.centre[:2] for rock in bases], axis=0) + rng.normal(0, 0.02, 2)
    if len(bases) == 2:
        spot = bases[0].centre[:2] + rng.normal(0, 0.02, 2)
    top = max(rock.vertices[:, 2].max() for rock in placed)
    low, high = float(bases[0].centre[2]), float(top + np.ptp(shape.vertices[:, 2]))
    for _ in range(16):
        height = (low + high) / 2
        rock = shape.moved(np.array([*spot, height]))
        low, high = (height, high) if _gap(rock, below) < 0 else (low, height)
    return rock.moved(np.array([0, 0, -0.003]))  # overlap of 3 mm, so that the rocks touch


def _with_giant(
    preset: Preset, room: _Room, placed: list[SimulatedRock], ground: HeightField, rng: np.random.Generator, detail: int
) -> list[SimulatedRock]:
    """Add a very large bright rock at the front, at the position with the most room."""
    giant = replace(carve(rng, 0, preset.giant, detail), albedo=0.55, patch=0.3)
    tries = room.scale * np.stack([rng.uniform(0.7, 1.4, 200), rng.uniform(-1.3, 1.3, 200)], 1)
    free = [min(np.linalg.norm(t - r.centre[:2]) - r.radius for r in placed) for t in tries]
    return [*placed, _set_down(giant, tries[int(np.argmax(free))], ground, rng)]
