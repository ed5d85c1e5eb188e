"""One way from a scene to a picture: of a drive that is over, of a Gym environment, of a rover that decides."""

import numpy as np
import pytest

from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.options import ROVER_RENDER, CameraSuiteOptions, Light, rover_render
from polarsim.rover.cameras.rover_camera import RoverCamera, near_path
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.control import Command, Path
from polarsim.rover.drive.state import State
from polarsim.rover.drive.trace import CONTACTS, WHEEL_COLUMNS, Trace
from polarsim.rover.perception.observation import Perception
from polarsim.rover.vehicle.mounts import FRONT, mount_of
from polarsim.rover.vehicle.table import WHEELS
from tests.rover import driven

SCALE, SUN, EXPOSURE_MS = 0.04, "4", 256.0  # the Sun before the rover, whose light the lens scatters
LINE = Path(np.array([[5.5, 0.0], [1.0, 0.0]]))
# Another value of each option that changes pictures, and what else that option needs to act.
CHANGES = {
    "blur_px": (1.5, {}), "bloom": (0.1, {}), "bloom_px": (9.0, {"bloom": 0.1}), "veiling_glare": (0.05, {}),
    "lens_flare": (0.02, {}), "vignetting": (True, {}), "samples": (4, {}),
    "pixel_filter": ("gaussian", {"samples": 4}),
    "noise": (True, {}), "electrons_per_dn": (2.0, {"noise": True}),
    "read_noise_electrons": (200.0, {"noise": True}), "seed": (5, {"noise": True}),
    "materials": ({"ground": {"albedo": 0.5}}, {}), "gain": ({"hapke": 1.0}, {}),
    "ambient": (0.3, {}), "bounces": (1, {}), "bounce_rays": (4, {"bounces": 1}), "bounce_scale": (2, {"bounces": 1}),
}  # fmt: skip
OTHERS = {
    "models", "maps", "materials_from_photos", "fitting",  # of a run's photos and twins
    "engine", "device",  # change no picture
    *ROVER_RENDER,  # constants of the rover
    "rim", "rim_half_width_m", "rim_height_m", "rim_albedo",  # drives have no sandbox
    "lamp_radius_m",  # the Sun has its own
    "skirt_m",  # acts on rocks with open feet; here all reach below the ground
    "min_rock_area_px", "min_shadow_area_px", "min_shadow_width_px", "min_part_area_px", "min_visible_share",  # labels
}  # fmt: skip


@pytest.fixture(scope="module")
def trace() -> Trace:
    return driven.trace(seconds=0.5)


CAMERAS = CameraSuiteOptions(
    suns=(SUN,), views=(FRONT,), models=("hapke",), scale=SCALE, finer=1, stars="none", exposures_ms=(EXPOSURE_MS,)
)


def state_of(trace: Trace) -> State:
    """The first moment, at which no wheel has left a mark."""
    row = trace.table.iloc[0]
    table = [[row[f"{code}_{name}"] for name in WHEEL_COLUMNS[:-1]] + [CONTACTS.index("soil")] for code in WHEELS]
    wheels = np.array(table, float)
    names = (("x_m", "y_m", "z_m"), ("qw", "qx", "qy", "qz"))
    position, rotation = (row[list(some)].to_numpy(float) for some in names)
    zero = np.zeros(3)
    return State(0.0, position, rotation, zero, zero, zero, Command(), 0.0, wheels)


def shown_level(trace: Trace) -> np.ndarray:
    level = trace.world.level.copy()
    trace.tracks.apply(0, level)
    return level


def suite_picture(trace: Trace, render: RenderOptions) -> np.ndarray:
    suite = CameraSuite(trace, driven.vehicle(), CAMERAS, render, seed=3)
    suite.show(0)
    return suite.exposed(suite.render(FRONT, [SUN]), FRONT, SUN, "hapke", EXPOSURE_MS)


def live_picture(trace: Trace, render: RenderOptions) -> np.ndarray:
    near = near_path(trace.world, LINE, 1.5)
    camera = RoverCamera(trace.world, driven.vehicle(), near, CAMERAS, render, models=("hapke",))
    base = camera.show_state(state_of(trace), shown_level(trace))
    return camera.picture(mount_of(driven.vehicle().camera(FRONT), SCALE).at(base), Light(SUN, EXPOSURE_MS), "live")[0]


def deciding_picture(trace: Trace, render: RenderOptions) -> np.ndarray:
    """The front camera's picture of a rover that goes by a detector."""
    light = Light(SUN, EXPOSURE_MS)
    perception = Perception(trace.world, driven.vehicle(), LINE, "stereo", light, CAMERAS, 3, render=render)
    base = perception._camera.show_state(state_of(trace), shown_level(trace))
    return perception._picture(perception.mount.at(base), 0)[0]


WAYS = {"suite": suite_picture, "live": live_picture, "deciding": deciding_picture}


@pytest.fixture(scope="module")
def taken(trace):
    """Pictures by each caller with some options of the renderer, made once."""
    made = {}

    def take(**render):
        if str(render) not in made:
            options = RenderOptions(**render)
            made[str(render)] = {way: picture(trace, options) for way, picture in WAYS.items()}
        return made[str(render)]

    return take


def test_the_same_pose_gives_the_same_picture_to_all_callers(taken):
    lens = {"blur_px": 0.8, "veiling_glare": 0.02, "lens_flare": 0.01, "vignetting": True}
    found = taken(**lens)
    assert found["suite"].std() > 20
    apart = np.abs(found["suite"].astype(int) - found["live"])
    assert (apart <= 1).mean() > 0.995  # meshes are cut into triangles alike but for the tracks' tiles
    noise = found["deciding"].astype(int) - found["live"]  # a rover that decides always has noise
    assert 0 < noise.std() < 0.2 * found["live"].std()
    assert abs(noise.mean()) < 1


def test_all_options_of_the_renderer_are_named_here():
    assert set(CHANGES) | OTHERS == set(RenderOptions.model_fields)
    given = set(rover_render(RenderOptions()))
    assert given >= set(CHANGES)
    assert not given & set(ROVER_RENDER)


@pytest.mark.parametrize("key", CHANGES)
def test_every_option_of_pictures_acts_for_all_callers(key, taken):
    value, needed = CHANGES[key]
    one, other = taken(**needed), taken(**needed, **{key: value})
    for way in one:
        always = (way, key) == ("deciding", "noise")
        assert np.array_equal(one[way], other[way]) == always, way
