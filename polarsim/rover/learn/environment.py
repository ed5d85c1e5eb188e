"""Gymnasium environment of the rover's task: speed and steering angle ten times per second.

    import gymnasium
    import polarsim.rover.learn.environment  # registers polarsim/Traverse-v0
    env = gymnasium.make("polarsim/Traverse-v0")

Perception and map are those of autonomous drives (`polarsim.rover.planning`); the learner steers. Equal seeds, options
and actions give equal episodes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from polarsim.detect.tone import to_8_bits
from polarsim.errors import RoverError
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import NIGHT, SUN_AZIMUTHS_DEG, CameraSuiteOptions, ImagingCondition
from polarsim.rover.cameras.rover_camera import RoverCamera, near_path
from polarsim.rover.drive.control import Command
from polarsim.rover.drive.energy import EnergyError
from polarsim.rover.drive.simulation import Simulation
from polarsim.rover.drive.state import OffGridError, RoverState
from polarsim.rover.drive.trace import CONTACTS
from polarsim.rover.learn.courses import Course, PracticeCourse
from polarsim.rover.learn.observation import CELLS, STATE, crop, observation_values
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.perception.observation import Perception
from polarsim.rover.perception.options import Mode, OnboardDetector
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.planning.pilot import OBSERVATIONS_HZ
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.mounts import mount_of
from polarsim.rover.vehicle.table import WHEELS
from polarsim.run_files.picture_sets import AUTO
from polarsim.schemas.rover import HIGH_M

ACTION_HZ = 10
TOP_SPEED_M_S, TOP_STEER_DEG = 0.4, 30.0  # speed and steering angle to the left of actions of 1
SETTLE_S = 1.0  # time at rest before an episode, in which the rover settles
ARRIVED_M = 0.3  # distance before the goal's line, as in autonomous drives
LIGHT = ("sun", "exposure_ms", "lights")  # keys of the options of a reset
_PICTURE_SCALE = 1 / 16
_BESIDE_M = 1.5  # distance from the line; ground farther away is rendered without changes
# A quarter of the camera's size; observations cost half as much as at 0.5.
CAMERAS = CameraSuiteOptions(scale=0.25, models=("hapke",), exposures_ms=(256.0,))


@dataclass(frozen=True)
class TaskOptions:
    """Weights of the terms of a step's reward."""

    progress_1_m: float = 1.0  # per metre of progress along the line to the goal
    collision: float = -5.0  # for a new contact with a rock above 10 cm
    energy_1_j: float = -0.001  # per joule of motor work
    failure: float = -10.0  # for leaving the grid, turning upside down or a failure of the physics


class Collisions:
    """Rocks above `HIGH_M` that the rover touches, by the contacts of the physics."""

    def __init__(self, simulation: Simulation) -> None:
        rocks = simulation.world.rocks
        self._simulation, self._steps = simulation, simulation.steps
        self._high = frozenset(rocks["rock"][rocks["height_m"] > HIGH_M].tolist())
        self.touched: frozenset[int] = frozenset()

    def update(self) -> frozenset[int]:
        """Return the numbers of the rocks touched since the last call and not before the last call."""
        touched = self._simulation.rocks_touched_since(self._steps) & self._high
        self._steps = self._simulation.steps
        new, self.touched = touched - self.touched, touched
        return new


class TraverseEnvironment(gymnasium.Env[dict[str, np.ndarray], np.ndarray]):
    """Drive along a straight line from the start to the goal, around the rocks.

    Action, (2,) within -1 and 1: speed divided by `TOP_SPEED_M_S`, steering to the left divided by
    `TOP_STEER_DEG`. Observation: `hazards` and `state`, see `observation`; optionally `image`, (h, w, 1) grey.
    Reward: `TaskOptions`. An episode terminates at the goal's line, off the grid, upside down or if the physics fails,
    with the last valid state, and is truncated after `options.longest_s`. `info`: `ended` (reason), `along_m`,
    `energy_j`, `collisions` so far, `light`, and by wheel `slip`, `sinkage_m`, `contacts` (kind of contact).

    `reset(options=...)` accepts `sun`, `exposure_ms` and `lights`, named as in the configuration. By default the seed
    selects from `cameras.suns` and `cameras.exposures_ms`, and the lights are `cameras.lights`.

    Parameters
    ----------
    course : course of the episodes; None: a random ground for each seed.
    mode : source of the map; `blind` has an empty map.
    options : `longest_s`, the maximum duration of an episode.
    cameras : Suns, exposures, lights and scale of the pictures, and the detector, `onboard`, of modes with a detector.
    render : lens, sensor and reflectance of all pictures, as the section `render` of a run.
    image : add the picture of the front camera to each observation.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": ACTION_HZ}  # noqa: RUF012

    def __init__(
        self,
        course: Course | None = None,
        *,
        mode: Mode = "truth",
        options: AutonomyOptions | None = None,
        cameras: CameraSuiteOptions | None = None,
        render: RenderOptions | None = None,
        task: TaskOptions | None = None,
        image: bool = False,
        render_mode: str | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise RoverError(f"render mode {render_mode!r}, expected 'rgb_array' or none")
        self.render_mode, self.course, self.mode = render_mode, course or PracticeCourse(), mode
        self.options = options or AutonomyOptions(longest_s=120.0)
        self.cameras, self.render_options = cameras or CAMERAS, render or RenderOptions()
        self.task, self._image = task or TaskOptions(), image
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        bounds = np.array(list(STATE.values()), np.float32)
        observed: dict[str, spaces.Space[Any]] = {
            "hazards": spaces.Box(0, 255, (3, CELLS, CELLS), np.uint8),
            "state": spaces.Box(-bounds, bounds, dtype=np.float32),
        }
        if image:
            height, width = mount_of(self.course.vehicle.camera(FRONT), _PICTURE_SCALE).lens.shape
            observed["image"] = spaces.Box(0, 255, (height, width, 1), np.uint8)
        self.observation_space: Any = spaces.Dict(observed)
        self._camera: RoverCamera | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Place the rover near the line's first point, let it settle, and observe once."""
        super().reset(seed=seed, options=options)
        episode_seed = int(self.np_random.integers(2**31))
        self.light = self._lit(options or {})
        job = self.course.job(episode_seed)
        self.line, self.vehicle = job.route, job.vehicle
        self.simulation = Simulation(job.world, job.vehicle, job.soil, job.soil_options, job.start)
        self.map = HazardGrid(job.world)
        self._perception = None
        if self.mode != "blind":
            weights = self.cameras.onboard.weights_file
            self._perception = Perception(
                job.world, job.vehicle, self.line, self.mode, self.light, self.cameras, episode_seed,
                render=self.render_options, detector=OnboardDetector(weights=weights) if weights else None,
            )  # fmt: skip
        self._collisions, self._hits = Collisions(self.simulation), 0
        self._seed = episode_seed
        if self._image or self.render_mode:
            near = near_path(job.world, self.line, _BESIDE_M)
            self._camera = RoverCamera(
                job.world, job.vehicle, near, self.cameras, self.render_options, models=(self.light.model,)
            )
        self.simulation.advance(SETTLE_S)
        self.simulation.zero()
        self._next_observation = self._observed_at = 0.0
        state = self._state = self.simulation.state()
        self._energy = self.simulation.account.motor
        self._collisions.update()
        self._observe(state)
        return self._observation(state), self._info(state)

    def step(self, action: np.ndarray) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Drive for a tenth of a second; an action that is not finite is an error."""
        if not np.isfinite(action).all():
            raise RoverError(f"action {np.asarray(action).tolist()}: expected finite numbers")
        simulation, weights = self.simulation, self.task
        before, spent = self._state, self._energy
        speed, steer = np.clip(np.asarray(action, float), -1.0, 1.0).tolist()
        simulation.apply(Command(speed * TOP_SPEED_M_S, steer * math.radians(TOP_STEER_DEG)))
        ended = ""
        try:
            simulation.advance(1 / ACTION_HZ)
        except OffGridError:
            ended = "off the grid"
        except EnergyError:
            ended = "energy"
        else:  # after a failure the last state and energy are kept, since those of the failed step may be NaN
            self._state, self._energy = simulation.state(), simulation.account.motor
        state, unknown = self._state, bool(ended)
        if not ended and state.upside_down:
            ended = "upside down"
        failed = bool(ended)
        new = () if failed else self._collisions.update()
        self._hits += len(new)
        if not failed and self._along(state) >= self.line.length - ARRIVED_M:
            ended = "finished"
        if not ended:
            self._observe(state)
        reward = weights.failure * failed
        if not unknown:
            reward += (
                weights.progress_1_m * (self._along(state) - self._along(before))
                + weights.collision * len(new)
                + weights.energy_1_j * (self._energy - spent)
            )
        late = simulation.time >= self.options.longest_s - 1e-9
        truncated = late and not ended
        info = {**self._info(state), "ended": ended or ("out of time" if truncated else "")}
        return self._observation(state), float(reward), bool(ended), truncated, info

    def render(self) -> np.ndarray | None:  # type: ignore[override]
        """Return the picture of the front camera, (h, w, 3) grey."""
        if self.render_mode is None or self._camera is None:
            return None
        return np.repeat(self._picture(self._state), 3, axis=2)

    def _lit(self, given: dict[str, Any]) -> ImagingCondition:
        """Return the light of an episode: a Sun, an exposure and lights; missing values are drawn at random."""
        unknown = set(given) - set(LIGHT)
        if unknown:
            raise RoverError(f"reset option {min(unknown)!r}, expected {', '.join(LIGHT)}")
        cameras, suns = self.cameras, (*SUN_AZIMUTHS_DEG, NIGHT)
        drawn = {
            name: values[int(self.np_random.integers(len(values)))]
            for name, values in (("sun", cameras.suns), ("exposure_ms", cameras.exposures_ms))
        }
        chosen = {"lights": cameras.lights, **drawn, **given}
        sun, exposure_ms = chosen["sun"], chosen["exposure_ms"]
        if sun not in suns:
            raise RoverError(f"reset option sun: {sun!r}, expected {', '.join(suns)}")
        if exposure_ms != AUTO and not (isinstance(exposure_ms, int | float) and exposure_ms > 0):
            raise RoverError(f"reset option exposure_ms: {exposure_ms!r}, expected a number above 0 or {AUTO!r}")
        return ImagingCondition(sun, exposure_ms, tuple(chosen["lights"]), cameras.models[0])

    def _observe(self, state: RoverState) -> None:
        """Update the map if an observation is due."""
        now = self.simulation.time
        if now < self._next_observation - 1e-9:
            return
        self._next_observation += 1 / OBSERVATIONS_HZ
        self._observed_at = now
        self.map.fade(now)
        if self._perception is None:
            return
        for update in self._perception.observe(state, self.simulation.ground.level, self.map).updates:
            self.map.add(update)

    def _along(self, state: RoverState) -> float:
        return self.line.along_and_offset(float(state.position[0]), float(state.position[1]), 0)[0]

    def _observation(self, state: RoverState) -> dict[str, np.ndarray]:
        observation = {
            "hazards": crop(self.map, state),
            "state": observation_values(state, self.line, self.simulation.time - self._observed_at),
        }
        if self._image:
            observation["image"] = self._picture(state)
        return observation

    def _picture(self, state: RoverState) -> np.ndarray:
        """Return the picture of the front camera as (h, w, 1) uint8, with the cells of the world."""
        assert self._camera is not None
        base = self._camera.show_state(state, self.simulation.ground.level)
        view = mount_of(self.vehicle.camera(FRONT), _PICTURE_SCALE).at(base)
        grey, _ = self._camera.picture(view, self.light, "live", self._seed, FRONT, state.time)
        return to_8_bits(grey)[..., None]

    def _info(self, state: RoverState) -> dict[str, Any]:
        return {
            "along_m": self._along(state),
            "energy_j": self._energy,
            "collisions": self._hits,
            "light": {"sun": self.light.sun, "exposure_ms": self.light.exposure_ms},
            "slip": dict(zip(WHEELS, state.wheel("slip").tolist(), strict=True)),
            "sinkage_m": dict(zip(WHEELS, state.wheel("sinkage_m").tolist(), strict=True)),
            "contacts": {code: CONTACTS[int(kind)] for code, kind in zip(WHEELS, state.wheel("contact"), strict=True)},
            "ended": "",
        }


gymnasium.register(id="polarsim/Traverse-v0", entry_point="polarsim.rover.learn.environment:TraverseEnvironment")
