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
    matching_numba,
    outlines,
    patches,
    polygons,
    poses,
    topology,
)
from polarsim.geometry.camera import Camera
from polarsim.geometry.casters import make_caster
from polarsim.geometry.meshes import Mesh
from polarsim.photo import BLACK_LEVEL
from tests.support.polar_rig import default_rig

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
OVERLAP = st.tuples(st.integers(0, 4), st.integers(0, 4), st.integers(0, 2**20)).map(
    lambda drawn: np.round(np.random.default_rng(drawn[2]).random(drawn[:2]) * 8) / 8
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
    "camera.box_around": (CAMERA.box_around, (POINTS, FLOATS)),
    "pose.apply": (POSE.apply, (POINTS, FLOATS)),
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
    "boxes.assign": (
        lambda a, b: boxes.match_by_position_and_size(a, b, 40),
        (LARGER_BOXES, WHOLE),
        (LARGER_BOXES, WHOLE),
    ),
    "consensus": (
        lambda one, other: (
            consensus.consensus_boxes([one, other]),
            consensus.find_rocks_labelled_shadow(one, other, [other, one]),
        ),
        (BOXES, WHOLE),
        (BOXES, WHOLE),
    ),
    "matching_numba": (of_match(matching_numba), (OVERLAP, FLOATS), (MASK, FLAGS)),
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
    "topology": (
        lambda faces: (topology.part_of_vertex(faces, 6), topology.is_watertight(faces), topology.open_edges(faces)),
        (FACES, INDICES),
    ),
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
    before = [one.copy() for one in other]
    expected, found = parts_of(function(*plain)), parts_of(function(*other))
    assert len(found) == len(expected)
    for one, wanted_one in zip(found, expected, strict=True):
        assert one.shape == wanted_one.shape
        np.testing.assert_allclose(one.astype(float), wanted_one.astype(float), rtol=1e-5, atol=2e-4)
    for one, unchanged in zip(other, before, strict=True):
        np.testing.assert_array_equal(one, unchanged)
