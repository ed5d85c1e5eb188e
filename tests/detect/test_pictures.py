import json
import shutil

import cv2
import numpy as np
import pandas as pd
import pytest

from polarsim.detect.dataset import dataset_images, share_pictures
from polarsim.detect.options import PicturesOptions, SplitOptions
from polarsim.detect.pictures import convert_photos, convert_views, read_states
from polarsim.detect.split import split_photos
from polarsim.errors import DetectError, FormatError
from polarsim.formats import png, tables, yolo
from polarsim.formats.files import read_json
from polarsim.photo import GREY_VALUES, ROCK, SHADOW
from polarsim.run_files import class_masks
from polarsim.run_files.instances import GROUND, ROCK_IDS, SHADOW_IDS
from tests.detect.conftest import blobs
from tests.support.polar_photos import HEIGHT, WIDTH

OPTIONS = PicturesOptions(imgsz=160)


@pytest.fixture
def few(keys):
    return keys[:4]


@pytest.fixture
def twins(world, tmp_path):
    """Copy of the twins, for tests that corrupt files."""
    shutil.copytree(world / "twins", tmp_path / "twins")
    return tmp_path / "twins"


@pytest.fixture
def states(world, few, tmp_path):
    """Convert images; return key -> state."""

    def convert(pictures, labels=None, options=OPTIONS):
        convert_photos(
            domain="hapke",
            pictures=pictures,
            labels=labels or world / "labels.parquet",
            keys=few,
            size=(WIDTH, HEIGHT),
            folder=tmp_path / "made",
            options=options,
        )
        return dict(read_states(tmp_path / "made")[["key", "state"]].to_numpy().tolist())

    return convert


def path_of(twins, key):
    return twins / f"Terrain{key.terrain:02d}" / f"{key}.png"


SPOILS = {
    "cut": lambda content: content[:-2000],
    "bit": lambda content: bytes(byte ^ (number == len(content) // 2) for number, byte in enumerate(content)),
    "size": lambda _: encoded(np.full((20, 30), 100, np.uint16)),
    "depth": lambda _: encoded(np.full((1216, 1936), 100, np.uint8)),
    "kind": lambda _: b"GIF89a",
}


def encoded(pixels):
    return cv2.imencode(".png", pixels)[1].tobytes()


@pytest.mark.parametrize("spoil", SPOILS.values(), ids=list(SPOILS))
def test_a_corrupt_image_is_reported_skipped_and_counted(states, twins, few, tmp_path, caplog, spoil):
    path_of(twins, few[1]).write_bytes(spoil(path_of(twins, few[1]).read_bytes()))
    found = states(twins)
    assert found == dict.fromkeys(map(str, few), "used") | {str(few[1]): "corrupt"}
    assert [line.count(str(path_of(twins, few[1]))) for line in caplog.messages if "skipped" in line] == [1]
    assert not (tmp_path / "made" / "images" / f"{few[1]}.png").exists()
    assert read_json(tmp_path / "made" / "domain.json")["pictures"] == {
        "used": 3,
        "missing": 0,
        "corrupt": 1,
    }


@pytest.mark.parametrize("broken", [{"x0": np.nan}, {"x0": 500.0, "x1": 400.0}, {"y1": np.inf}])
def test_a_photo_with_an_invalid_box_is_skipped(states, world, few, tmp_path, caplog, broken):
    table = tables.read_parquet(world / "labels.parquet")
    row = table.index[table["key"] == str(few[2])][3]
    table.loc[row, list(broken)] = list(broken.values())
    tables.write_parquet(tmp_path / "labels.parquet", table)
    found = states(world / "photos.parquet", tmp_path / "labels.parquet")
    assert found == dict.fromkeys(map(str, few), "used") | {str(few[2]): "corrupt"}
    assert f"labels.parquet: {few[2]}: " in caplog.text


def test_missing_images_are_not_corrupt(states, twins, few):
    path_of(twins, few[0]).unlink()
    assert list(states(twins).values()) == ["missing", "used", "used", "used"]


def test_a_label_table_with_an_unknown_kind_is_refused(states, world, tmp_path):
    table = tables.read_parquet(world / "labels.parquet").replace({"kind": {"rock": "crater"}})
    tables.write_parquet(tmp_path / "labels.parquet", table)
    with pytest.raises(DetectError):
        states(world / "photos.parquet", tmp_path / "labels.parquet")


VIEWED = {"near": [1], "far": [4], "both": [1, 4]}  # scene -> terrains
SIZE = (640, 480)


@pytest.fixture
def views(tmp_path):
    """Write the required output of `polarsim render VIEWS.yaml`: three scenes, four cameras, two exposures."""
    root, rows = tmp_path / "views", []
    for scene, terrains in VIEWED.items():
        for camera in range(4):
            for exposure in (256, 512):
                name = f"{scene}_cam-{camera}_lamp_off_hapke_{exposure:04d}"
                rows.append({"name": name, "scene": scene, "camera": f"cam-{camera}", "exposure_ms": exposure})
                pixels = np.full(SIZE[::-1], 16 + 4 * exposure, np.uint16)
                png.write_png(root / "images" / f"{name}.png", pixels)
                yolo.write_boxes(root / "labels" / f"{name}.txt", [0], [[64, 48, 128, 96]], SIZE)
                (root / "sidecars").mkdir(exist_ok=True)
                sections = [{"terrain": terrain} for terrain in terrains]
                (root / "sidecars" / f"{name}.json").write_text(json.dumps({"terrains": sections}))
    tables.write_csv(root / "index.csv", pd.DataFrame(rows))
    return root


@pytest.fixture
def shared_views(views, keys, tmp_path):
    """Convert and divide the views; return the folder of the data set."""

    def share(by, options=OPTIONS, **changes):
        convert_views(views=views, folder=tmp_path / "made", options=options)
        split = SplitOptions(**changes)
        split_photos(keys=keys, by=by, split=tmp_path / "split.csv", options=split)
        share_pictures(
            domain="views",
            pictures=tmp_path / "made",
            split=tmp_path / "split.csv",
            by=by,
            dataset=tmp_path / "dataset",
            options=split,
        )
        return tmp_path / "dataset"

    return share


def test_novel_views_of_any_size_keep_their_labels(shared_views):
    folder = shared_views("photo")
    name = dataset_images(folder, "train")[0]
    assert png.read_png(folder / "images" / "train" / f"{name}.png").shape == (120, 160)
    classes, found = yolo.read_boxes(folder / "labels" / "train" / f"{name}.txt", SIZE)
    assert classes.tolist() == [0]
    np.testing.assert_allclose(found, [[64, 48, 128, 96]], atol=0.01)


def test_all_novel_views_of_a_camera_are_in_one_part(shared_views):
    folder = shared_views("view")
    cameras = {
        part: {name[: name.index("_lamp")] for name in dataset_images(folder, part)} for part in ("train", "val")
    }
    assert not cameras["train"] & cameras["val"]
    assert len(cameras["train"] | cameras["val"]) == 12
    assert dataset_images(folder, "test") == []


def test_novel_views_of_a_test_terrain_are_excluded(shared_views):
    folder = shared_views("terrain", test_terrains=(4,))
    assert {name.split("_")[0] for part in ("train", "val") for name in dataset_images(folder, part)} == {"near"}


def test_a_view_with_an_invalid_label_file_is_skipped(views, tmp_path, caplog):
    bad = next((views / "labels").glob("near_cam-1_*.txt"))
    bad.write_text("0 0.5 0.5 0.1\n")
    convert_views(views=views, folder=tmp_path / "made", options=OPTIONS)
    table = read_states(tmp_path / "made")
    assert table.loc[table["state"] == "corrupt", "key"].tolist() == [bad.stem]
    assert f"{bad}:1: 4 fields" in caplog.text


def test_a_folder_without_views_is_an_error(tmp_path):
    with pytest.raises(FormatError, match=r"index\.csv"):
        convert_views(views=tmp_path, folder=tmp_path / "made", options=OPTIONS)


def test_masks_of_photos_and_twins_are_converted(world, keys, tmp_path):
    """One photo has a grey map, the remaining photos have instance maps in which rock 5 is unlabelled."""
    photos = keys[:9:3]  # from different brackets
    table = tables.read_parquet(world / "labels.parquet")
    tables.write_parquet(tmp_path / "labels.parquet", table[table["rock"] != 5])
    folder = tmp_path / f"Terrain{photos[0].terrain:02d}"
    for key in photos:
        png.write_png(folder / f"{str(key).rpartition('_')[0]}.png", instance_map(key))
    grey = np.full((HEIGHT, WIDTH), GREY_VALUES["ground"], np.uint8)
    grey[:608, :968], grey[608:, :968], grey[:, 1500:] = (GREY_VALUES[kind] for kind in (ROCK, SHADOW, "background"))
    png.write_png(folder / f"{photos[0]}.png", grey)
    convert_photos(
        domain="hapke", pictures=world / "twins", labels=tmp_path / "labels.parquet", keys=photos, size=(WIDTH, HEIGHT),
        folder=tmp_path / "made", options=OPTIONS, masks=[folder],
    )  # fmt: skip
    for key in photos:
        mask = class_masks.read_class_mask(tmp_path / f"made/masks/{key}.png")
        assert mask.shape == png.read_png(tmp_path / f"made/images/{key}.png").shape
        whole = class_masks.of_grey_map(grey) if key == photos[0] else class_mask(key)
        shares = [[np.mean(one == number) for number in (0, 1, 2, class_masks.IGNORED)] for one in (mask, whole)]
        np.testing.assert_allclose(*shares, atol=0.005)


def test_an_image_without_mask_is_skipped_with_a_warning(world, few, tmp_path, caplog):
    (tmp_path / f"Terrain{few[0].terrain:02d}").mkdir()
    convert_photos(
        domain="hapke", pictures=world / "twins", labels=world / "labels.parquet", keys=few, size=(WIDTH, HEIGHT),
        folder=tmp_path / "made", options=OPTIONS, masks=list(tmp_path.glob("Terrain*")),
    )  # fmt: skip
    assert set(read_states(tmp_path / "made")["state"]) == {"corrupt"}
    assert f"{str(few[0]).rpartition('_')[0]}.png" in caplog.text


def boxes_of(key):
    """Return kind, rock and integer pixels x0, y0, x1, y1 of the objects of a photo."""
    for row in blobs(key)[1]:
        yield row["kind"], row["rock"], [round(row[edge]) for edge in ("x0", "y0", "x1", "y1")]


def instance_map(key):
    ids = np.full((HEIGHT, WIDTH), GROUND, np.uint16)
    for kind, rock, (x0, y0, x1, y1) in boxes_of(key):
        ids[y0:y1, x0:x1] = rock + (ROCK_IDS if kind == ROCK else SHADOW_IDS)
    return ids


def class_mask(key):
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    for kind, rock, (x0, y0, x1, y1) in boxes_of(key):
        mask[y0:y1, x0:x1] = class_masks.IGNORED if rock == 5 else 1 + (kind == SHADOW)
    return mask
