"""All formats: reproducible bytes, resumed exports, errors, subsets."""

import hashlib
import json
import os
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from polarsim import extras
from polarsim.detect.tone import to_8_bits
from polarsim.errors import ConfigError, FormatError, PolarsimError
from polarsim.formats import png
from polarsim.formats.tables import write_csv
from polarsim.publish import bundle as bundles
from polarsim.publish import run as running
from polarsim.publish.bundle import check_space
from polarsim.publish.catalogue_reader import read_catalogue
from polarsim.publish.options import PublishOptions
from polarsim.publish.run import FORMS, form_summary, publish_forms, publish_run
from polarsim.publish.subset import limit_size, parse_size, parse_subset, select
from tests.publish.tiny import KEYS, content, make_run

LACKING = {"euroc", "tum", "detectors"}  # not available for the small run


@pytest.mark.parametrize("form", sorted(set(FORMS) - LACKING))
def test_the_same_run_gives_the_same_bytes(form, run, published, tmp_path):
    first, second = published(form), tmp_path / form
    publish_forms(run, tmp_path, [form])
    assert content(first) == content(second)


@pytest.mark.parametrize("form", ["mcap", "euroc", "tum"])
def test_the_same_drive_gives_the_same_bytes(form, drive, drives_published, tmp_path):
    publish_forms(drive.parents[1], tmp_path, [form])
    assert content(drives_published(form)) == content(tmp_path / form)


@pytest.mark.parametrize("form", sorted(set(FORMS) - LACKING))
def test_every_format_has_a_card_a_datasheet_and_the_checksum_of_every_file(form, published):
    files = content(published(form))
    assert not any(path.is_symlink() for path in published(form).rglob("*"))  # for `tar` and `cp`
    listed = dict(reversed(line.split("  ", 1)) for line in files["SHA256SUMS"].decode().splitlines())
    assert set(listed) == set(files) - {"SHA256SUMS", "publish.json"}
    assert all(hashlib.sha256(files[name]).hexdigest() == digest for name, digest in listed.items())
    card = files["README.md"].decode()
    assert "| labels | rock | F1 | 1 | truth | 0.9375 | 1 |" in card  # the evaluation of this run
    assert "| analog | 4 | 1 | 12 | 8 | test 2, train 2 |" in card
    for heading in ("Content", "Method", "Limitations", "Licence", "Citation"):
        assert f"## {heading}" in card
    assert "## Labelling" in files["DATASHEET.md"].decode()


def test_an_interrupted_export_is_resumed(run, published, tmp_path, monkeypatch):
    copied = []
    copy = shutil.copyfile

    def stop_at_third(source, target):
        if len(copied) == 3:
            raise KeyboardInterrupt
        copied.append(source)
        return copy(source, target)

    monkeypatch.setattr(bundles.shutil, "copyfile", stop_at_third)
    with pytest.raises(KeyboardInterrupt):
        publish_forms(run, tmp_path, ["coco"])
    assert not (tmp_path / "coco/publish.json").exists()
    assert not list((tmp_path / "coco").rglob(".*.png"))  # no partial files
    monkeypatch.setattr(bundles.shutil, "copyfile", lambda *paths: copied.append(paths[0]) or copy(*paths))
    publish_forms(run, tmp_path, ["coco"])
    assert len(copied) == len(set(copied)) == 8  # each file once
    assert content(tmp_path / "coco") == content(published("coco"))


def test_a_changed_image_is_published_again(tmp_path):
    run = make_run(tmp_path)
    publish_forms(run, tmp_path / "out", ["coco"])
    path = tmp_path / "photos/01_A_off_30_L_0256.png"
    png.write_png(path, np.full((304, 484), 77, np.uint16))
    publish_forms(run, tmp_path / "out", ["coco"])
    assert (tmp_path / "out/coco/images/analog/01_A_off_30_L_0256.png").read_bytes() == path.read_bytes()


def test_files_of_earlier_exports_are_removed(run, tmp_path):
    publish_forms(run, tmp_path, ["gltf"])
    (tmp_path / "gltf/stray/deeper").mkdir(parents=True)
    (tmp_path / "gltf/stray/deeper/old.png").write_bytes(b"")
    publish_forms(run, tmp_path, ["gltf"])
    assert not (tmp_path / "gltf/stray").exists()


def test_a_folder_with_other_files_is_not_changed(run, tmp_path):
    (tmp_path / "coco").mkdir()
    (tmp_path / "coco/mine.txt").write_text("mine")
    with pytest.raises(ConfigError):
        publish_forms(run, tmp_path, ["coco"])
    publish_forms(run, tmp_path, ["gltf"])
    before = content(tmp_path / "gltf")
    with pytest.raises(ConfigError):
        publish_forms(run, tmp_path, ["gltf"], subset="camera=L")
    assert content(tmp_path / "gltf") == before
    publish_forms(run, tmp_path, ["gltf"], subset="camera=L", replace=True)
    assert json.loads((tmp_path / "gltf/publish.json").read_text())["subset"] == "camera=L"
    with pytest.raises(ConfigError):  # --replace does not remove other files
        publish_forms(run, tmp_path, ["coco"], replace=True)


def test_insufficient_disk_space_is_an_error_before_files_are_written(run, tmp_path, monkeypatch):
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(bundles.shutil, "disk_usage", lambda _: usage._replace(free=10**6))
    with pytest.raises(PolarsimError):
        publish_forms(run, tmp_path / "out", ["coco"])
    assert not (tmp_path / "out").exists()


def test_the_size_of_existing_files_is_subtracted_from_the_required_space(tmp_path, monkeypatch):
    (tmp_path / "half").write_bytes(b"0" * 5000)
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(bundles.shutil, "disk_usage", lambda _: usage._replace(free=bundles.SPARE))
    check_space(tmp_path, 5000)
    with pytest.raises(PolarsimError):
        check_space(tmp_path, 5001)


@pytest.mark.parametrize("forms", [["csv"], ["euroc"]])
def test_unknown_and_unavailable_formats_are_errors(run, tmp_path, forms):
    with pytest.raises(ConfigError):
        publish_forms(run, tmp_path / "out", forms)
    assert not (tmp_path / "out").exists()


def test_a_missing_package_is_an_error(run, tmp_path, monkeypatch):
    find = extras.find_spec
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "mlcroissant" else find(name))
    with pytest.raises(extras.ExtraError):
        publish_forms(run, tmp_path, ["croissant"])


def test_all_selects_the_available_formats(run, tmp_path):
    parts = publish_forms(run, tmp_path, ["all"], subset="camera=L,azimuth=30,domain=hapke")
    assert set(parts) == set(FORMS) - LACKING
    assert {path.name for path in tmp_path.iterdir()} == set(parts)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("terrain=01,exposure=256", 8),
        ("exposure=0256+512", 8),
        ("camera=L", 4),
        ("camera=L,domain=hapke", 2),
        ("part=test,azimuth=30", 4),
        ("", 8),
    ],
)
def test_a_subset_is_selected_by_fields_of_the_keys(catalogue, text, count):
    selected = select(catalogue, parse_subset(text))
    assert len(selected.pictures) == count
    assert set(selected.pictures) <= set(catalogue.pictures)


def test_only_maps_of_selected_images_are_published(catalogue):
    maps = select(catalogue, parse_subset("camera=L,azimuth=30")).maps()
    assert [f"{name}/{path.stem}" for name, path in maps] == [
        "depth/01_A_L",
        "incidence/01_A_off_30_L",
        "normal/01_A_L",
    ]


@pytest.mark.parametrize("text", ["colour=red", "camera", "camera=", "exposure=long", "camera=L,camera=R"])
def test_an_invalid_subset_is_an_error(text):
    with pytest.raises(ConfigError, match="subset"):
        parse_subset(text)


def test_an_empty_selection_is_an_error(catalogue):
    with pytest.raises(ConfigError):
        select(catalogue, parse_subset("azimuth=270"))


@pytest.mark.parametrize(("text", "size"), [("2GB", 2 * 10**9), ("500 MB", 5 * 10**8), ("1.5k", 1500), ("7", 7)])
def test_sizes_are_read(text, size):
    assert parse_size(text) == size


@pytest.mark.parametrize("text", ["", "much", "0", "-1GB", "1..5k"])
def test_an_invalid_size_is_an_error(text):
    with pytest.raises(ConfigError, match="size"):
        parse_size(text)


@given(st.integers(40, 100), st.integers(40, 100))
def test_a_larger_limit_selects_a_superset_and_scenes_are_complete(catalogue, a, b):
    small, large = (limit_size(catalogue, lambda _: 10, 0, size).pictures for size in sorted((a, b)))
    assert set(small) <= set(large)
    for kept, size in zip((small, large), sorted((a, b)), strict=True):
        assert 10 * len(kept) <= size
        moments = {str(picture.key).replace("_R_", "_L_") for picture in kept}
        assert len(kept) == 4 * len(moments)  # left and right, photo and twin


def test_a_limit_smaller_than_a_scene_is_an_error(catalogue):
    with pytest.raises(ConfigError):
        limit_size(catalogue, lambda _: 10, 0, 39)


def test_nasas_photos_are_published_on_request_only(tmp_path):
    run = make_run(tmp_path, "files")
    without = publish_forms(run, tmp_path / "without", ["coco"])["coco"]
    assert without.domains == ("hapke",)
    assert "CC0 1.0" in (tmp_path / "without/coco/README.md").read_text()
    assert "NASA's photos are not included" in (tmp_path / "without/coco/README.md").read_text()
    with_photos = publish_forms(run, tmp_path / "with", ["coco"], photos=True)["coco"]
    assert with_photos.domains == ("hapke", "real")
    assert "NASA's terms" in (tmp_path / "with/coco/README.md").read_text()
    assert "license: other" in running.FORMS["hf"].front(with_photos)
    shutil.rmtree(run / "renders/hapke")
    with pytest.raises(ConfigError):
        publish_forms(run, tmp_path / "none", ["coco"])


def test_a_run_of_the_release_has_twins_and_no_photos(tmp_path):
    run = make_run(tmp_path, "release")
    (run / "acquire/Terrain01/photos.parquet").unlink()
    part = publish_forms(run, tmp_path / "out", ["coco"])["coco"]
    assert part.domains == ("hapke",)
    assert (
        "published POLAR-Sim labels and meshes, without NASA's photos" in (tmp_path / "out/coco/README.md").read_text()
    )


def test_what_was_measured_on_a_real_sandbox_was_made_up_on_an_analog(tmp_path):
    real, analog = (read_catalogue(make_run(tmp_path / kind, kind)) for kind in ("files", "analog"))
    assert (real.terrains[1].sun_origin("30"), analog.terrains[1].sun_origin("30")) == ("measured", "synthetic")
    assert (real.terrains[1].sun_origin("180"), analog.terrains[1].sun_origin("180")) == ("fitted", "fitted")
    photos = [next(one for one in catalogue.pictures if catalogue.is_photo(one)) for catalogue in (real, analog)]
    assert real.picture_origin(photos[0]) == "measured"
    assert analog.picture_origin(photos[1]) == "synthetic"


def test_errors_of_an_invalid_run_name_the_file(tmp_path):
    with pytest.raises(ConfigError):
        read_catalogue(tmp_path)
    run = make_run(tmp_path)
    (tmp_path / "photos/01_A_off_30_L_0256.png").rename(tmp_path / "moved.png")
    with pytest.raises(FormatError, match=r"photos\.parquet"):
        read_catalogue(run)
    (run / "cameras/Terrain01/PosA.json").write_text("{")
    with pytest.raises(FormatError, match=r"PosA\.json"):
        read_catalogue(run)


def test_the_command_publishes_and_prints_the_folders(run, tmp_path, polarsim):
    done = polarsim(
        "publish", run.name, tmp_path / "out", "--format", "yolo,gltf", "--subset", "camera=L", "--results", run.parent
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [f"4 images in {tmp_path}/out/yolo", f"gltf in {tmp_path}/out/gltf"]
    recipe = json.loads((tmp_path / "out/yolo/publish.json").read_text())
    assert (recipe["form"], recipe["subset"], recipe["run"]) == ("yolo", "camera=L", "tiny")
    wrong = polarsim("publish", "none", tmp_path / "other", "--format", "yolo", "--results", run.parent)
    assert wrong.returncode == 1
    assert len(wrong.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize("options", [{"forms": ["csv"]}, {"subset": "colour=red"}, {"max_size": "much"}])
def test_invalid_options_are_errors(options):
    with pytest.raises(ValidationError):
        PublishOptions(**options)


def test_a_job_publishes_to_the_folder_of_the_receipt(tmp_path):
    run = make_run(tmp_path)
    receipt = run / "publish/yolo.json"
    publish_run(form="yolo", receipt=receipt, options=PublishOptions(subset="camera=L"))
    assert json.loads(receipt.read_text())["pictures"] == {"analog": 2, "hapke": 2}
    assert (run / "publish/yolo/analog.yaml").is_file()
    publish_run(form="yolo", receipt=receipt, options=PublishOptions())  # other options replace the first export
    assert json.loads(receipt.read_text())["pictures"] == {"analog": 4, "hapke": 4}


def test_the_date_of_a_run_is_that_of_the_newest_file_or_source_date_epoch(tmp_path, monkeypatch):
    run = make_run(tmp_path)
    for path in tmp_path.rglob("*"):
        os.utime(path, (0, 0))
    os.utime(run / "meshes/Terrain01/terrain01_rock4.obj", (86_400 * 365, 86_400 * 365))
    assert read_catalogue(run).made_on == "1971-01-01"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1790000000")
    assert read_catalogue(run).made_on == "2026-09-21"
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "tomorrow")
    with pytest.raises(ConfigError):
        read_catalogue(run)


FIRST, SECOND = "position", "photo"  # not in alphabetical order


@pytest.fixture
def run_of_two_splits(tmp_path):
    """Return a run whose first split tests azimuth 180, omits a photo, and is last in alphabetical order."""
    run = make_run(tmp_path)
    rows = [(str(key), "test" if key.azimuth == "180" else "train") for key in KEYS[:-1]]
    write_csv(run / f"detect/{FIRST}/split.csv", pd.DataFrame(rows, columns=["key", "part"]))
    return run


def parts_published(folder):
    """Return the part of each key in the formats that have a folder or file per part."""
    parts = {"coco": {}, "yolo": {}, "hf": {}}
    for part in ("train", "val", "test", "unassigned"):
        for path in (folder / "coco/annotations").glob(f"analog_{part}.json"):
            images = json.loads(path.read_text())["images"]
            parts["coco"] |= {Path(image["file_name"]).stem: part for image in images}
        parts["yolo"] |= {path.stem: part for path in (folder / f"yolo/analog/images/{part}").glob("*.png")}
        parts["hf"] |= {path.stem: part for path in (folder / f"hf/analog/{part}").glob("*.png")}
    return parts


@pytest.mark.parametrize("given_by", ["configuration", "argument"])
def test_parts_are_from_the_first_split_and_images_without_part_are_excluded(run_of_two_splits, tmp_path, given_by):
    run = run_of_two_splits
    if given_by == "configuration":
        (run / "config.yaml").write_text(f"detect: {{splits: [{FIRST}, {SECOND}]}}\n")
    done = publish_forms(
        run, tmp_path / "out", ["coco", "yolo", "hf"], split="" if given_by == "configuration" else FIRST
    )
    expected = {str(key): "test" if key.azimuth == "180" else "train" for key in KEYS[:-1]}
    assert parts_published(tmp_path / "out") == {"coco": expected, "yolo": expected, "hf": expected}
    for form, part in done.items():
        assert part.split == FIRST
        card = (tmp_path / "out" / form / "README.md").read_text()
        assert f"split by {FIRST}" in card
        assert "2 of 8 images" in card  # photos and twins
        assert "2 of 8 images" in form_summary(form, part, tmp_path)


def test_several_splits_without_a_configuration_are_an_error_that_lists_them(run_of_two_splits, tmp_path):
    with pytest.raises(ConfigError, match=f"{SECOND}, {FIRST}"):
        publish_forms(run_of_two_splits, tmp_path / "out", ["coco"])
    with pytest.raises(ConfigError, match="terrain"):
        publish_forms(run_of_two_splits, tmp_path / "out", ["coco"], split="terrain")
    (run_of_two_splits / "config.yaml").write_text("detect: {splits: [view]}\n")
    with pytest.raises(ConfigError, match="view"):
        publish_forms(run_of_two_splits, tmp_path / "out", ["coco"])
    assert not (tmp_path / "out").exists()


def test_images_of_a_run_without_a_split_are_unassigned(run, tmp_path):
    bare = tmp_path / "bare"
    shutil.copytree(run, bare, ignore=shutil.ignore_patterns("detect"))
    done = publish_forms(bare, tmp_path / "out", ["coco", "yolo", "hf"])
    expected = {str(key): "unassigned" for key in KEYS}
    assert parts_published(tmp_path / "out") == {"coco": expected, "yolo": expected, "hf": expected}
    assert {part.split for part in done.values()} == {""}


def test_published_8_bit_images_equal_the_training_images(tmp_path):
    run = make_run(tmp_path)
    publish_forms(run, tmp_path / "out", ["yolo"])
    for path in (tmp_path / "out/yolo/hapke/images").rglob("*.png"):
        pixels = png.read_png(run / f"renders/hapke/Terrain01/{path.name}")
        np.testing.assert_array_equal(png.read_png(path), to_8_bits(pixels))
