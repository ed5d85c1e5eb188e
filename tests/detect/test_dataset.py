import numpy as np
import pandas as pd
import pytest
import yaml

from polarsim.detect.dataset import make_dataset, picture_paths, read_pictures
from polarsim.detect.options import DetectOptions
from polarsim.detect.split import draw_split, split_photos
from polarsim.errors import DetectError, FormatError
from polarsim.formats import png, tables, yolo

OPTIONS = DetectOptions(imgsz=160)


@pytest.fixture
def few(keys):
    return keys[:8]


@pytest.fixture
def made(world, few, tmp_path):
    """Make a data set of the small world with changes to the call; returns its folder."""

    def make(options=OPTIONS, keys=few, **changes):
        split_photos(keys=list(keys), split=tmp_path / "split.csv", options=options)
        arguments = {"pictures": world / "photos.parquet", "labels": world / "labels.parquet"} | changes
        make_dataset(
            domain="real", split=tmp_path / "split.csv", dataset=tmp_path / "real", options=options, **arguments
        )
        return tmp_path / "real"

    return make


def test_every_picture_lies_in_its_part_with_its_labels(few, made):
    folder = made()
    for key, part in draw_split(few, OPTIONS).items():
        assert png.read(folder / "images" / part / f"{key}.png").shape == (100, 160)  # 1216 / 1936 of 160 is 100.5
        assert (folder / "labels" / part / f"{key}.txt").is_file()


def test_labels_are_those_of_the_table(made, world):
    folder = made()
    key = read_pictures(folder, "test")[0]
    classes, boxes = yolo.read_boxes(folder / "labels" / "test" / f"{key}.txt")
    rows = tables.read_parquet(world / "labels.parquet")
    rows = rows[rows["key"] == key]
    assert sorted(classes) == [0] * 5 + [1] * 5
    expected = np.clip(rows.loc[rows["kind"] == "shadow", ["x0", "y0", "x1", "y1"]], 0, [1936, 1216, 1936, 1216])
    np.testing.assert_allclose(boxes[classes == 1], expected, atol=0.01)


def test_a_bright_blob_is_where_its_label_says(made):
    folder = made()
    key = read_pictures(folder, "train")[0]
    picture = png.read(folder / "images" / "train" / f"{key}.png")
    classes, boxes = yolo.read_boxes(folder / "labels" / "train" / f"{key}.txt")
    for kind, box in zip(classes, boxes * 160 / 1936, strict=True):
        inside = picture[round(box[1]) + 1 : round(box[3]) - 1, round(box[0]) + 1 : round(box[2]) - 1]
        assert (inside > 200).all() if kind == 0 else (inside < 100).all()


def test_data_yaml_has_relative_paths_to_folders_that_are_there(made):
    folder = made()
    content = yaml.safe_load((folder / "data.yaml").read_text())
    assert content["names"] == {0: "rock", 1: "shadow"}
    assert all((folder / content[part]).is_dir() for part in ("train", "val", "test"))


def test_twins_in_a_folder_give_the_same_data_set_as_the_photo_table(made, world):
    from_table = {path.name: path.read_bytes() for path in made().glob("images/*/*")}
    from_folder = {path.name: path.read_bytes() for path in made(pictures=world / "twins").glob("images/*/*")}
    assert from_folder == from_table


def test_a_missing_picture_is_a_gap_and_a_warning(few, made, world, tmp_path, caplog):
    photos = tables.read_parquet(world / "photos.parquet")
    tables.write_parquet(tmp_path / "fewer.parquet", photos.iloc[1:])
    folder = made(pictures=tmp_path / "fewer.parquet")
    listed = {key for part in ("train", "val", "test") for key in read_pictures(folder, part)}
    assert listed == {str(key) for key in few[1:]}
    assert "1 of 8 pictures" in caplog.text


def test_a_photo_without_labels_gets_an_empty_file(few, made, world, tmp_path):
    rows = tables.read_parquet(world / "labels.parquet")
    key = str(few[0])
    tables.write_parquet(tmp_path / "labels.parquet", rows[rows["key"] != key])
    (path,) = made(labels=tmp_path / "labels.parquet").glob(f"labels/*/{key}.txt")
    assert path.read_text() == ""


def test_dark_pictures_are_left_out_where_asked(made, world, tmp_path):
    photos = tables.read_parquet(world / "photos.parquet")
    dark = tmp_path / "dark.png"
    png.write(dark, np.full((1216, 1936), 20, np.uint16))  # 4 DN above black
    photos.loc[3, "path"] = str(dark)
    tables.write_parquet(tmp_path / "photos.parquet", photos)
    folder = made(OPTIONS.model_copy(update={"min_mean_dn": 5}), pictures=tmp_path / "photos.parquet")
    assert not list(folder.glob(f"images/*/{photos['key'][3]}.png"))
    assert len(list(folder.glob("images/*/*.png"))) == 7


def test_full_size_pictures_are_kept_where_asked(few, made):
    folder = made(OPTIONS.model_copy(update={"downsize": False}), keys=few[:4])
    assert png.read(next(folder.glob("images/train/*.png"))).shape == (1216, 1936)


def test_a_broken_picture_is_named_and_nothing_is_left(made, world, tmp_path):
    photos = tables.read_parquet(world / "photos.parquet")
    bad = tmp_path / "bad.png"
    bad.write_bytes(b"\x89PNG no more")
    photos.loc[0, "path"] = str(bad)
    tables.write_parquet(tmp_path / "photos.parquet", photos)
    with pytest.raises(FormatError, match=r"bad\.png"):
        made(pictures=tmp_path / "photos.parquet")
    assert not [path for path in tmp_path.iterdir() if "real" in path.name]


def test_a_domain_without_pictures_is_refused(made, tmp_path):
    tables.write_parquet(tmp_path / "none.parquet", pd.DataFrame({"key": ["x"], "path": ["y"]}))
    with pytest.raises(DetectError, match="no real picture in the train part"):
        made(pictures=tmp_path / "none.parquet")


def test_pictures_of_a_folder_are_found_by_terrain_and_key(few, world):
    assert picture_paths(world / "twins", few[:1]) == {few[0]: world / "twins" / "Terrain01" / "01_A_off_30_L_0064.png"}
