import shutil

import numpy as np
import pandas as pd
import pytest
import yaml

from polarsim.detect.dataset import count_left_out, dataset_images, make_dataset, mix_datasets, share_pictures
from polarsim.detect.options import PicturesOptions, SplitOptions
from polarsim.detect.pictures import convert_photos
from polarsim.detect.split import draw_split, split_photos
from polarsim.errors import DetectError
from polarsim.formats import png, tables, yolo
from polarsim.formats.files import read_json
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH

OPTIONS, SPLIT = PicturesOptions(imgsz=160), SplitOptions()


@pytest.fixture
def few(keys):
    return keys[:8]


@pytest.fixture
def made(world, few, tmp_path):
    """Make a data set with changed arguments; return the folder."""

    def make(options=OPTIONS, keys=few, **changes):
        split_photos(keys=list(keys), by="photo", split=tmp_path / "split.csv", options=SPLIT)
        arguments = {"pictures": world / "photos.parquet", "labels": world / "labels.parquet"} | changes
        make_dataset(
            domain="real",
            split=tmp_path / "split.csv",
            dataset=tmp_path / "real",
            size=(WIDTH, HEIGHT),
            options=options,
            **arguments,
        )
        return tmp_path / "real"

    return make


def test_images_and_labels_of_every_part_agree_with_the_table(few, made, world):
    folder = made()
    table = tables.read_parquet(world / "labels.parquet")
    for key, part in draw_split(few, "photo", SPLIT).items():
        picture = png.read_png(folder / "images" / part / f"{key}.png")
        assert picture.shape == (100, 160)  # 1216 / 1936 of 160 is 100.5
        classes, boxes = yolo.read_boxes(folder / "labels" / part / f"{key}.txt", size=SIZE)
        assert sorted(classes) == [0] * 5 + [1] * 5
        rows = table[(table["key"] == str(key)) & (table["kind"] == "shadow")]
        expected = np.clip(rows[["x0", "y0", "x1", "y1"]], 0, [1936, 1216, 1936, 1216])
        np.testing.assert_allclose(boxes[classes == 1], expected, atol=0.01)
        for kind, box in zip(classes, boxes * 160 / 1936, strict=True):
            inside = picture[round(box[1]) + 1 : round(box[3]) - 1, round(box[0]) + 1 : round(box[2]) - 1]
            right = inside > 200 if kind == 0 else inside < 100
            assert right.mean() > 0.5  # the next rock may hide a part of a shadow
            assert right.all() or str(key) != dataset_images(folder, "train")[0]


def test_a_packed_data_set_contains_images_and_no_absolute_path(made, tmp_path):
    packed = shutil.make_archive(str(tmp_path / "packed"), "tar", made())  # keeps links as links, as zip does not
    shutil.rmtree(tmp_path / "real")
    there = tmp_path / "elsewhere"
    shutil.unpack_archive(packed, there)
    content = yaml.safe_load((there / "data.yaml").read_text())
    assert content["names"] == {0: "rock", 1: "shadow"}
    for part in ("train", "val", "test"):
        assert not content[part].startswith("/")
        pictures = sorted((there / content[part]).iterdir())
        assert pictures
        for picture in pictures:
            assert not picture.is_symlink()
            assert png.read_png(picture).size
            assert (there / "labels" / part / f"{picture.stem}.txt").is_file()


def test_twins_in_a_folder_give_the_same_data_set_as_the_photo_table(made, world):
    from_table = {path.name: path.read_bytes() for path in made().glob("images/*/*")}
    from_folder = {path.name: path.read_bytes() for path in made(pictures=world / "twins").glob("images/*/*")}
    assert from_folder == from_table


def test_a_missing_image_is_skipped_with_a_warning(few, made, world, tmp_path, caplog):
    photos = tables.read_parquet(world / "photos.parquet")
    tables.write_parquet(tmp_path / "fewer.parquet", photos.iloc[1:])
    folder = made(pictures=tmp_path / "fewer.parquet")
    listed = {key for part in ("train", "val", "test") for key in dataset_images(folder, part)}
    assert listed == {str(key) for key in few[1:]}
    assert "1 of 8" in caplog.text


def test_a_photo_without_labels_gets_an_empty_file(few, made, world, tmp_path):
    rows = tables.read_parquet(world / "labels.parquet")
    key = str(few[0])
    tables.write_parquet(tmp_path / "labels.parquet", rows[rows["key"] != key])
    (path,) = made(labels=tmp_path / "labels.parquet").glob(f"labels/*/{key}.txt")
    assert path.read_text() == ""


def test_pictures_are_stored_no_larger_than_the_photo(few, made):
    folder = made(OPTIONS.model_copy(update={"stored_px": 5000}), keys=few[:4])
    assert png.read_png(next(folder.glob("images/train/*.png"))).shape == (1216, 1936)


def test_a_domain_without_pictures_is_refused(made, tmp_path):
    tables.write_parquet(tmp_path / "none.parquet", pd.DataFrame({"key": ["x"], "path": ["y"]}))
    with pytest.raises(DetectError):
        made(pictures=tmp_path / "none.parquet")


@pytest.fixture(scope="module")
def converted(world, keys, tmp_path_factory):
    """Folder with converted photos and twins; one twin is corrupt."""
    root = tmp_path_factory.mktemp("converted")
    shutil.copytree(world / "twins", root / "twins")
    corrupt = root / "twins" / "Terrain01" / f"{keys[0]}.png"
    corrupt.write_bytes(corrupt.read_bytes()[:5000])
    for domain, pictures in (("real", world / "photos.parquet"), ("hapke", root / "twins")):
        convert_photos(
            domain=domain,
            pictures=pictures,
            labels=world / "labels.parquet",
            keys=keys,
            size=(WIDTH, HEIGHT),
            folder=root / domain,
            options=OPTIONS,
        )
    return root


@pytest.fixture
def share(converted, keys, tmp_path):
    """Divide the images of a domain by a split; return the folder of the data set."""

    def share(domain, by="photo", options=SPLIT):
        split_photos(keys=keys, by=by, split=tmp_path / f"{by}.csv", options=options)
        dataset = tmp_path / by / domain
        sources = {"pictures": converted / domain, "split": tmp_path / f"{by}.csv"}
        share_pictures(domain=domain, by=by, dataset=dataset, options=options, **sources)
        return dataset

    return share


def test_data_sets_of_two_splits_have_one_picture(share, converted, keys):
    for by in ("photo", "terrain"):
        for part in ("train", "val", "test"):
            for path in (share("real", by) / "images" / part).iterdir():
                assert path.samefile(converted / "real" / "images" / path.name)


def test_a_corrupt_picture_is_counted_in_its_part(share, keys):
    folder = share("hapke")
    part = draw_split(keys, "photo", SPLIT)[keys[0]]
    assert str(keys[0]) not in dataset_images(folder, part)
    assert read_json(folder / "dataset.json")["left_out"] == {"train": 0, "val": 0, "test": 0} | {part: 1}
    assert [count_left_out(folder, [one]) for one in ("train", "val", "test")] == [
        int(one == part) for one in ("train", "val", "test")
    ]
    assert count_left_out(share("real"), ("train", "val", "test")) == 0


@pytest.fixture
def mix(share, tmp_path):
    """Mix the two domains with weights; return the folder of the data set."""

    def mix(weights, by="photo"):
        datasets = {domain: share(domain, by) for domain in weights}
        mix_datasets(domain="mixed", weights=weights, datasets=datasets, dataset=tmp_path / "mixed", options=SPLIT)
        return tmp_path / "mixed"

    return mix


@pytest.mark.parametrize(("real", "hapke"), [(0.5, 0.5), (1.5, 0.1)])
def test_a_mix_has_images_in_proportion_to_the_weights(mix, share, real, hapke):
    weights = {"real": real, "hapke": hapke}
    folder = mix(weights)
    names = dataset_images(folder, "train")
    for domain, weight in weights.items():
        whole = len(dataset_images(share(domain), "train"))
        assert sum(name.startswith(f"{domain}-") for name in names) == round(weight * whole)
    assert len(set(names)) == len(names)


def test_a_mix_has_only_training_images_of_its_domains(mix, share, converted, keys):
    folder = mix({"real": 2, "hapke": 0.5})
    twice = {name for key in dataset_images(share("real"), "train") for name in (f"real-{key}", f"real-{key}-2")}
    assert {name for name in dataset_images(folder, "train") if name.startswith("real-")} == twice
    tested = {str(key) for key, part in draw_split(keys, "photo", SPLIT).items() if part == "test"}
    for part in ("train", "val"):
        for name in dataset_images(folder, part):
            domain, key = name.split("-")[:2]
            for kind, ending in (("images", "png"), ("labels", "txt")):
                assert (folder / kind / part / f"{name}.{ending}").samefile(
                    converted / domain / kind / f"{key}.{ending}"
                )
            assert key not in tested
    assert dataset_images(folder, "test") == []


def test_a_mix_counts_corrupt_training_images(mix, share, keys):
    part = draw_split(keys, "photo", SPLIT)[keys[0]]
    assert count_left_out(mix({"real": 1, "hapke": 1}), ("train", "val")) == (part != "test")
