"""A YOLO data set of a run is complete after packing and unpacking."""

import shutil

import yaml

from polarsim.detect.dataset import make_dataset
from polarsim.detect.options import DetectOptions
from polarsim.detect.split import split_photos
from polarsim.formats import png

OPTIONS = DetectOptions()


def test_a_packed_data_set_contains_images_and_no_absolute_path(world, keys, tmp_path):
    split_photos(keys=keys[:8], by="photo", split=tmp_path / "split.csv", options=OPTIONS.split)
    place = tmp_path / "run/datasets/real"
    make_dataset(
        domain="real", split=tmp_path / "split.csv", dataset=place, options=OPTIONS.pictures,
        pictures=world / "photos.parquet", labels=world / "labels.parquet",
    )  # fmt: skip
    packed = shutil.make_archive(str(tmp_path / "real"), "tar", place)  # keeps links as links, as zip does not
    shutil.rmtree(tmp_path / "run")
    there = tmp_path / "elsewhere"
    shutil.unpack_archive(packed, there)
    content = yaml.safe_load((there / "data.yaml").read_text())
    for part in ("train", "val", "test"):
        assert not content[part].startswith("/")
        pictures = sorted((there / content[part]).iterdir())
        assert pictures
        for picture in pictures:
            assert not picture.is_symlink()
            assert png.read_png(picture).size
            assert (there / "labels" / part / f"{picture.stem}.txt").is_file()
