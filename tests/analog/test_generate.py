import json
import shutil

import numpy as np
import pandas as pd
import pytest

from polarsim.analog.generate import generate_terrain
from polarsim.analog.options import AnalogOptions
from polarsim.errors import ConfigError
from polarsim.formats import nasa, obj, png, site_files, tables, yolo
from polarsim.formats.calibrations import read_calibration
from polarsim.formats.clouds import read_cloud
from polarsim.geometry.boxes import iou
from polarsim.geometry.stereo import rectified_left
from polarsim.photo import PhotoKey
from polarsim.run_files.rigs import read_localised
from polarsim.site import polar
from tests.support.polar_photos import SIZE

POLAR = polar()
TERRAIN = 11
KEYS = [PhotoKey.parse(text) for text in ("11_A_off_30_L_0064", "11_A_off_30_L_0256", "11_A_on_no_L_8192")]


def generate(root, options, keys=KEYS, terrain=TERRAIN, site=POLAR, threads=1):
    receipt = root.with_suffix(".json")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("polarsim.analog.bounce._BOUNCE_RAYS", 8)
        generate_terrain(
            site=site, root=root, receipt=receipt, terrain=terrain, keys=keys, options=options, threads=threads
        )


def files_of(root):
    return {str(path.relative_to(root)): path.read_bytes() for path in sorted(root.rglob("*")) if path.is_file()}


def find_scans(made):
    return site_files.find_range_maps(polar(), made, TERRAIN), site_files.find_clouds(polar(), made, TERRAIN)


@pytest.fixture(scope="module")
def made(tmp_path_factory, coarse):
    root = tmp_path_factory.mktemp("analog")
    generate(root, coarse)
    return root


@pytest.mark.slow
def test_photos_are_written_for_the_given_keys_only(made):
    photos = site_files.find_photos(polar(), made, TERRAIN)[0]
    assert [key for key, _ in photos] == sorted(KEYS)
    for _, path in photos:
        pixels = png.read_photo(path, (1936, 1216))
        assert np.percentile(pixels, 5) < 120  # shadows
        assert pixels.max() == 4095  # the near wall
    assert len({path.name.split("_")[1] for _, path in photos}) == len(photos)  # a unique token for each pair
    paths = dict(photos)
    short, long = (np.median(png.read_photo(paths[key], None).astype(float)[400:700]) - 16 for key in KEYS[:2])
    assert long == pytest.approx(4 * short, rel=0.1)


def test_the_terrain_has_the_layout_of_nasas_files(made):
    folder = site_files.find_terrain_folder(polar(), made, polar().files.photos, TERRAIN)
    assert folder.name == "Terrain11_FreshCrater"
    calibration = read_calibration(folder / "stereo.calibration", polar())
    assert abs(calibration.left.fx - 2068) < 25
    maps, clouds = find_scans(made)
    assert sorted(maps) == ["A", "B", "C"]
    assert sorted(clouds) == ["A", "C"]


@pytest.mark.parametrize("position", ["A", "B", "C"])
def test_range_maps_agree_with_the_true_ground_and_cameras(made, position):
    truth = made / "truth" / "Terrain11"
    localised = read_localised(truth / "cameras" / f"Pos{position}.json")
    calibration = read_calibration(site_files.find_calibration(polar(), made, TERRAIN), polar())
    grid = rectified_left(calibration)
    maps, _ = find_scans(made)
    points = nasa.read_range_map(maps[position], (1936, 1216))[::8, ::8].reshape(-1, 3)
    points = points[np.isfinite(points).all(axis=1)].astype(float)
    sandbox = (localised.sandbox_from_left @ grid.left_from_rectified).apply(points)
    inside = sandbox[(np.abs(sandbox[:, :2]).max(axis=1) < 1.8)]
    ground = obj.read_obj(truth / "meshes" / obj.ground_name(TERRAIN)).vertices
    from scipy.spatial import cKDTree

    _, near = cKDTree(ground[:, :2]).query(inside[:, :2])
    off = inside[:, 2] - ground[near, 2]
    assert len(inside) > 1000
    assert abs(np.median(off)) < 0.012  # registration error and noise
    assert np.percentile(np.abs(off), 80) < 0.03


def test_cloud_and_range_map_of_a_position_share_a_frame(made):
    maps, clouds = find_scans(made)
    cloud = read_cloud(clouds["A"])
    grid = rectified_left(read_calibration(site_files.find_calibration(polar(), made, TERRAIN), polar())).lens
    pixels = np.floor(grid.project(cloud))
    inside = (pixels >= 0).all(axis=1) & (pixels < [1936, 1216]).all(axis=1)
    column, row = pixels[inside].astype(int).T
    depth = nasa.read_range_map(maps["A"], (1936, 1216))[row, column, 2]
    assert np.nanmedian(np.abs(depth - cloud[inside][:, 2])) < 0.01


def test_truth_contains_lamps_rocks_and_meshes(made):
    truth = made / "truth" / "Terrain11"
    assert sorted(json.loads((truth / "lamps.json").read_text())) == [
        "180", "270", "30", "350", "rover_A", "rover_B", "rover_C",
    ]  # fmt: skip
    rocks = tables.read_parquet(truth / "rocks.parquet", ["rock", "x", "y", "z", "size_m", "height_m", "volume_m3"])
    meshes = obj.rock_files(truth / "meshes")
    assert sorted(meshes) == rocks["rock"].tolist() == list(range(1, 10))
    for row in rocks.itertuples():
        vertices = obj.read_obj(meshes[row.rock]).vertices
        np.testing.assert_allclose((vertices.min(axis=0) + vertices.max(axis=0)) / 2, [row.x, row.y, row.z], atol=1e-5)
        assert 0 < row.volume_m3 < np.prod(np.ptp(vertices, axis=0))
        assert 0 < row.height_m < 0.2


def test_true_labels_are_the_boxes_of_the_true_meshes(made):
    truth = made / "truth" / "Terrain11"
    labels = tables.read_parquet(truth / "labels.parquet", [*tables.LABEL_COLUMNS, "visible_px", "contrast"])
    assert set(labels["key"]) == {str(key) for key in KEYS}
    assert set(labels["kind"]) == {"rock", "shadow"}
    localised = read_localised(truth / "cameras" / "PosA.json")
    meshes = {rock: obj.read_obj(path).vertices for rock, path in obj.rock_files(truth / "meshes").items()}
    overlaps = []
    for row in labels[(labels["kind"] == "rock") & (labels["key"] == str(KEYS[0]))].itertuples():
        pixels = localised.project("L", meshes[row.rock])
        box = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
        overlaps.append(iou(box[None], np.array([[row.x0, row.y0, row.x1, row.y1]]))[0, 0])
    assert len(overlaps) >= 6
    assert np.median(overlaps) > 0.85  # some rocks are partly occluded


def test_there_is_one_seed_per_sun_close_to_the_truth(made):
    files = sorted((made / "Labels" / "Terrain11").iterdir())
    assert [path.name for path in files] == ["11_A_off_30_L_0256.txt"]
    classes, boxes = yolo.read_boxes(files[0], size=SIZE)
    labels = pd.read_parquet(made / "truth" / "Terrain11" / "labels.parquet")
    rocks = labels[(labels["key"] == files[0].stem) & (labels["kind"] == "rock")]
    best = iou(boxes[classes == 0], rocks[["x0", "y0", "x1", "y1"]].to_numpy()).max(axis=1)
    assert len(best) >= 2
    assert np.median(best) > 0.5
    assert best.max() < 1.0


def test_true_albedo_covers_all_visible_sand_and_rocks(made):
    truth = made / "truth" / "Terrain11"
    table = pd.read_parquet(truth / "albedo.parquet")
    assert list(table.columns) == ["rock", "x", "y", "z", "albedo", "pixels"]
    labels = pd.read_parquet(truth / "labels.parquet")
    assert set(labels["rock"]) <= set(table["rock"])
    assert table["pixels"].sum() > 0.5 * 1936 * 1216  # of a single photo, without the hall
    sand = table[table["rock"] == -1]
    assert np.average(sand["albedo"], weights=sand["pixels"]) == pytest.approx(0.19, rel=0.05)  # albedo of sand
    rocks = pd.read_parquet(truth / "rocks.parquet").set_index("rock")
    for rock, cubes in table[table["rock"] > 0].groupby("rock"):
        centre = rocks.loc[rock, ["x", "y", "z"]].to_numpy(float)
        assert np.linalg.norm(cubes[["x", "y", "z"]].to_numpy() - centre, axis=1).max() < rocks.loc[rock, "size_m"]


@pytest.mark.slow
def test_bytes_do_not_depend_on_threads_and_other_photos(tmp_path, coarse, made, monkeypatch):
    monkeypatch.setattr("polarsim.analog.generate._write_map", lambda *_: None)  # follows from clouds and cameras
    generate(tmp_path / "pair", coarse, [KEYS[1], PhotoKey.parse("11_A_off_30_R_0256")], threads=2)
    again, before = files_of(tmp_path / "pair"), files_of(made)
    of_photos = ("labels.parquet", "albedo.parquet")  # rows of the rendered photos
    names = [name for name in again if not name.endswith(of_photos) and "CamR" not in name]
    assert any("CamL" in name for name in names)
    assert [name for name in names if again[name] != before[name]] == []


def test_scans_and_truth_are_generated_without_photos(tmp_path, coarse, made, monkeypatch):
    monkeypatch.setattr("polarsim.analog.generate._start_scans", lambda *_: [])  # tested above
    generate(tmp_path / "none", coarse.model_copy(update={"photos": False}))
    again, before = files_of(tmp_path / "none"), files_of(made)
    assert [name for name in again if name.endswith(".png")] == []
    of_photos = ("labels.parquet", "albedo.parquet")
    assert [name for name, data in again.items() if data != before[name] and not name.endswith(of_photos)] == []
    assert len(pd.read_parquet(tmp_path / "none/truth/Terrain11/labels.parquet")) == 0


def test_an_unknown_terrain_and_keys_of_another_terrain_are_rejected(tmp_path):
    with pytest.raises(ConfigError):
        generate(tmp_path, AnalogOptions(), [], terrain=14)
    with pytest.raises(ConfigError):
        generate(tmp_path, AnalogOptions(), [next(polar().photos_of(3))])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("folder", ["Terrain11_FreshCrater/PosA_off_30", "Labels/Terrain11"])
def test_data_that_were_not_simulated_are_kept(tmp_path, folder):
    """A configuration with the folder of real data, but without `source.kind: files`, would replace them."""
    photo = tmp_path / "data" / folder / "any.png"
    photo.parent.mkdir(parents=True)
    photo.write_bytes(b"real")
    with pytest.raises(ConfigError, match=r"source\.kind: files") as error:
        generate(tmp_path / "data", AnalogOptions())
    assert error.value.path == tmp_path / "data" / folder.removesuffix("/PosA_off_30")
    assert files_of(tmp_path / "data") == {f"{folder}/any.png": b"real"}


@pytest.mark.slow
def test_an_earlier_simulation_is_replaced(tmp_path, coarse, made):
    shutil.copytree(made, tmp_path / "data")
    generate(tmp_path / "data", coarse, keys=KEYS[:1])
    assert [key for key, _ in site_files.find_photos(polar(), tmp_path / "data", TERRAIN)[0]] == KEYS[:1]
