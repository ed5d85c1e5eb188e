"""Localisation with real seeds and real meshes of the published release, if it is available."""

import numpy as np
import pytest

from polarsim.cameras.labels import check_localisation, localise_by_labels
from polarsim.cameras.localisations import localise_all
from polarsim.cameras.options import LocalisationOptions
from polarsim.formats import obj, release, yolo
from polarsim.geometry.boxes import clip, iou, match_by_position_and_size
from polarsim.geometry.consensus import consensus_boxes
from polarsim.geometry.outlines import outlines_of
from polarsim.run_files.rigs import LocalisedRig
from polarsim.site import polar
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig
from tests.support.polar_survey import RANGES, TRIPODS, surveyed_pose

OPTIONS = LocalisationOptions()


def best_boxes(root, terrain, position, camera):
    """Return the rock boxes of each Sun azimuth, light off, of the exposure with most boxes."""
    files = release.label_files(root, terrain)
    annotated = []
    for sun in polar().suns:
        of_set = [key for key in files if key.bracket == (terrain, position, "off", sun, camera)]
        rocks = [boxes[classes == 0] for classes, boxes in (yolo.read_boxes(files[key], size=SIZE) for key in of_set)]
        annotated.append(max(rocks, key=len))
    return annotated


@pytest.mark.release
@pytest.mark.parametrize(
    ("terrain", "position", "stood", "least_left", "least_right"),
    [
        # Positions of left cameras and mean IoU of another program, fitted to both cameras of all terrains with a
        # lens of 2085 px: (3.583, -0.398, 1.511) with 0.82, 0.81 and (6.125, -0.585, 1.571) with 0.69, 0.72.
        (1, "A", (3.583, -0.398, 1.511), 0.78, 0.78),
        (11, "B", (6.125, -0.585, 1.571), 0.65, 0.68),
    ],
)
def test_real_seeds_localise_the_rig(release_root, terrain, position, stood, least_left, least_right):
    meshes = {rock: obj.read_obj(path) for rock, path in release.released_meshes(release_root, terrain).items()}
    outlines = outlines_of(meshes)
    boxes = consensus_boxes(best_boxes(release_root, terrain, position, "L"))
    localisation = check_localisation(
        localise_by_labels(boxes, outlines, default_rig().left, surveyed_pose(position), RANGES), 1.0
    )
    pose = localisation.fit.sandbox_from_left
    assert np.linalg.norm(pose.translation - stood) < 0.1  # their lens is 1 % longer: 4 to 6 cm in distance
    assert localisation.fit.iou.mean() >= least_left
    # The boxes of the right camera are not used by the fit.
    rig = LocalisedRig(default_rig(), pose)
    right = clip(outlines.project(rig.camera("R")), 1936, 1216)
    annotated = consensus_boxes(best_boxes(release_root, terrain, position, "R"))
    rows, columns = match_by_position_and_size(right, annotated, 40)
    assert len(rows) >= len(localisation.fit.iou) - 1
    assert np.diag(iou(right[rows], annotated[columns])).mean() >= least_right


@pytest.mark.release
def test_every_position_of_a_terrain_with_displaced_rocks_is_localised(release_root):
    """Terrain 12: three published rocks are 5 cm off."""
    meshes = {rock: obj.read_obj(path) for rock, path in release.released_meshes(release_root, 12).items()}
    outlines = outlines_of(meshes)
    seen = {position: consensus_boxes(best_boxes(release_root, 12, position, "L")) for position in "ABC"}
    found = localise_all(seen, outlines, default_rig().left, OPTIONS, TRIPODS, 1.0, RANGES)
    assert not found.refused
    assert all(localisation.share > 0.55 for localisation in found.localised.values())
    off = np.linalg.norm(found.translations.metres, axis=1)
    assert set(outlines.rocks[off > 0.03]) >= {3, 4, 6}
    assert np.median(off) < 0.02
