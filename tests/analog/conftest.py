import numpy as np
import pytest

from polarsim.analog.ground import HeightField
from polarsim.analog.options import AnalogOptions
from polarsim.analog.rocks import SimulatedRock, icosphere
from polarsim.analog.sandbox import Hall, build_scene
from polarsim.analog.view import make_textures, render_gbuffer
from polarsim.geometry.camera import Camera
from polarsim.geometry.poses import camera_pose
from polarsim.site import polar
from tests.support.polar_rig import default_rig

COARSE = AnalogOptions(ground_step_mm=20, rock_detail=3, scan_step_deg=0.2)
BALL_RADIUS, BALL_HEIGHT = 0.15, 0.10  # metres; height of the centre


@pytest.fixture(scope="session")
def coarse() -> AnalogOptions:
    return COARSE


@pytest.fixture(scope="session")
def ball_scene():
    """Flat sand inside the walls, with a ball in the centre."""
    axis = np.linspace(-2, 2, 81)
    sandbox = polar().sandbox
    ball = SimulatedRock(1, icosphere(3)[0] * BALL_RADIUS + [0, 0, BALL_HEIGHT], 0.3, 0.0, 0.0)
    flat = HeightField(axis, axis, np.zeros((81, 81)))
    return build_scene(sandbox, Hall.of(polar()), flat, [ball], 3, np.random.default_rng(1))


@pytest.fixture(scope="session")
def ball_caster(ball_scene):
    return ball_scene.caster()


@pytest.fixture(scope="session")
def small_lens():
    return default_rig().left.scaled(0.25)


@pytest.fixture(scope="session")
def ball_view(ball_scene, ball_caster, small_lens):
    """View of the ball from position A with a small camera."""
    pose = camera_pose(np.array([3.5, 0.0, 1.5]), np.pi, np.radians(25))
    textures = make_textures(np.random.default_rng(2))
    return render_gbuffer(ball_scene, ball_caster, textures, Camera(pose, small_lens))
