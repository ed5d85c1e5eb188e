"""Results depend only on the values of arrays, not on memory layout, type, byte order or write protection."""

from dataclasses import astuple, is_dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from polarsim.geometry import (
    boxes,
    bvh,
    consensus,
    masks,
    matching,
    matching_numba,
    outlines,
    patches,
    planes,
    polygons,
    poses,
    topology,
    vectors,
)
from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh, subdivide_smoothly
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import default_rig
from polarsim.photo import BLACK_LEVEL

LENS = default_rig().left
POSE = poses.camera_pose(np.array([-2.0, 0.5, 2.0]), 0.3, 0.5)
CAMERA = Camera(POSE, LENS)
TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def spaced(array):
    """Return a view of every second element along each axis of a larger array."""
    room = np.zeros([2 * size for size in array.shape], array.dtype)
    view = room[tuple(slice(1, None, 2) for _ in array.shape)]
    view[...] = array
    return view


def reversed_view(array):
    backwards = tuple(slice(None, None, -1) for _ in array.shape)
    return np.ascontiguousarray(array[backwards])[backwards]


def misaligned(array):
    room = np.zeros(array.nbytes + 1, np.uint8)[1:]
    view = room.view(array.dtype).reshape(array.shape) if array.size else array.copy()
    view[...] = array
    return view


def read_only(array):
    copy = array.copy()
    copy.flags.writeable = False
    return copy


def swapped_bytes(array):
    return array.astype(array.dtype.newbyteorder())


LAYOUTS = [np.ascontiguousarray, np.asfortranarray, spaced, reversed_view, misaligned, read_only, swapped_bytes]
FLOATS = [np.float64, np.float32]
WHOLE = [*FLOATS, np.int64, np.int32, np.int16, np.uint16]
INDICES = [np.int64, np.int32, np.uint32]
FLAGS = [np.bool_]
EIGHTHS = st.integers(-40, 40).map(lambda number: number / 8)  # exact in all floating types


def rows(elements, columns, least=0, most=5):
    return st.lists(st.tuples(*columns * [elements]), min_size=least, max_size=most).map(
        lambda found: np.array(found, float).reshape(-1, columns)
    )


POINTS = rows(EIGHTHS, 3)
SEEN_POINTS = rows(EIGHTHS, 3).map(lambda points: points / 8 + [0, 0, 4])  # in front of the lens
PIXELS = st.tuples(st.integers(0, 3), st.integers(0, 3)).map(
    lambda shape: (np.arange(np.prod(shape) * 2).reshape(*shape, 2) * 97) % 1200.0
)
BOXES = rows(st.integers(0, 60), 4).map(
    lambda found: np.concatenate([found[:, :2], found[:, :2] + found[:, 2:]], axis=1) * 5
)
LARGER_BOXES = BOXES.map(lambda found: np.add(found, [0, 0, 1, 2]))
RING = rows(st.integers(0, 30), 2, least=3)
MASK = st.tuples(st.integers(1, 7), st.integers(1, 7), st.integers(0, 2**20)).map(
    lambda drawn: np.random.default_rng(drawn[2]).random(drawn[:2]) < 0.6
)
SOLID = st.permutations(range(5)).map(
    lambda order: np.array([[0, 0, 0], [1, 0, 0.125], [0, 1, 0.25], [0.25, 0.25, 1], [0.5, 0.125, 0.75]])[order]
)
CORNERS = SOLID.map(lambda points: points[:4])
FACES = st.integers(0, 4).map(lambda count: TETRAHEDRON[:count])
CLASSES = st.integers(0, 2**20).map(lambda seed: np.random.default_rng(seed).integers(0, 4, (5, 6)))
PAIR = POINTS.map(lambda points: (points, 1 + np.arange(points.size).reshape(-1, 3) % 7.0))
OVERLAP = st.tuples(st.integers(0, 4), st.integers(0, 4), st.integers(0, 2**20)).map(
    lambda drawn: np.round(np.random.default_rng(drawn[2]).random(drawn[:2]) * 8) / 8
)
MANY_POINTS = rows(EIGHTHS, 3, least=4, most=8).map(
    lambda points: points + np.arange(len(points))[:, None] ** [1, 2, 0]
)
THRESHOLDS = np.array([0.5, 0.75])


def of_match(engine):
    return lambda overlap, other: engine.match_predictions_of_photo(
        overlap, THRESHOLDS, np.resize(other, (2, overlap.shape[1])).astype(bool)
    )


def cast(engine):
    def results(vertices, faces, origins, directions):
        surface = make_caster(vertices, faces, engine)
        return (
            surface.nearest(origins, directions),
            surface.intersect(origins, directions),
            surface.occluded(origins, directions, 0.75),
            surface.occluded(origins, directions, np.full(len(origins), 0.75)),
        )

    return results


ORIGINS = st.integers(0, 40).map(
    lambda count: np.stack([np.arange(count) % 8, np.arange(count) // 8, np.full(count, 16)], axis=1) / 8.0
)
PHOTO = np.round(1000 * np.random.default_rng(3).random((40, 44))).astype(float) + BLACK_LEVEL

CASES = {  # a function, and by argument: values and types that hold them exactly
    "lens.project": (LENS.project, (SEEN_POINTS, FLOATS)),
    "lens.directions": (LENS.directions, (PIXELS, WHOLE)),
    "camera.project": (CAMERA.project, (POINTS, FLOATS)),
    "camera.directions": (CAMERA.directions, (PIXELS, WHOLE)),
    "camera.inside": (CAMERA.inside, (PIXELS, WHOLE)),
    "camera.box_around": (CAMERA.box_around, (POINTS, FLOATS)),
    "pose.apply": (POSE.apply, (POINTS, FLOATS)),
    "pose.rotate": (POSE.rotate, (POINTS, FLOATS)),
    "pose.parts": (
        lambda rotation, translation: (Pose(rotation, translation) @ POSE).inverse().matrix,
        (st.just(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])), WHOLE[:4]),
        (st.just(np.array([1.0, 2, 3])), WHOLE[:4]),
    ),
    "pose.from_matrix": (
        lambda matrix: Pose.from_matrix(matrix).matrix,
        (st.just(np.array([[0.0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7]])), WHOLE[:4]),
    ),
    "fit_pose": (lambda source: poses.fit_pose(source, source[:, [1, 2, 0]]).matrix, (SOLID, FLOATS)),
    "looking": (lambda centre: poses.camera_pose(centre, 0.3, 0.1).matrix, (st.just(np.array([1.0, 2, 3])), WHOLE)),
    "vectors": (
        lambda first, second: (
            vectors.dot(first, second),
            vectors.length(first),
            vectors.normalise(first),
            vectors.cross(first, second),
            vectors.scale_vectors(first, second[:, 0]),
            vectors.points_along(first, second, second[:, 1]),
        ),
        (PAIR.map(lambda pair: pair[0]), FLOATS),
        (PAIR.map(lambda pair: pair[1]), FLOATS),
    ),
    "boxes.one": (
        lambda own: (boxes.area(own), boxes.box_centres(own), boxes.clip(own, 100, 200)),
        (BOXES, WHOLE),
    ),
    "boxes.around": (boxes.box_around_points, (RING, WHOLE)),
    "boxes.window": (
        lambda own, margin: [boxes.pixel_window(box, margin, 100, 120) for box in own],
        (BOXES, WHOLE),
        (st.just(np.array([3.0, 4.0])), WHOLE),
    ),
    "boxes.two": (
        lambda one, other: (
            boxes.iou(one, other),
            boxes.largest_iou(one, other),
            boxes.largest_covered_share(one, other),
            boxes.match_by_iou(boxes.iou(one, other)),
        ),
        (BOXES, WHOLE),
        (BOXES, WHOLE),
    ),
    "boxes.assign": (boxes.match_by_position_and_size, (LARGER_BOXES, WHOLE), (LARGER_BOXES, WHOLE)),
    "boxes.match": (
        lambda overlap: (boxes.match_by_iou(overlap), boxes.match_by_summed_iou(overlap)),
        (OVERLAP, FLOATS),
    ),
    "boxes.of_mask": (boxes.box_of_mask, (MASK, [np.bool_, np.uint8])),
    "consensus": (
        lambda one, other: (
            consensus.consensus_boxes([one, other]),
            consensus.find_rocks_labelled_shadow(one, other, [other, one]),
        ),
        (BOXES, WHOLE),
        (BOXES, WHOLE),
    ),
    "matching": (of_match(matching), (OVERLAP, FLOATS), (MASK, FLAGS)),
    "matching_numba": (of_match(matching_numba), (OVERLAP, FLOATS), (MASK, FLAGS)),
    "masks": (
        lambda truth, found: masks.class_iou(masks.confusion_matrix(truth, found, 3)),
        (CLASSES, [np.uint8, *INDICES]),
        (CLASSES.map(lambda found: np.minimum(found, 2)), [np.uint8, *INDICES]),
    ),
    "polygons.ring": (
        lambda ring: (
            polygons.signed_area(ring),
            polygons.rasterised(ring, (30, 31)),
            polygons.paint([(2, ring)], (30, 31)),
        ),
        (RING, WHOLE),
    ),
    "polygons.mask": (
        lambda mask: (
            polygons.outlines(mask, 1.0),
            polygons.thick_parts(mask, 2),
            polygons.without_thin_parts(mask, 2),
        ),
        (MASK, FLAGS),
    ),
    "outlines": (
        lambda vertices, faces: (
            outlines.rock_outline(Mesh(vertices, faces), 0.01, 0.35),
            outlines.hull_corners(vertices),
        ),
        (SOLID, FLOATS),
        (st.just(TETRAHEDRON), INDICES),
    ),
    "meshes": (
        lambda vertices, faces: (Mesh(vertices, faces).normals(), subdivide_smoothly(Mesh(vertices, faces))),
        (CORNERS, FLOATS),
        (FACES, INDICES),
    ),
    "planes": (
        lambda points, start: (planes.robust_plane(points, 0.1), planes.tracked_plane(points, start, [9.0, 5.0])),
        (MANY_POINTS, FLOATS),
        (st.just(np.array([0.0, 0.0, 1.0])), WHOLE),
    ),
    "level_from": (lambda plane: planes.level_from(plane).matrix, (st.just(np.array([1.0, 2.0, 3.0])), WHOLE)),
    "topology": (
        lambda faces: (topology.part_of_vertex(faces, 6), topology.is_watertight(faces), topology.open_edges(faces)),
        (FACES, INDICES),
    ),
    "hull_faces": (topology.hull_faces, (SOLID, FLOATS)),
    "bvh": (bvh.build_tree, (CORNERS, FLOATS), (st.just(TETRAHEDRON), INDICES)),
    "rays.numpy": (cast("numpy"), (CORNERS, FLOATS), (FACES, INDICES), (ORIGINS, FLOATS), None),
    "rays.embree": (cast("embree"), (CORNERS, FLOATS), (FACES, INDICES), (ORIGINS, FLOATS), None),
    "patches": (
        lambda shaded, photo, usable: patches.match_windows(
            shaded, photo, usable, patches.MatchingOptions(4, 3, 3, 0.5, 1.0)
        ),
        (st.just(PHOTO - BLACK_LEVEL), FLOATS),
        (st.just(PHOTO), FLOATS),
        (st.just(PHOTO > 0), FLAGS),
    ),
}


def parts_of(result):
    """Yield the arrays of a result, in order."""
    if is_dataclass(result):
        result = astuple(result)
    if isinstance(result, tuple | list):
        return [array for part in result for array in parts_of(part)]
    if isinstance(result, slice):
        return [np.array([result.start, result.stop])]
    return [np.asarray(np.nan if result is None else result)]


@pytest.mark.parametrize("name", CASES)
@settings(max_examples=30)
@given(data=st.data())
def test_layout_type_and_byte_order_do_not_change_results(name, data):
    function, *wanted = CASES[name]
    plain, other = [], []
    for case in wanted:
        if case is None:  # directions: as many as origins
            values, types = np.tile([0.0, 0.0, -4.0], (len(plain[-1]), 1)), FLOATS
        else:
            strategy, types = case
            values = data.draw(strategy)
        layout, kind = data.draw(st.sampled_from(LAYOUTS)), data.draw(st.sampled_from(types))
        plain.append(np.ascontiguousarray(values, types[0]))
        other.append(layout(np.asarray(values, kind)))
    if name == "vectors":
        count = min(map(len, plain))
        plain, other = [one[:count] for one in plain], [one[:count] for one in other]
    before = [one.copy() for one in other]
    expected, found = parts_of(function(*plain)), parts_of(function(*other))
    assert len(found) == len(expected)
    for one, wanted_one in zip(found, expected, strict=True):
        assert one.shape == wanted_one.shape
        np.testing.assert_allclose(one.astype(float), wanted_one.astype(float), rtol=1e-5, atol=2e-4)
    for one, unchanged in zip(other, before, strict=True):
        np.testing.assert_array_equal(one, unchanged)
