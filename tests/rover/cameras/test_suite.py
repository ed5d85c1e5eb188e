"""Images of the cameras on a drive."""

import numpy as np
import pytest
from pydantic import ValidationError

from polarsim.errors import ConfigError
from polarsim.render.olat import NO_LAMP
from polarsim.rover.cameras.options import PAPER_VIEWS
from polarsim.rover.cameras.suite import CameraSuite
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.run_files.instances import BODY, GROUND, ROCK_IDS, SHADOW_IDS
from tests.rover import driven
from tests.rover.driven import options


@pytest.fixture(scope="module")
def suite(drive):
    result = CameraSuite(
        drive,
        driven.vehicle(),
        options(views=(FRONT, "CamBirdViewLeft", "WheelCam_LeftBack"), scale=0.12, models=("hapke",)),
    )
    result.show(10)
    return result


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"views": ("eye",)}, ConfigError, "eye"),
        ({"lights": ("torch",)}, ConfigError, "torch"),
        ({"suns": ("night",)}, ValidationError, "suns"),  # no light at all
        ({"suns": ()}, ValidationError, "suns"),
    ],
)
def test_unknown_cameras_and_lights_and_a_night_without_lights_are_errors(drive, changes, error, message):
    with pytest.raises(error, match=message):
        CameraSuite(drive, driven.vehicle(), options(**changes))


def test_cameras_see_the_rock_ahead_and_the_wheel_at_their_projections(suite):
    ids = suite.render(FRONT, ["2"]).ids[NO_LAMP]
    x, y, height, _ = driven.ROCKS[0]
    centre = np.array([x, y, driven.level(x, y) + height / 2])
    column, row = suite.camera(FRONT, 10).project(centre).astype(int)
    assert ids[row, column] == ROCK_IDS + 1
    camera = suite.camera("WheelCam_LeftBack", 10)
    assert camera.inside(camera.project(suite.trace.pose_at(2.0, "lr").translation))
    assert set(PAPER_VIEWS) <= {part.name for part in driven.vehicle().cameras}


def test_a_following_camera_has_the_rover_in_the_centre_and_its_shadow_on_the_ground(suite):
    rendering = suite.render("CamBirdViewLeft", ["2"])
    ids = rendering.ids[NO_LAMP]
    height, width = ids.shape
    assert BODY <= ids[height // 2, width // 2] < ROCK_IDS
    assert (ids == GROUND).mean() > 0.4
    dark = (ids == GROUND) & (rendering.olat_images["hapke", "2"] == 0)
    assert dark.mean() > 0.01
    assert ((rendering.ids["2"] >= SHADOW_IDS) <= (ids == GROUND)).all()


def test_ruts_are_behind_the_wheels_only(suite):
    surfaces = suite.rover_camera.scene.surfaces
    vertices = surfaces.vertices
    x, y, z = vertices.T
    ground = np.zeros(len(vertices), bool)
    ground[np.unique(surfaces.faces[surfaces.id_of_face == GROUND])] = True
    behind = ground & (abs(x - 5.4) < 0.3) & (abs(y - 0.61) < 0.02)
    ahead = ground & (x > 2.5) & (x < 4.0) & (abs(y - 0.61) < 0.02)
    np.testing.assert_allclose((z - driven.level(x, y))[behind], -driven.SINKAGE - 0.003, atol=0.0045)  # with marks
    np.testing.assert_allclose((z - driven.level(x, y))[ahead], 0, atol=1e-4)


def test_a_frame_does_not_depend_on_earlier_frames_and_threads(drive):
    chosen = options(views=(FRONT,), models=("hapke",), finer=1)
    one, other = (CameraSuite(drive, driven.vehicle(), chosen) for _ in range(2))
    for frame, earlier in ((4, (2,)), (9, (5, 7))):
        for shown in (*earlier, frame):
            one.show(shown)
        other.show(frame)
        images = [
            own.render(FRONT, ["2"], threads).olat_images["hapke", "2"] for own, threads in ((one, 1), (other, 3))
        ]
        np.testing.assert_array_equal(*images)


def test_stars_appear_in_the_sky_only_and_scale_with_their_brightness(drive):
    dark, plain, bright = (
        CameraSuite(
            drive, driven.vehicle(), options(views=("ncl",), stars=stars, scale=0.06, models=("hapke",), finer=1)
        )
        for stars in ("none", "physical", "bright")
    )
    olat_images, ids = [], None
    for own in (dark, plain, bright):
        own.show(0)
        found = own.render("ncl", ["2"])
        olat_images.append(found.olat_images["hapke", "2"])
        ids = found.ids[NO_LAMP]
    none, physical, many = olat_images
    np.testing.assert_array_equal(none[ids > 0], many[ids > 0])
    assert physical[ids == 0].sum() >= 0
    np.testing.assert_allclose(many[ids == 0], 300 * physical[ids == 0], rtol=1e-4)
