import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from polarsim.acquire.options import SeedOptions
from polarsim.acquire.seeds import best_exposure, choose_seed_files, copy_seeds, find_labels
from polarsim.errors import FormatError
from polarsim.formats import yolo
from polarsim.formats.release import polygon_folder
from polarsim.photo import PhotoKey
from polarsim.site import polar
from tests.support.polar_photos import SIZE

KEY = PhotoKey.parse("03_A_off_180_L_0256")


def write(folder, name, boxes):
    path = folder / f"{name}.txt"
    corner = 20.0 * np.arange(boxes)[:, None]
    yolo.write_boxes(
        path, np.zeros(boxes, int), np.concatenate([corner, corner, corner + 9, corner + 9], axis=1), size=SIZE
    )
    return PhotoKey.parse(name), path


@pytest.mark.parametrize(
    ("boxes", "best"),
    [
        ({32: 3, 256: 5, 2048: 4}, 256),
        ({32: 3, 256: 5, 2048: 6}, 2048),  # most boxes win, however long the exposure
        ({32: 5, 512: 5, 2048: 5}, 512),  # nearest 256 on a log scale
        ({128: 5, 512: 5}, 512),  # equally near: the longer
        ({64: 0}, 64),
    ],
)
def test_the_best_exposure_has_most_boxes_then_is_nearest_256_ms_then_longer(boxes, best):
    keys = {KEY.with_exposure(exposure): count for exposure, count in boxes.items()}
    assert best_exposure(keys, 256).exposure_ms == best


@given(st.permutations([32, 64, 128, 256, 512]), st.lists(st.integers(0, 3), min_size=5, max_size=5))
def test_the_best_exposure_does_not_depend_on_the_order_of_files(order, counts):
    boxes = {KEY.with_exposure(exposure): counts[exposure.bit_length() - 6] for exposure in order}
    best = best_exposure(boxes, 256)
    assert best_exposure(dict(sorted(boxes.items())), 256) == best
    assert boxes[best] == max(boxes.values())


def test_a_single_seed_per_bracket_is_chosen_by_camera_light_and_azimuth(tmp_path):
    names = ["03_A_off_30_L_0256", "03_A_off_350_L_0256", "03_B_off_30_L_0064"]
    others = [
        "03_A_off_30_L_0032",
        "03_A_off_30_R_0256",
        "03_A_on_30_L_0256",
        "03_A_off_no_L_0256",
        "03_C_off_30_L_0256",
    ]
    files = dict([*(write(tmp_path, name, 3) for name in names), *(write(tmp_path, name, 3) for name in others)])
    chosen = choose_seed_files(polar(), files, ["A", "B"], SeedOptions())
    assert [str(key) for key, _ in chosen] == sorted(names)


def test_a_given_exposure_is_chosen_if_available(tmp_path):
    names = ["03_A_off_30_L_0064", "03_A_off_30_L_0256", "03_B_off_30_L_0256"]
    files = dict(write(tmp_path, name, 3) for name in names)
    assert [str(key) for key, _ in choose_seed_files(polar(), files, "ABC", SeedOptions(exposure=64))] == names[:1]


def test_seeds_are_written_with_six_decimals_and_replace_earlier_files(tmp_path):
    _, path = write(tmp_path, str(KEY), 0)
    path.write_text("0 0.5 0.5  0.1 0.2")
    (tmp_path / "seeds").mkdir()
    (tmp_path / "seeds" / "old.txt").write_text("")
    copy_seeds([(KEY, path)], tmp_path / "seeds", SIZE)
    assert [found.name for found in (tmp_path / "seeds").iterdir()] == [f"{KEY}.txt"]
    assert (tmp_path / "seeds" / f"{KEY}.txt").read_text() == "0 0.500000 0.500000 0.100000 0.200000\n"


def test_labels_are_found_in_the_layout_of_the_release_and_in_a_flat_folder(tmp_path):
    for folder in ("release/Labels/Terrain03", "flat"):
        (tmp_path / folder).mkdir(parents=True)
        write(tmp_path / folder, str(KEY), 1)
        write(tmp_path / folder, "04_A_off_30_L_0064", 1)
    for root in ("release", "flat"):
        assert list(find_labels(tmp_path / root, 3)[0]) == [KEY]
    with pytest.raises(FormatError, match="nowhere"):
        find_labels(tmp_path / "nowhere", 3)


def test_seeds_may_be_polygons_without_boxes(tmp_path):
    rock = np.array([[100.0, 200], [150, 190], [160, 240], [110, 250]])
    ground = np.array([[0.0, 0], [1936, 0], [1936, 1216], [0, 1216]])
    shadow = np.array([[150.0, 230], [2000, 240], [155, 260]])  # outside the photo
    folder = polygon_folder(tmp_path, 3)
    yolo.write_polygons(folder / f"{KEY}.txt", [(1, ground), (2, rock), (3, shadow)], size=SIZE)
    files, _ = find_labels(tmp_path, 3)
    copy_seeds(choose_seed_files(polar(), files, ["A"], SeedOptions()), tmp_path / "seeds", SIZE)
    classes, boxes = yolo.read_boxes(tmp_path / "seeds" / f"{KEY}.txt", size=SIZE)
    assert classes.tolist() == [0, 1]
    np.testing.assert_allclose(boxes, [[100, 190, 160, 250], [150, 230, 1936, 260]], atol=0.01)


def test_a_file_of_boxes_and_polygons_is_an_error(tmp_path):
    (tmp_path / "mixed.txt").write_text("2 0.1 0.1 0.2 0.1 0.2 0.2\n0 0.5 0.5 0.1 0.1\n")
    with pytest.raises(FormatError, match=r"mixed\.txt:2"):
        yolo.read_boxes_or_polygons(tmp_path / "mixed.txt", size=SIZE)


def test_swapped_classes_of_a_seed_are_corrected_by_other_azimuths(tmp_path, caplog):
    rocks = np.array([[100.0, 100, 160, 140], [300, 200, 350, 260], [700, 500, 820, 560]])
    shadows = rocks + np.array([60.0, 0, 90, 10])
    boxes = np.concatenate([rocks, shadows])
    right = np.repeat([0, 1], 3)
    chosen = []
    for azimuth, classes in {"30": right, "180": right, "270": np.ones(6, int), "350": right}.items():
        key = PhotoKey.parse(f"03_A_off_{azimuth}_L_0256")
        yolo.write_boxes(tmp_path / f"{key}.txt", classes, boxes + 3 * (azimuth == "270"), size=SIZE)
        chosen.append((key, tmp_path / f"{key}.txt"))
    copy_seeds(chosen, tmp_path / "seeds", SIZE)
    for key, _ in chosen:
        np.testing.assert_array_equal(yolo.read_boxes(tmp_path / "seeds" / f"{key}.txt", size=SIZE)[0], right)
    assert "03_A_off_270_L_0256: 3 of 6 shadows" in caplog.text


def test_shadows_on_a_rock_of_a_single_other_azimuth_are_unchanged(tmp_path):
    box = np.array([[100.0, 100, 160, 140]])
    chosen = []
    for azimuth, number in {"30": 0, "180": 1, "270": 1}.items():
        key = PhotoKey.parse(f"03_A_off_{azimuth}_L_0256")
        yolo.write_boxes(tmp_path / f"{key}.txt", np.array([number]), box, size=SIZE)
        chosen.append((key, tmp_path / f"{key}.txt"))
    copy_seeds(chosen, tmp_path / "seeds", SIZE)
    assert [int(yolo.read_boxes(tmp_path / "seeds" / f"{key}.txt", size=SIZE)[0][0]) for key, _ in chosen] == [0, 1, 1]


@pytest.mark.parametrize("lines", ["1 0.5 0.5 0.1 0.1\n", "1 0.4 0.4 0.6 0.4 0.6 0.6 0.4 0.6\n"])
@pytest.mark.parametrize(
    ("file", "content"), [("classes.txt", "shadow\nrock\n"), ("data.yaml", "names: [shadow, rock]")]
)
def test_class_numbers_of_seeds_are_defined_by_a_class_list(tmp_path, lines, file, content):
    (tmp_path / f"mine/{KEY}.txt").parent.mkdir()
    (tmp_path / f"mine/{KEY}.txt").write_text(lines)
    (tmp_path / "mine" / file).write_text(content)
    files, _ = find_labels(tmp_path / "mine", 3)
    copy_seeds(choose_seed_files(polar(), files, ["A"], SeedOptions()), tmp_path / "seeds", SIZE)
    classes, _ = yolo.read_boxes(tmp_path / f"seeds/{KEY}.txt", size=SIZE)
    assert classes.tolist() == [0]  # a rock
