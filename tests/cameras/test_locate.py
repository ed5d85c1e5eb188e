import logging

import numpy as np
import pandas as pd
import pycolmap
import pytest

from polarsim.cameras.labels import MIN_FIT
from polarsim.cameras.locate import locate_cameras
from polarsim.cameras.options import LocalisationOptions
from polarsim.errors import FormatError, RegistrationError
from polarsim.formats import nasa, obj, yolo
from polarsim.geometry.poses import angle_between
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.rigs import SURVEYED, UNCERTAIN_LABELS, read_all_localised, write_rig
from polarsim.schemas.stages import ALIGNMENT, MATCHES
from polarsim.site import polar
from tests.support.polar_photos import SIZE
from tests.support.polar_rig import default_rig

pytestmark = pytest.mark.usefixtures("coarse_search", "coarse_scans")


def locate(folder, inventory, rig, positions="ABC", seeds=None, name="cameras"):
    write_inventory(folder / "inventory.json", inventory)
    write_rig(folder / "calibration.json", rig, "test")
    locate_cameras(
        site=polar(),
        terrain=inventory.terrain,
        positions=list(positions),
        inventory=folder / "inventory.json",
        calibration=folder / "calibration.json",
        seeds=seeds or folder / "seeds",
        cameras=folder / name,
        options=LocalisationOptions(),
    )
    return read_all_localised(folder / name)


def contents(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.fixture(scope="module")
def scanned(tmp_path_factory, range_maps):
    """An inventory of range maps of A and C."""
    folder, paths = tmp_path_factory.mktemp("scanned"), {}
    for position, points in range_maps.items():
        paths[position] = str(folder / f"Pos{position}_org-XYZ.tif")
        nasa.write_range_map(paths[position], points)
    return Inventory(terrain=3, kind="files", range_maps=paths)


@pytest.fixture
def annotated(tmp_path, labelled):
    """An inventory of rock meshes, and seeds of one azimuth in a folder: A and B with boxes, C with too few."""
    (tmp_path / "meshes").mkdir()
    meshes = {}
    for rock, mesh in labelled.meshes.items():
        path = tmp_path / "meshes" / obj.rock_name(3, rock)
        obj.write_obj(path, mesh, path.stem)
        meshes[str(rock)] = str(path)
    (tmp_path / "seeds").mkdir()
    for position, boxes in (("A", labelled.seen("A")), ("B", labelled.seen("B")), ("C", labelled.seen("C")[:2])):
        classes = np.append(np.zeros(len(boxes), int), 1)  # and a shadow
        shadow = np.array([[300.0, 300, 900, 900]])
        path = tmp_path / "seeds" / f"03_{position}_off_30_L_0256.txt"
        yolo.write_boxes(path, classes, np.concatenate([boxes, shadow]), size=SIZE)
    return Inventory(terrain=3, kind="release", meshes=meshes)


@pytest.mark.slow
def test_scans_localise_their_rigs_and_the_survey_localises_the_rest(tmp_path, scanned, sandbox, true_poses, caplog):
    with caplog.at_level(logging.WARNING):
        localised = locate(tmp_path, scanned, sandbox.rig)
    assert {position: one.method for position, one in localised.items()} == {"A": "scans", "B": "survey", "C": "scans"}
    assert [record.message[:10] for record in caplog.records] == ["position B"]
    found, true = (
        poses["A"].inverse() @ poses["C"]
        for poses in ({p: one.sandbox_from_left for p, one in localised.items()}, true_poses)
    )
    assert np.linalg.norm(found.translation - true.translation) < 0.002
    assert np.degrees(angle_between(found, true)) < 0.03
    assert np.linalg.norm(localised["A"].sandbox_from_left.translation - true_poses["A"].translation) < 0.015
    table = pd.read_csv(tmp_path / "cameras" / "alignment.csv")
    assert table.dtypes.astype(str).to_dict() == ALIGNMENT.dtypes
    assert table["pair"].tolist() in (["A-C"], ["C-A"])
    image = pycolmap.Reconstruction(str(tmp_path / "cameras" / "colmap")).find_image_with_name("PosB_CamL")
    expected = localised["B"].sandbox_from_left.inverse().matrix
    np.testing.assert_allclose(image.cam_from_world().matrix(), expected[:3], atol=1e-9)
    locate(tmp_path, scanned, sandbox.rig, name="again")
    assert contents(tmp_path / "again") == contents(tmp_path / "cameras")


def test_a_scan_of_a_wall_leaves_its_position_to_the_survey(tmp_path, scanned, sandbox, range_maps, caplog):
    flat = range_maps["C"] * (2.8 / range_maps["C"][..., 2:])  # every beam ends at a wall 2.8 m in front of the camera
    nasa.write_range_map(tmp_path / "flat.tif", flat)
    maps = {**scanned.range_maps, "C": str(tmp_path / "flat.tif")}
    with caplog.at_level(logging.WARNING):
        localised = locate(tmp_path, Inventory(terrain=3, kind="files", range_maps=maps), sandbox.rig, "AC")
    assert {position: one.method for position, one in localised.items()} == {"A": "scans", "C": "survey"}
    assert "the scan of position C" in caplog.text
    assert "position C has" in caplog.text


def test_a_single_scan_is_registered(tmp_path, scanned, sandbox, true_poses):
    alone = Inventory(terrain=3, kind="files", range_maps={"A": scanned.range_maps["A"]})
    localised = locate(tmp_path, alone, sandbox.rig, "A")["A"]
    assert localised.method == "scans"
    assert np.linalg.norm(localised.sandbox_from_left.translation - true_poses["A"].translation) < 0.03
    assert len(pd.read_csv(tmp_path / "cameras" / "alignment.csv")) == 0


def test_labels_and_meshes_localise_rigs(tmp_path, annotated, true_poses, labelled, caplog):
    with caplog.at_level(logging.WARNING):
        localised = locate(tmp_path, annotated, default_rig())
    assert {position: one.method for position, one in localised.items()} == {
        "A": "labels",
        "B": "labels",
        "C": "survey",
    }
    assert "position C" in caplog.text
    for position in "AB":
        pose = localised[position].sandbox_from_left
        assert np.linalg.norm(pose.translation - true_poses[position].translation) < 0.06
        assert np.degrees(angle_between(pose, true_poses[position])) < 0.5
    # C has no evidence, but its surveyed pose gets the mean offset of A and B.
    assert np.linalg.norm(localised["C"].sandbox_from_left.translation - true_poses["C"].translation) < 0.7
    table = pd.read_parquet(tmp_path / "cameras" / "matches.parquet")
    assert table.dtypes.astype(str).to_dict() == MATCHES.dtypes
    rows = table[table["position"] == "A"]
    seeds = rows[["seed_x0", "seed_y0", "seed_x1", "seed_y1"]].to_numpy()
    np.testing.assert_allclose(seeds, labelled.boxes["A"][rows["rock"] - 1], atol=0.01)


def test_positions_without_any_pose_are_an_error_and_write_nothing(tmp_path):
    with pytest.raises(RegistrationError):
        locate(tmp_path, Inventory(terrain=13, kind="release"), default_rig(), "FG")
    assert not (tmp_path / "cameras").exists()
    assert not list(tmp_path.glob(".cameras*"))


def test_a_position_without_a_survey_is_left_to_photos(tmp_path, caplog):
    localised = locate(tmp_path, Inventory(terrain=6, kind="release"), default_rig(), "AF")
    assert set(localised) == {"A"}
    assert localised["A"].method == SURVEYED
    assert localised["A"].sandbox_from_left.translation[0] == pytest.approx(3.541)
    assert "position F" in caplog.text


def test_labels_of_another_terrain_localise_no_position(tmp_path, annotated, rng, caplog):
    for position in "AB":
        corner = rng.uniform([100, 300], [1700, 1000], (14, 2))
        boxes = np.column_stack([corner, corner + rng.uniform(30, 150, (14, 2))])
        yolo.write_boxes(tmp_path / "seeds" / f"03_{position}_off_30_L_0256.txt", np.zeros(14, int), boxes, size=SIZE)
    with caplog.at_level(logging.WARNING):
        localised = locate(tmp_path, annotated, default_rig())
    assert all(one.unproven for one in localised.values())
    assert "labels and meshes localise no position" in caplog.text
    for position in "ABC":
        assert f"position {position}" in caplog.text


def test_too_few_boxes_suggest_an_unconfirmed_pose(tmp_path, annotated, labelled, true_poses, caplog):
    rng = np.random.default_rng(508)
    corner = rng.uniform([100, 300], [1700, 1000], (8, 2))
    stones = np.column_stack([corner, corner + rng.uniform(30, 150, (8, 2))])  # annotated, but without a mesh
    boxes = np.concatenate([labelled.seen("A")[:5], stones])
    yolo.write_boxes(tmp_path / "seeds" / "03_A_off_30_L_0256.txt", np.zeros(len(boxes), int), boxes, size=SIZE)
    with caplog.at_level(logging.WARNING):
        localised = locate(tmp_path, annotated, default_rig())
    assert {position: one.method for position, one in localised.items()} == {
        "A": UNCERTAIN_LABELS,
        "B": "labels",
        "C": SURVEYED,
    }
    assert localised["A"].unproven
    assert not localised["B"].unproven
    assert localised["A"].metrics["share"] < MIN_FIT
    assert "position A" in caplog.text
    assert np.linalg.norm(localised["A"].sandbox_from_left.translation - true_poses["A"].translation) < 0.3
    assert np.degrees(angle_between(localised["A"].sandbox_from_left, true_poses["A"])) < 2
    assert set(pd.read_parquet(tmp_path / "cameras" / "matches.parquet")["position"]) == {"B"}


def test_a_broken_seed_names_its_file_and_line(tmp_path, annotated):
    (tmp_path / "seeds" / "03_B_off_30_L_0256.txt").write_text("0 0.5 0.5 nonsense 0.1\n")
    with pytest.raises(FormatError, match=r"03_B_off_30_L_0256\.txt:1"):
        locate(tmp_path, annotated, default_rig())
