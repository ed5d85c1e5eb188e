import numpy as np

from polarsim.formats import yolo
from polarsim.labels.seeds import (
    AnnotatedBoxes,
    MinExposures,
    choose_seeds,
    read_seeds,
    sort_by_camera,
)
from polarsim.photo import PhotoKey
from polarsim.site import polar
from tests.support.polar_photos import SIZE

ROCK, SHADOW = np.array([100.0, 100, 160, 150]), np.array([60.0, 90, 110, 140])


def write(folder, name, shadows=1, offset=0):
    boxes = np.array([ROCK + offset, *[SHADOW] * shadows])
    yolo.write_boxes(folder / f"{name}.txt", np.array([0] + [1] * shadows), boxes, size=SIZE)


def chosen_seeds(folder, corrections=None, shadow_start_ms=0):
    return choose_seeds(
        read_seeds(folder, 3, polar().images.size), corrections or {}, MinExposures(shadow_start_ms, 2048)
    )


def test_seeds_of_both_cameras_are_kept_by_position_and_lamp(tmp_path):
    write(tmp_path, "03_A_off_30_L_0256")
    write(tmp_path, "03_A_off_30_R_0256")
    write(tmp_path, "03_C_off_180_R_0256")
    seeds = chosen_seeds(tmp_path)
    assert {position: sorted(annotated) for position, annotated in seeds.items()} == {
        "A": [("L", "30"), ("R", "30")],
        "C": [("R", "180")],
    }


def test_the_annotation_with_most_boxes_without_rover_light_is_chosen(tmp_path):
    write(tmp_path, "03_A_off_30_L_0128", shadows=0)
    write(tmp_path, "03_A_off_30_L_0256", shadows=2)
    write(tmp_path, "03_A_on_30_L_0256", shadows=3)
    assert len(chosen_seeds(tmp_path)["A"]["L", "30"].shadows) == 2


def test_a_dark_correction_takes_the_shadows_of_the_seed(tmp_path):
    write(tmp_path, "03_A_off_30_L_0256")
    nothing = np.zeros((0, 4))
    edited = {PhotoKey.parse("03_A_on_30_L_0032"): AnnotatedBoxes(np.array([ROCK + 7, ROCK + 300]), nothing)}
    annotated = chosen_seeds(tmp_path, edited, shadow_start_ms=128)["A"]["L", "30"]
    np.testing.assert_allclose(annotated.rocks[0], ROCK + 7)
    np.testing.assert_allclose(annotated.shadows, [SHADOW], atol=0.01)
    edited = {PhotoKey.parse("03_A_on_30_L_0256"): AnnotatedBoxes(np.array([ROCK]), nothing)}
    assert len(chosen_seeds(tmp_path, edited, shadow_start_ms=128)["A"]["L", "30"].shadows) == 0


def test_a_dark_seed_without_shadows_has_unknown_shadows(tmp_path):
    write(tmp_path, "03_A_off_30_L_0064", shadows=0)
    assert chosen_seeds(tmp_path, shadow_start_ms=128)["A"]["L", "30"].shadows is None
    assert len(chosen_seeds(tmp_path, shadow_start_ms=32)["A"]["L", "30"].shadows) == 0


def test_cameras_are_sorted_by_number_of_annotations():
    assert sort_by_camera([("R", "30"), ("L", "30"), ("R", "180")])[0][0] == "R"
    assert sort_by_camera([("R", "30"), ("L", "180")])[0][0] == "L"


def starts_of(folder, key):
    return MinExposures.of(read_seeds(folder, 3, polar().images.size), 128, 2048).of_shadows(PhotoKey.parse(key))


def test_the_minimum_shadow_exposure_follows_the_annotation_or_the_default(tmp_path):
    write(tmp_path, "03_A_off_30_L_0256")
    write(tmp_path, "03_A_off_30_L_0032", shadows=0)
    write(tmp_path, "03_A_on_no_L_0032")  # shadows of the rover light are ignored
    assert starts_of(tmp_path, "03_A_off_30_L_0064") == 128
    write(tmp_path, "03_C_off_180_L_0032")
    assert starts_of(tmp_path, "03_C_off_180_L_0064") == 32


def test_a_single_early_seed_affects_only_its_bracket(tmp_path):
    for position in "ABC":
        for azimuth in ("30", "180", "270", "350"):
            early = (position, azimuth) == ("B", "180")
            write(tmp_path, f"03_{position}_off_{azimuth}_L_{'0032' if early else '0256'}")
    assert starts_of(tmp_path, "03_B_off_180_L_0064") == 32
    for other in ("03_B_off_180_R_0064", "03_B_on_180_L_0064", "03_B_off_30_L_0064", "03_A_off_180_L_0064"):
        assert starts_of(tmp_path, other) == 128


def test_the_median_of_a_position_applies_to_unannotated_brackets(tmp_path):
    for azimuth, exposure in (("30", "0064"), ("180", "0064"), ("270", "0064"), ("350", "0256")):
        write(tmp_path, f"03_B_off_{azimuth}_L_{exposure}")
    assert starts_of(tmp_path, "03_B_on_30_R_0064") == 64
    assert starts_of(tmp_path, "03_B_off_350_L_0064") == 128
