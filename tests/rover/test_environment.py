"""The rover as an environment: Gymnasium's own checks, and the same episode from the same seed."""

import warnings

import numpy as np
import pytest

from polarsim.errors import RoverError
from polarsim.rover.drive.trace import CONTACTS

gymnasium = pytest.importorskip("gymnasium", reason="gymnasium is not installed")
pytest.importorskip("mujoco", reason="mujoco is not installed")

from polarsim.rover.cameras.live_camera import LiveCameraOptions  # noqa: E402
from polarsim.rover.environment import STATE, DriveEnvironment  # noqa: E402
from polarsim.rover.soil.options import SoilOptions  # noqa: E402
from polarsim.rover.world.practice import PracticeGround, practice_world  # noqa: E402

SMALL = PracticeGround(length_m=5.0, width_m=3.0, cell_m=0.04, rocks=3, largest_m=0.1)
AHEAD = np.float32([0.2, 0.0])


FIRM = SoilOptions(slip_sinkage=False)  # starts do not dig, so that speeds and depths can be foreseen


def made(**options) -> DriveEnvironment:
    return DriveEnvironment(practice=SMALL, soil=FIRM, **options)


def episode(environment, seed: int, steps: int) -> tuple[np.ndarray, list[float]]:
    """States and rewards of a drive straight ahead."""
    states, rewards = [environment.reset(seed=seed)[0]["state"]], []
    for _ in range(steps):
        observed, reward, *_ = environment.step(AHEAD)
        states.append(observed["state"])
        rewards.append(reward)
    return np.array(states), rewards


@pytest.mark.parametrize("image", [False, True])
def test_gymnasium_finds_nothing_to_complain_about(image):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # bounds of a state that has none
        check_env(made(image=image, camera=LiveCameraOptions(scale=1 / 32)), skip_render_check=True)


def test_it_is_made_by_its_name():
    environment = gymnasium.make("polarsim/Drive-v0", practice=SMALL, disable_env_checker=True)
    assert isinstance(environment.unwrapped, DriveEnvironment)


def test_the_same_seed_is_the_same_episode_and_another_is_another():
    states, rewards = episode(made(), 7, 5)
    again, rewards_again = episode(made(), 7, 5)
    assert states.tobytes() == again.tobytes()
    assert rewards == rewards_again
    assert (episode(made(), 8, 5)[0] != states).any()


def test_driving_ahead_gains_what_the_reward_says():
    environment = made(offset_cost=0.0)
    states, rewards = episode(environment, 1, 20)
    to_go = states[:, STATE.index("to_go")]
    assert sum(rewards) == pytest.approx(to_go[0] - to_go[-1], abs=1e-5)
    assert 0.15 < sum(rewards) < 0.25  # 0.1 m/s2 up to 0.2 m/s takes two seconds and 0.2 m


def test_wheels_carry_the_rover_and_sink():
    environment = made()
    states, _ = episode(environment, 2, 10)
    loads = states[-1][[STATE.index(f"{code}_load") for code in ("lf", "rf", "lr", "rr")]]
    assert loads.sum() == pytest.approx(1.0, abs=0.15)
    info = environment.step(AHEAD)[4]
    assert set(info["contacts"]) == {"lf", "rf", "lr", "rr"}
    assert set(info["contacts"].values()) <= set(CONTACTS)
    assert all(0 < depth < 0.08 for code, depth in info["sinkage_m"].items() if info["contacts"][code] == "soil")


def test_an_episode_is_cut_when_its_time_is_over():
    environment = made(seconds=0.3)
    environment.reset(seed=0)
    assert [environment.step(AHEAD)[3] for _ in range(3)] == [False, False, True]


def test_an_episode_ends_at_the_end_of_the_path():
    environment = made(path_m=[(3.0, 0.0), (2.9, 0.0)])
    environment.reset(seed=0)
    for _ in range(20):
        *_, ended, _, info = environment.step(AHEAD)
        if ended:
            break
    assert ended
    assert info["ended"] == "finished"


def test_pictures_show_the_ground_under_the_sun():
    observed, _ = made(image=True).reset(seed=3)
    picture = observed["image"]
    assert picture.shape == (76, 121, 1)
    assert picture.std() > 5
    assert not np.array_equal(picture, made(image=True).reset(seed=4)[0]["image"])


def test_a_practice_ground_has_its_rocks_above_and_below_the_ground():
    world = practice_world(SMALL, 5)
    assert len(world.rocks) == 3
    for row in world.rocks.to_dict("records"):
        corners, _ = world.rock_mesh(row["rock"])
        assert corners[:, 2].min() < world.height_at(row["x_m"], row["y_m"]) < corners[:, 2].max()


def test_a_practice_ground_without_room_is_refused():
    with pytest.raises(RoverError, match="the rover needs 3 x 3 m"):
        practice_world(PracticeGround(length_m=2.0), 0)


def test_a_step_before_a_reset_is_refused():
    with pytest.raises(RoverError, match="step before reset"):
        made().step(AHEAD)
