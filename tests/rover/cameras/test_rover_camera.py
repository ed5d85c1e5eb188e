"""One way from a scene to a picture: of a drive that is over, of a Gym environment, of a rover that decides."""

import numpy as np
import pytest

from polarsim.render.options import RenderOptions
from polarsim.rover.cameras.live_camera import LiveCamera, LiveCameraOptions
from polarsim.rover.cameras.options import SUN_AZIMUTHS_DEG, CameraSuiteOptions
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.drive.control import Command, Path
from polarsim.rover.drive.state import State
from polarsim.rover.drive.trace import CONTACTS, WHEEL_COLUMNS, Trace
from polarsim.rover.perception.hazard_grid import HazardGrid
from polarsim.rover.perception.observation import Eyes
from polarsim.rover.planning.cases import Light
from polarsim.rover.planning.options import AutonomyOptions
from polarsim.rover.vehicle.mounts import FRONT
from polarsim.rover.vehicle.table import WHEELS
from tests.rover import driven

SCALE, SUN, EXPOSURE_MS = 0.04, "4", 256.0  # the Sun before the rover, whose light the lens scatters
LINE = Path(np.array([[5.5, 0.0], [1.0, 0.0]]))
# Another value of each option that changes pictures, and what else that option needs to act.
CHANGES = {
    "blur_px": (1.5, {}), "bloom": (0.1, {}), "bloom_px": (9.0, {"bloom": 0.1}), "veiling_glare": (0.05, {}),
    "lens_flare": (0.02, {}), "vignetting": (True, {}), "samples": (4, {}),
    "pixel_filter": ("gaussian", {"samples": 4}), "filter_sd_px": (1.0, {"samples": 4, "pixel_filter": "gaussian"}),
    "noise": (True, {}), "electrons_per_grey_value": (2.0, {"noise": True}),
    "read_noise_electrons": (200.0, {"noise": True}), "seed": (5, {"noise": True}),
    "hapke": ("sato_mare_643", {}), "materials": ({"ground": {"albedo": 0.5}}, {}), "gain": ({"hapke": 1.0}, {}),
    "falloff": (False, {}), "lamp_samples": (1, {}), "bounce": (0.3, {}),
    "ambient": (0.3, {}), "bounces": (1, {}), "bounce_rays": (4, {"bounces": 1}), "bounce_scale": (2, {"bounces": 1}),
}  # fmt: skip
OTHERS = {
    "models", "maps", "calibration_photos", "materials_from_photos", "fitting",  # of a run's photos and twins
    "engine", "rays", "device",  # change no picture
    "lamp_probe_px",  # changes few pixels of large pictures
    "principled", "lambert", "lunar_lambert", "hapke_chrono", "principled_chrono",  # of other models than this one
    "rim", "rim_half_width_m", "rim_height_m", "rim_albedo",  # drives have no sandbox
    "lamp_radius_m",  # the Sun has its own
    "skirt_m",  # acts on rocks with open feet; here all reach below the ground
    "shadow_below", "min_rock_px", "min_shadow_px", "min_shadow_width_px", "min_part_px", "min_visible_share",  # labels
}  # fmt: skip


@pytest.fixture(scope="module")
def trace() -> Trace:
    return driven.trace(seconds=0.5)


def cameras(**render) -> CameraSuiteOptions:
    given = {
        "suns": (SUN,),
        "views": (FRONT,),
        "models": ("hapke",),
        "scale": SCALE,
        "finer": 1,
        "far_m": 2.0,
        "stars": "none",
    }
    base = {"noise": False} | render
    return CameraSuiteOptions(**given, exposures_ms=(EXPOSURE_MS,), render=base)


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


def suite_picture(trace: Trace, options: CameraSuiteOptions) -> np.ndarray:
    suite = CameraSuite(trace, driven.vehicle(), options, seed=3)
    suite.show(0)
    return suite.exposed(suite.render(FRONT, [SUN]), FRONT, SUN, "hapke", EXPOSURE_MS)


def live_picture(trace: Trace, options: CameraSuiteOptions) -> np.ndarray:
    own = LiveCameraOptions(
        scale=SCALE, sun_azimuth_deg=SUN_AZIMUTHS_DEG[SUN], exposure_ms=EXPOSURE_MS, cameras=options
    )
    camera = LiveCamera(trace.world, driven.vehicle(), LINE, own, seed=3)
    return camera.grey(state_of(trace), shown_level(trace))


def deciding_picture(trace: Trace, options: CameraSuiteOptions, monkeypatch) -> np.ndarray:
    """What a rover that goes by stereo takes with its front camera, at the moment it looks."""
    own = AutonomyOptions(scale=SCALE, stereo_scale=1.0, noise=False)
    eyes = Eyes(trace.world, driven.vehicle(), LINE, "stereo", Light(SUN, EXPOSURE_MS), own, options, 3)
    taken = []
    picture = eyes._picture
    monkeypatch.setattr(eyes, "_picture", lambda *given: taken.append(picture(*given)[0]) or (taken[-1], EXPOSURE_MS))
    eyes.look(state_of(trace), shown_level(trace), HazardGrid(trace.world, own.map))
    return taken[0]


def pictures(trace: Trace, monkeypatch, **render) -> dict[str, np.ndarray]:
    options = cameras(**render)
    return {
        "suite": suite_picture(trace, options),
        "live": live_picture(trace, options),
        "deciding": deciding_picture(trace, options, monkeypatch),
    }


@pytest.fixture(scope="module")
def taken(trace):
    """Pictures of each way with some options, made once."""
    made = {}
    with pytest.MonkeyPatch.context() as patch:

        def take(**render):
            if str(render) not in made:
                made[str(render)] = pictures(trace, patch, **render)
            return made[str(render)]

        yield take


def test_the_same_pose_gives_the_same_picture_on_all_ways(taken):
    found = taken(blur_px=0.8, veiling_glare=0.02, lens_flare=0.01, vignetting=True)
    assert found["suite"].std() > 20
    np.testing.assert_array_equal(found["live"], found["deciding"])
    apart = np.abs(found["suite"].astype(int) - found["live"])
    assert (apart <= 1).mean() > 0.995  # meshes are cut into triangles alike but for the tracks' tiles


def test_all_options_of_the_renderer_are_named_here():
    assert set(CHANGES) | OTHERS == set(RenderOptions.model_fields)


@pytest.mark.parametrize("key", CHANGES)
def test_every_option_of_pictures_acts_on_all_ways(key, taken):
    value, needed = CHANGES[key]
    one, other = taken(**needed), taken(**needed, **{key: value})
    for way in one:
        assert not np.array_equal(one[way], other[way]), way
