"""Equal images for all callers: recorded drives, the Gymnasium environment and perception."""

import numpy as np
import pytest

from polarsim.render.options import RenderOptions
from polarsim.rover.cameras import rover_camera
from polarsim.rover.cameras.options import ROVER_RENDER, CameraSuiteOptions, ImagingCondition, rover_render
from polarsim.rover.cameras.render_scene import RenderScene
from polarsim.rover.cameras.rover_camera import RoverCamera, near_path
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.control import Command, ReferencePath
from polarsim.rover.drive.state import RoverState
from polarsim.rover.drive.trace import CONTACTS, WHEEL_COLUMNS, Trace
from polarsim.rover.perception.observation import Perception
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.rover.vehicle.mounts import mount_of
from polarsim.rover.vehicle.table import WHEELS
from tests.rover import driven

SCALE, SUN, EXPOSURE_MS = 0.04, "4", 256.0  # the Sun in front of the rover, so that the lens scatters its light
LINE = ReferencePath(np.array([[5.5, 0.0], [1.0, 0.0]]))
# A different value of each option that changes pictures, and other options that it needs to act.
CHANGES = {
    "blur_px": (1.5, {}), "bloom": (0.1, {}), "bloom_px": (9.0, {"bloom": 0.1}), "veiling_glare": (0.05, {}),
    "lens_flare": (0.02, {}), "vignetting": (True, {}), "samples": (4, {}),
    "noise": (True, {}), "electrons_per_dn": (2.0, {"noise": True}),
    "read_noise_electrons": (200.0, {"noise": True}), "seed": (5, {"noise": True}),
    "materials": ({"ground": {"albedo": 0.5}}, {}), "gain": ({"hapke": 1.0}, {}),
    "ambient": (0.3, {}), "bounces": (1, {}), "bounce_rays": (4, {"bounces": 1}), "bounce_scale": (2, {"bounces": 1}),
}  # fmt: skip
OTHERS = {
    "models", "maps", "materials_from_photos", "fitting",  # options for photos and twins of a run
    "engine", "device",  # do not change pictures
    *ROVER_RENDER,  # constants of the rover
    "walls", "wall_albedo",  # drives have no sandbox
    "lamp_radius_m",  # does not apply to the Sun
    "skirt_m",  # acts on rocks with open lower edges; here all reach below the ground
    "min_rock_area_px", "min_shadow_area_px", "min_shadow_width_px", "min_part_area_px",  # labels
}  # fmt: skip


@pytest.fixture(scope="module")
def trace() -> Trace:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(driven, "CELL", 0.04)  # a coarse ground is enough for small pictures
        return driven.trace(seconds=0.5)


@pytest.fixture(scope="module", autouse=True)
def one_scene_per_caller():
    """Build each scene once: options of pictures do not change it, except for `skirt_m`."""
    scenes = {}

    def kept(tracks, *others, **options):
        if len(tracks.tiles) not in scenes:
            scenes[len(tracks.tiles)] = RenderScene(tracks, *others, **options)
        return scenes[len(tracks.tiles)]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rover_camera, "RenderScene", kept)
        yield


CAMERAS = CameraSuiteOptions(
    suns=(SUN,), views=(FRONT,), models=("hapke",), scale=SCALE, finer=1, stars="none", exposures_ms=(EXPOSURE_MS,)
)


def state_of(trace: Trace) -> RoverState:
    """Return the first state, before any wheel has left a mark."""
    row = trace.table.iloc[0]
    table = [[row[f"{code}_{name}"] for name in WHEEL_COLUMNS[:-1]] + [CONTACTS.index("soil")] for code in WHEELS]
    wheels = np.array(table, float)
    names = (("x_m", "y_m", "z_m"), ("qw", "qx", "qy", "qz"))
    position, rotation = (row[list(some)].to_numpy(float) for some in names)
    zero = np.zeros(3)
    return RoverState(0.0, position, rotation, zero, zero, zero, Command(), 0.0, wheels)


def shown_level(trace: Trace) -> np.ndarray:
    level = trace.world.level.copy()
    trace.tracks.apply(0, level)
    return level


def condition(cameras: CameraSuiteOptions) -> ImagingCondition:
    """Return the imaging condition of drives by these options."""
    return ImagingCondition(cameras.suns[0], cameras.exposures_ms[0], cameras.lights, cameras.models[0])


def suite_picture(trace: Trace, render: RenderOptions, cameras: CameraSuiteOptions = CAMERAS) -> np.ndarray:
    suite = CameraSuite(trace, driven.vehicle(), cameras, render, seed=3)
    suite.show(0)
    return suite.exposed(suite.render(FRONT, [SUN]), FRONT, SUN, "hapke", cameras.exposures_ms[0])


def live_picture(trace: Trace, render: RenderOptions, cameras: CameraSuiteOptions = CAMERAS) -> np.ndarray:
    near = near_path(trace.world, LINE, 1.5)
    camera = RoverCamera(trace.world, driven.vehicle(), near, cameras, render, models=("hapke",))
    base = camera.show_state(state_of(trace), shown_level(trace))
    return camera.picture(mount_of(driven.vehicle().camera(FRONT), cameras.scale).at(base), condition(cameras), "live")[
        0
    ]


def deciding_picture(trace: Trace, render: RenderOptions, cameras: CameraSuiteOptions = CAMERAS) -> np.ndarray:
    """Return the front camera's picture of the perception."""
    perception = Perception(
        trace.world, driven.vehicle(), LINE, "stereo", condition(cameras), cameras, 3, render=render
    )
    base = perception._camera.show_state(state_of(trace), shown_level(trace))
    return perception._picture(perception.mount.at(base), 0)


WAYS = {"suite": suite_picture, "live": live_picture, "deciding": deciding_picture}


@pytest.fixture(scope="module")
def taken(trace):
    """Render pictures by each caller with options of the renderer, once per set of options."""
    made = {}

    def take(**render):
        if str(render) not in made:
            options = RenderOptions(**render)
            made[str(render)] = {way: picture(trace, options) for way, picture in WAYS.items()}
        return made[str(render)]

    return take


def test_the_same_pose_gives_the_same_picture_to_all_callers(taken):
    lens = {"blur_px": 0.8, "veiling_glare": 0.02, "lens_flare": 0.01, "vignetting": True}
    pictures = taken(**lens)
    assert pictures["suite"].std() > 20
    difference = np.abs(pictures["suite"].astype(int) - pictures["live"])
    assert (difference <= 1).mean() > 0.995  # meshes differ only in the triangles of the tracks' tiles
    noise = pictures["deciding"].astype(int) - pictures["live"]  # perception always has noise
    assert 0 < noise.std() < 0.2 * pictures["live"].std()
    assert abs(noise.mean()) < 1


def test_all_options_of_the_renderer_are_listed_here():
    assert set(CHANGES) | OTHERS == set(RenderOptions.model_fields)
    given = set(rover_render(RenderOptions()))
    assert given >= set(CHANGES)
    assert not given & set(ROVER_RENDER)


@pytest.mark.parametrize("key", CHANGES)
def test_each_option_of_pictures_acts_for_all_callers(key, taken):
    value, needed = CHANGES[key]
    before, after = taken(**needed), taken(**needed, **{key: value})
    for way in before:
        always = (way, key) == ("deciding", "noise")
        assert np.array_equal(before[way], after[way]) == always, way


@pytest.mark.parametrize(
    ("key", "value"),
    [("sun_elevation_deg", 30.0), ("lights", ("navlight_left",)), ("exposures_ms", (512.0,))],
)
def test_each_option_of_the_cameras_acts_for_all_callers(key, value, trace, taken):
    cameras = CAMERAS.model_copy(update={key: value})
    for way, picture in WAYS.items():
        assert not np.array_equal(taken()[way], picture(trace, RenderOptions(), cameras)), way
