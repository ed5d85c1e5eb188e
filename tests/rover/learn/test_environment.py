"""Gymnasium environment: Gymnasium's checks, reproducible episodes, and reward."""

import math
import warnings
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="gymnasium is not installed")
pytest.importorskip("mujoco", reason="mujoco is not installed")

import gymnasium
from gymnasium.utils.env_checker import check_env

from polarsim.errors import ConfigError, RoverError
from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import CameraSuiteOptions
from polarsim.rover.learn.courses import PracticeCourse, WorldCourse
from polarsim.rover.learn.environment import TaskOptions, TraverseEnvironment
from polarsim.rover.learn.observation import AHEAD_M, CELLS, STATE
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.soil.options import SoilOptions
from polarsim.rover.world.practice import PracticeGround, practice_world
from polarsim.rover.world.surface import PlacedRock, with_rocks
from tests.rover.made_world import ball

GROUND = PracticeGround(length_m=7.0, width_m=5.0, cell_m=0.04, rocks=6, smallest_m=0.15)
FIRM = SoilOptions(slip_sinkage=False, step_s=0.002)
COARSE = AutonomyOptions(longest_s=30)
CAMERAS = CameraSuiteOptions(scale=0.2, suns=("1", "3"), models=("hapke",), exposures_ms=(256,))
AHEAD, STAY = np.float32([0.5, 0.0]), np.zeros(2, np.float32)


def made(**options) -> TraverseEnvironment:
    return TraverseEnvironment(
        **{"course": PracticeCourse(GROUND, soil=FIRM), "options": COARSE, "cameras": CAMERAS} | options
    )


def episode(environment, seed: int, steps: int, **lit) -> list:
    """Return observations, rewards and ends of a straight drive, as comparable bytes."""
    observed, _ = environment.reset(seed=seed, options=lit)
    result = [*(values.tobytes() for values in observed.values())]
    for _ in range(steps):
        observed, *rest = environment.step(AHEAD)
        result += [*(values.tobytes() for values in observed.values()), rest]
    return result


@pytest.mark.slow
def test_gymnasiums_checks_pass():
    ground = replace(GROUND, length_m=5.0, width_m=4.0, rocks=1)
    environment = gymnasium.make(
        "polarsim/Traverse-v0", image=True, course=PracticeCourse(ground, soil=FIRM), options=COARSE, cameras=CAMERAS,
        render_mode="rgb_array", mode="blind", disable_env_checker=True,
    )  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(environment.unwrapped)


def test_equal_seeds_give_equal_episodes_and_other_seeds_differ():
    first, again, other = (episode(made(image=True), seed, 2) for seed in (7, 7, 8))
    assert first == again
    assert first != other


def test_the_light_depends_on_the_seed_or_on_the_options():
    environment = made(image=True, mode="blind")
    suns = {environment.reset(seed=seed)[1]["light"]["sun"] for seed in range(3)}
    assert suns == {"1", "3"}
    pictures = [
        environment.reset(seed=1, options=lit)[0]["image"]
        for lit in (
            {"sun": "1"}, {"sun": "3"}, {"sun": "night"},
            {"sun": "night", "lights": ("navlight_left",), "exposure_ms": "auto"},
        )
    ]  # fmt: skip
    assert not np.array_equal(pictures[0], pictures[1])
    assert np.ptp(pictures[2]) == 0
    assert pictures[3].std() > 5


def test_the_options_of_the_renderer_act_on_images_and_on_perception():
    plain, blurred = (made(image=True, mode="stereo", render=RenderOptions(blur_px=blur)) for blur in (0.0, 6.0))
    first, second = (environment.reset(seed=1)[0] for environment in (plain, blurred))
    assert not np.array_equal(first["image"], second["image"])
    assert not np.array_equal(first["hazards"], second["hazards"])


@pytest.mark.parametrize(
    ("lit", "error", "key"),
    [
        ({"moon": 1}, RoverError, "moon"),
        ({"sun": "7"}, RoverError, "sun"),
        ({"exposure_ms": -3}, RoverError, "exposure_ms"),
        ({"sun": "night", "lights": ("torch",)}, ConfigError, "torch"),
    ],
)
def test_an_invalid_light_is_refused_in_one_line(lit, error, key):
    with pytest.raises(error, match=key) as refused:
        made(image=True).reset(seed=0, options=lit)
    assert "\n" not in str(refused.value)


def test_progress_is_rewarded_and_energy_costs():
    weights = TaskOptions(progress_1_m=2.0, energy_1_j=-0.01, collision=0.0)
    environment = made(course=PracticeCourse(replace(GROUND, rocks=0), soil=FIRM), task=weights)
    observed, before = environment.reset(seed=1)
    to_go = [float(observed["state"][list(STATE).index("to_go")])]
    total = 0.0
    for _ in range(30):
        observed, reward, *_, info = environment.step(AHEAD)
        total += reward
        to_go.append(float(observed["state"][list(STATE).index("to_go")]))
    gained = info["along_m"] - before["along_m"]
    assert 0.3 < gained < 0.6
    assert to_go[0] - to_go[-1] == pytest.approx(gained, abs=1e-4)
    assert info["energy_j"] > 10
    assert total == pytest.approx(2 * gained - 0.01 * info["energy_j"], abs=1e-6)
    assert set(info["contacts"].values()) == {"soil"}
    assert all(0 < depth < 0.08 for depth in info["sinkage_m"].values())


def test_rocks_of_a_practice_ground_are_partly_buried():
    world = practice_world(GROUND, 5)
    assert len(world.rocks) == GROUND.rocks
    for row in world.rocks.to_dict("records"):
        corners, _ = world.rock_mesh(row["rock"])
        assert corners[:, 2].min() < world.height_at(row["x_m"], row["y_m"]) < corners[:, 2].max()
    with pytest.raises(RoverError):
        practice_world(replace(GROUND, length_m=2.0), 0)


def wall_ahead() -> WorldCourse:
    """Return a course with two rocks above 10 cm, both in the path of the wheels."""
    rocks = [ball(3.2, y, 0.05, 0.15) for y in (0.6, -0.6)]
    placed = [PlacedRock(0, number, rock.vertices, rock.faces) for number, rock in enumerate(rocks)]
    return WorldCourse(with_rocks(practice_world(replace(GROUND, rocks=0), 3), placed), soil=FIRM)


def test_a_rock_costs_once_on_contact_and_is_observed_before():
    environment = made(course=wall_ahead(), task=TaskOptions(progress_1_m=0, energy_1_j=0))
    observed, _ = environment.reset(seed=0)
    assert observed["hazards"][0, :36].max() > 128  # in front of the rover
    rewards = []
    for _ in range(80):
        *_, reward, terminated, truncated, info = environment.step(AHEAD)
        rewards.append(reward)
        if info["collisions"] >= 2 or terminated or truncated:
            break
    assert info["collisions"] >= 2
    assert sum(rewards) == -5.0 * info["collisions"]
    assert environment.simulation.data.qpos[0] > 3.2  # not before the wheels reach the rocks


def test_an_episode_ends_at_the_goal_off_the_grid_and_when_the_time_is_over():
    short = made(options=COARSE.model_copy(update={"longest_s": 0.3}))
    short.reset(seed=0)
    assert [short.step(STAY)[2:4] for _ in range(3)] == [(False, False), (False, False), (False, True)]
    bare = PracticeCourse(replace(GROUND, length_m=5.0, rocks=0), soil=FIRM)
    for action, ended, reward in ((AHEAD * 2, "finished", None), (-AHEAD * 2, "off the grid", -10.0)):
        environment = made(course=bare)
        environment.reset(seed=0)
        for _ in range(100):
            *_, last, terminated, _, info = environment.step(action)
            if terminated:
                break
        assert info["ended"] == ended
        assert reward is None or last == pytest.approx(reward, abs=0.2)


def test_the_crop_rotates_with_the_rover():
    """A single rock cell of the map appears in the crop relative to the rover, with the heading up."""
    environment = made(mode="blind", course=WorldCourse(practice_world(replace(GROUND, rocks=0), 0), soil=FIRM))
    environment.reset(seed=0)
    grid, state = environment.map, environment.simulation.state()
    ahead, left = 2.0, 1.0
    x = state.position[0] + ahead * math.cos(state.heading) - left * math.sin(state.heading)
    y = state.position[1] + ahead * math.sin(state.heading) + left * math.cos(state.heading)
    grid.log_odds[np.abs(grid.y - y).argmin(), np.abs(grid.x - x).argmin()] = 4.0
    shown = environment.step(STAY)[0]["hazards"][0]
    inside = np.argwhere((shown > 240) & (shown < 255))
    cell = environment.map.cell_m
    assert len(inside) in (1, 2)  # nearest cells: a rotated crop may contain a cell twice
    row, column = inside.mean(axis=0)
    assert AHEAD_M - cell * (row + 0.5) == pytest.approx(ahead, abs=cell)
    assert cell * (CELLS / 2 - 0.5 - column) == pytest.approx(left, abs=cell)


@pytest.mark.slow
def test_an_episode_in_a_new_process_equals_one_in_this_process():
    """The module in the name registers the environment."""
    name = "polarsim.rover.learn.environment:polarsim/Traverse-v0"

    def make():
        return gymnasium.make(name, course=PracticeCourse(GROUND, soil=FIRM), options=COARSE, cameras=CAMERAS)

    expected = episode(made(), 3, 2)
    vector = gymnasium.vector.AsyncVectorEnv([make], context="spawn")
    try:
        observed, _ = vector.reset(seed=[3])
        actual = [values[0].tobytes() for values in observed.values()]
        for _ in range(2):
            observed, rewards, ended, cut, _ = vector.step(AHEAD[None])
            actual += [*(values[0].tobytes() for values in observed.values())]
            actual.append([float(rewards[0]), bool(ended[0]), bool(cut[0])])
    finally:
        vector.close()
    assert actual == [part if isinstance(part, bytes) else part[:3] for part in expected]
