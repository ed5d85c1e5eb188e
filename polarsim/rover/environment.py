"""A drive as a Gymnasium environment: ten times a second a speed and a steering angle, and back comes what happened.

    import gymnasium
    import polarsim.rover.environment  # registers polarsim/Drive-v0
    env = gymnasium.make("polarsim/Drive-v0", image=True)

Pictures set the speed, so they are made only where they are asked for. The same seed and actions are the same episode.
"""

from __future__ import annotations

import math
from pathlib import Path as FilePath
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from polarsim.errors import RoverError
from polarsim.rover.cameras.live_camera import LiveCamera, LiveCameraOptions
from polarsim.rover.drive.control import Command, Driver, Path, SteeringLaw
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import Start, State, require_finite, tilt_of, upside_down
from polarsim.rover.drive.trace import CONTACTS
from polarsim.rover.soil.law import read_soil
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.vehicle.table import WHEELS, read_vehicle
from polarsim.rover.world.practice import PracticeGround, practice_world
from polarsim.rover.world.surface import World, read_world

ACTION_HZ = 10
TOP = (0.4, math.radians(30))  # of the action, either way: m/s and rad
SETTLE_S = 1.0  # at rest before an episode begins
# What `state` holds: metres, radians, seconds, loads as shares of the rover's weight.
STATE = (
    "offset", "sin_heading_error", "cos_heading_error", "to_go", "speed", "yaw_rate", "roll", "pitch",
    "acceleration_x", "acceleration_y", "acceleration_z",
    *(f"{code}_{name}" for name in ("steer", "slip", "sinkage", "load") for code in WHEELS),
)  # fmt: skip


class DriveEnvironment(gymnasium.Env[dict[str, np.ndarray], np.ndarray]):
    """Follow a path over soft ground.

    Action: speed, m/s, and steering angle, rad, to the left. Observation: `state`, see `STATE`, and, where it is asked
    for, `image`, (h, w, 1) grey. Reward: metres gained along the path, less `offset_cost` times metres off it and
    second. An episode ends at the path's end, off the grid, upside down or where the physics breaks, with the last
    state before it, and is cut after `seconds`. `info`: slip, sinkage_m, contacts by wheel, offset_m, along_m,
    energy_j, and `ended`, why.

    Parameters
    ----------
    world : folder of a drive's world, or the world; none: a new practice ground for every episode.
    path_m : points x, y to follow; none: the centre line from the east to the west.
    image : make pictures; `camera` says from where and in what light.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": ACTION_HZ}  # noqa: RUF012

    def __init__(
        self,
        world: World | str | FilePath | None = None,
        *,
        vehicle: str | FilePath = "config/viper.yaml",
        soil: SoilOptions | None = None,
        path_m: list[tuple[float, float]] | None = None,
        practice: PracticeGround | None = None,
        image: bool = False,
        camera: LiveCameraOptions | None = None,
        seconds: float = 60.0,
        offset_cost: float = 0.1,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise RoverError(f"render mode {render_mode!r}, expected 'rgb_array' or none")
        self.render_mode = render_mode
        self.vehicle, self.options = read_vehicle(vehicle), soil or SoilOptions()
        self._soil = read_soil(self.options.table, self.options.soil)
        self._world = read_world(world) if isinstance(world, (str, FilePath)) else world
        self._practice, self._points = practice or PracticeGround(), path_m
        self._camera_options = camera or LiveCameraOptions()
        self._image, self._seconds, self._offset_cost = image, seconds, offset_cost
        self.action_space = spaces.Box(-np.array(TOP, np.float32), np.array(TOP, np.float32), dtype=np.float32)
        self.observation_space: Any = spaces.Dict(self._spaces())
        self._simulation: Simulation | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Put the rover down at the path's start, a little off it, and let it settle."""
        super().reset(seed=seed, options=options)
        own = int(self.np_random.integers(2**31))
        world = practice_world(self._practice, own) if self._world is None else self._world
        path = Path(np.array(self._points if self._points else _centre(world), float))
        heading = float(path.headings[0])
        aside, yaw = self.np_random.uniform(-1, 1, 2) * (0.1, math.radians(5))
        x, y = path.points[0] + aside * np.array([-math.sin(heading), math.cos(heading)])
        start = Start(float(x), float(y), heading + yaw)
        self._simulation = Simulation(world, self.vehicle, self._soil, self.options, start)
        # Only where it is along the path is asked of this driver; it commands nothing.
        self._driver = Driver(path, SteeringLaw(TOP[0], 0.0, 0.0, TOP[1]))
        self._camera = LiveCamera(world, self.vehicle, path, self._camera_options, own) if self._sees else None
        self._simulation.advance(SETTLE_S)
        self._simulation.zero()
        self._keep(self._simulation.state())
        return self._observed(self._state), self._info(self._state)

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Drive on for a tenth of a second.

        Raises
        ------
        RoverError
            An action that is not finite, or no episode has begun.
        """
        if self._simulation is None:
            raise RoverError("step before reset")
        require_finite(action)
        speed, steer = np.clip(action, self.action_space.low, self.action_space.high)  # type: ignore[attr-defined]
        self._simulation.apply(Command(float(speed), float(steer)))
        before, ended = self._driver.done, ""
        try:
            self._simulation.advance(1 / ACTION_HZ)
        except RoverError as error:  # off the grid, or the physics is broken: the last state remains
            ended = str(error)
        else:
            self._keep(self._simulation.state())
        state = self._state
        if not ended and self._driver.finished:
            ended = "finished"
        if not ended and upside_down(state.rotation):
            ended = "upside down"
        reward = self._driver.done - before - self._offset_cost * abs(self._driver.offset) / ACTION_HZ
        late = self._simulation.time >= self._seconds - 1e-9
        return (
            self._observed(state),
            float(reward),
            bool(ended),
            late and not ended,
            {**self._info(state), "ended": ended},
        )

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """The camera's picture, (h, w, 3) grey."""
        if self.render_mode is None or self._simulation is None:
            return None
        return np.repeat(self._picture(self._state), 3, axis=2)

    @property
    def _sees(self) -> bool:
        return self._image or self.render_mode is not None

    def _spaces(self) -> dict[str, spaces.Space[Any]]:
        found: dict[str, spaces.Space[Any]] = {"state": spaces.Box(-np.inf, np.inf, (len(STATE),), np.float32)}
        if self._image:
            width, height = self._camera_options.size(self.vehicle)
            found["image"] = spaces.Box(0, 255, (height, width, 1), np.uint8)
        return found

    def _keep(self, state: State) -> None:
        """Keep the state and energy of an instant, and find its place along the path."""
        assert self._simulation is not None
        self._state, self._energy = state, self._simulation.account.motor
        self._driver.command(float(state.position[0]), float(state.position[1]), state.heading)

    def _observed(self, state: State) -> dict[str, np.ndarray]:
        driver, (roll, pitch) = self._driver, tilt_of(state.rotation)
        heading = state.heading
        forward = state.velocity[0] * math.cos(heading) + state.velocity[1] * math.sin(heading)
        weight = self.vehicle.mass * self.options.gravity_m_s2
        error = driver.heading_error
        values = [
            driver.offset, math.sin(error), math.cos(error), driver.path.length - driver.done, forward, state.spin[2],
            roll, pitch, *state.acceleration, *state.wheel("steer_rad"), *state.wheel("slip"),
            *state.wheel("sinkage_m"), *(state.wheel("load_n") / weight),
        ]  # fmt: skip
        found = {"state": np.array(values, np.float32)}
        if self._image:
            found["image"] = self._picture(state)
        return found

    def _picture(self, state: State) -> np.ndarray:
        assert self._camera is not None
        assert self._simulation is not None
        return self._camera.picture(state, self._simulation.ground.level)

    def _info(self, state: State) -> dict[str, Any]:
        return {
            "slip": dict(zip(WHEELS, map(float, state.wheel("slip")), strict=True)),
            "sinkage_m": dict(zip(WHEELS, map(float, state.wheel("sinkage_m")), strict=True)),
            "contacts": {code: CONTACTS[int(kind)] for code, kind in zip(WHEELS, state.wheel("contact"), strict=True)},
            "offset_m": self._driver.offset,
            "along_m": self._driver.done,
            "energy_j": self._energy,
            "ended": "",
        }


def _centre(world: World) -> list[tuple[float, float]]:
    """Along the centre of a world from the east to the west, clear of its rim."""
    y = float(world.y.mean())
    margin = min(2.0, 0.25 * float(np.ptp(world.x)))
    return [(float(world.x[-1]) - margin, y), (float(world.x[0]) + margin, y)]


gymnasium.register(id="polarsim/Drive-v0", entry_point="polarsim.rover.environment:DriveEnvironment")
