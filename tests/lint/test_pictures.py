from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from polarsim.errors import FormatError
from polarsim.formats import png
from polarsim.lint.folders import lint_folder
from polarsim.lint.rules import RULES

BOX = "0 0.5 0.5 0.2 0.2\n"


@pytest.fixture
def root(tmp_path):
    """Write two pictures of 320 x 240 with labels, in a folder `train`."""
    for name in ("one", "two"):
        for folder in ("images/train", "labels/train"):
            (tmp_path / folder).mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(tmp_path / f"images/train/{name}.png"), np.zeros((240, 320), np.uint8))
        (tmp_path / f"labels/train/{name}.txt").write_text(BOX)
    (tmp_path / "labels/classes.txt").write_text("rock\nshadow\n")
    return tmp_path


def found(root):
    return [(one.defect, one.file, one.line) for one in lint_folder(root, set(RULES)).findings]


@pytest.mark.parametrize(
    ("text", "defect", "line"),
    [
        (BOX + "0 0.5 0.5 0.2\n", "malformed", 2),
        (BOX + BOX, "duplicate", 2),
        (BOX + "1 0.2 0.2 0.003 0.1\n", "sliver", 2),  # 0.96 px of 320, the limit is 6 px of 1936
        (BOX + "1 0.98 0.2 0.1 0.1\n", "out_of_photo", 2),
    ],
)
def test_defects_of_a_label_file_are_found_with_its_line(root, text, defect, line):
    (root / "labels/train/one.txt").write_text(text)
    assert found(root) == [(defect, "labels/train/one.txt", line)]


def test_labels_without_pictures_and_pictures_without_labels_are_reported(root):
    (root / "labels/train/two.txt").rename(root / "labels/train/three.txt")
    assert found(root) == [
        ("missing_labels", "images/train/two.png", 0),
        ("missing_picture", "labels/train/three.txt", 0),
    ]


def test_a_broken_picture_is_reported_and_a_folder_without_labels_refused(root):
    (root / "images/train/one.png").write_text("no picture")
    assert found(root) == [("unreadable_picture", "images/train/one.png", 0)]
    for path in (root / "labels/train").iterdir():
        path.unlink()
    with pytest.raises(FormatError, match=str(root)):
        found(root)
    with pytest.raises(FormatError, match=str(root)):
        lint_folder(root, set(RULES), fix=root / "out")


@pytest.mark.parametrize("name", ["large.jpg", "large.tif", "large.png"])
def test_pictures_of_large_cameras_and_of_phones_are_sound(root, name):
    """The size is read from the header, upright by the EXIF orientation."""
    exif = Image.Exif()
    exif[0x0112] = 6
    image = Image.fromarray(np.full((4000, 6000), 90, np.uint8))
    image.save(root / "images/train" / name, exif=exif)
    (root / f"labels/train/{Path(name).stem}.txt").write_text(BOX)
    assert png.size(root / "images/train" / name) == (4000, 6000)
    assert found(root) == []


@pytest.mark.parametrize("content", [b"", b"no picture", b"II*\0", b"\xff\xd8\xff\xe0"])
@pytest.mark.parametrize("name", ["one.png", "one.jpg", "one.tif"])
def test_invalid_pictures_are_reported(root, name, content):
    (root / "images/train/one.png").unlink()
    (root / "images/train" / name).write_bytes(content)
    assert found(root) == [("unreadable_picture", f"images/train/{name}", 0)]
