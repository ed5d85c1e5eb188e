"""An import converts every shape with a bounding box and counts all other shapes."""

import json
import zipfile
from itertools import pairwise

import numpy as np
import pytest

from polarsim.annotate.export import cvat_labels, label_studio_tasks
from polarsim.annotate.import_labels import import_labels
from polarsim.annotate.label_studio import decode_brush
from polarsim.errors import FormatError
from polarsim.formats import coco, yolo
from polarsim.formats.coco_annotations import Annotation
from polarsim.formats.files import write_json
from polarsim.formats.tables import key_columns, label_table
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.site import polar
from tests.support.polar_photos import HEIGHT, WIDTH

POLAR = polar()
SIZE = POLAR.images.size

KEY, OTHER = PhotoKey.parse("01_A_off_30_L_0256"), PhotoKey.parse("01_A_off_180_L_0256")
BOX = np.array([500.0, 300, 600, 340])
# A mask of 20 x 12 px as encoded by label-studio-converter 0.0.59 (brush.mask2rle): columns 5 to 13, rows 3 to 8.
BRUSH = [0, 0, 3, 192, 57, 27, 255, 1, 3, 0, 196, 127, 248, 172, 2, 255, 252, 96, 23, 255, 241, 88, 6, 35, 255, 197, 96,
         24, 143, 255, 21, 128, 98, 63, 252, 86, 1, 31, 252, 96, 17, 255, 198, 1, 31, 252, 96, 17, 255, 198, 1, 31, 255,
         1, 7, 0, 0]  # fmt: skip


def read_back(folder, key=KEY):
    """Boxes of a label file by class."""
    classes, boxes = yolo.read_boxes(folder / f"{key}.txt", size=SIZE)
    return [(BOX_CLASSES[number], box.round(1).tolist()) for number, box in zip(classes, boxes, strict=True)]


def write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


def cvat(*shapes, name=f"{KEY}.png"):
    body = "".join(shapes)
    return f'<annotations><image id="0" name="{name}" width="1936" height="1216">{body}</image></annotations>'


@pytest.mark.parametrize(
    ("shape", "box", "form"),
    [
        (
            '<box label="rock" xtl="900" ytl="590" xbr="1000" ybr="610" rotation="90"/>',
            [940, 550, 960, 650],
            "rotated box",
        ),
        ('<box label="rock" xtl="900" ytl="590" xbr="1000" ybr="610" rotation="0.0"/>', [900, 590, 1000, 610], "box"),
        (
            '<box label="rock" xtl="100" ytl="100" xbr="200" ybr="200" rotation="45"/>',
            [79.3, 79.3, 220.7, 220.7],
            "rotated box",
        ),
        (
            '<mask label="rock" rle="21, 3, 17, 3, 156" left="300" top="400" width="20" height="10"/>',
            [301, 401, 304, 403],
            "mask",
        ),
        ('<ellipse label="rock" cx="700" cy="500" rx="40" ry="10"/>', [660, 490, 740, 510], "ellipse"),
        ('<ellipse label="rock" cx="700" cy="500" rx="40" ry="10" rotation="90"/>', [690, 460, 710, 540], "ellipse"),
        ('<polygon label="rock" points="30,105;52.5,110;40,115"/>', [30, 105, 52.5, 115], "polygon"),
        ('<polyline label="rock" points="30,105;52.5,110;40,115;30,105"/>', [30, 105, 52.5, 115], "closed polyline"),
        (
            '<cuboid label="rock" xtl1="10" ytl1="20" xbl1="10" ybl1="40" xtr1="30" ytr1="22" xbr1="30" ybr1="42" '
            'xtl2="50" ytl2="18" xbl2="50" ybl2="38" xtr2="34" ytr2="17" xbr2="34" ybr2="37"/>',
            [10, 17, 50, 42],
            "cuboid",
        ),
    ],
)
def test_every_shape_of_cvat_with_an_area_becomes_a_box(tmp_path, shape, box, form):
    done = import_labels(write(tmp_path / "a.xml", cvat(shape)), tmp_path / "out", site=POLAR)
    assert read_back(tmp_path / "out") == [("rock", box)]
    assert (done.read, done.skipped) == ({form: 1}, {})


@pytest.mark.parametrize(
    ("shape", "form"),
    [
        ('<polyline label="rock" points="1,1;9,9"/>', "polyline"),
        ('<points label="rock" points="1,1"/>', "points"),
        ('<skeleton label="rock"><points label="1" points="1,1"/></skeleton>', "skeleton"),
        ('<tag label="rock"/>', "tag"),
        ('<hologram label="rock"/>', "hologram"),
    ],
)
def test_a_shape_without_box_is_counted_and_the_photo_is_not_empty(tmp_path, shape, form):
    content = cvat(shape).replace("</annotations>", cvat(SOUND, name=f"{OTHER}.png").removeprefix("<annotations>"))
    done = import_labels(write(tmp_path / "a.xml", content), tmp_path / "out", keep_empty=True, site=POLAR)
    assert (done.skipped, done.empty, done.unread) == ({form: 1}, [], [str(KEY)])
    assert [path.stem for path in (tmp_path / "out").iterdir()] == [str(OTHER)]
    assert f"skipped: {form} (1)" in done.report()[-1]
    with pytest.raises(FormatError, match=form):
        import_labels(write(tmp_path / "b.xml", cvat(shape)), tmp_path / "alone", site=POLAR)


SOUND = '<box label="rock" xtl="900" ytl="590" xbr="1000" ybr="610"/>'


@pytest.mark.parametrize(
    "content",
    [
        '<annotations><track label="rock"><box frame="0"/></track></annotations>',
        "<annotation><object><name>rock</name></object></annotation>",
        cvat('<box label="rock" xtl="90" ytl="50" xbr="10" ybr="60"/>'),
        cvat('<box label="rock" xtl="900" ytl="50" xbr="2900" ybr="60"/>'),
        cvat('<box label="rock" xtl="0.2" ytl="0.2" xbr="0.3" ybr="0.3"/>'),
        cvat('<box label="rock" xtl="a" ytl="0.2" xbr="0.3" ybr="0.3"/>'),
        cvat('<mask label="rock" rle="0, 9" left="3" top="4" width="2" height="2"/>'),
        cvat('<mask label="rock" left="3" top="4" width="2" height="2"/>'),
        cvat('<polygon label="rock" points="30;40"/>'),
        cvat('<box xtl="90" ytl="50" xbr="100" ybr="60"/>'),
    ],
)
def test_invalid_xml_is_an_error_with_the_element(tmp_path, content):
    with pytest.raises(FormatError):
        import_labels(write(tmp_path / "a.xml", content), tmp_path / "out", form="cvat", site=POLAR)
    assert not (tmp_path / "out").exists()


def percent(box):
    x0, y0, x1, y1 = np.array(box) / np.tile([WIDTH, HEIGHT], 2) * 100
    return {"x": x0, "y": y0, "width": x1 - x0, "height": y1 - y0, "rotation": 0}


def result(kind, value, own="a", **more):
    size = {"original_width": WIDTH, "original_height": HEIGHT, "image_rotation": 0}
    return {"id": own, "type": kind, "value": value, **size, **more}


def studio(*results, name=f"{KEY}.png", **more):
    dropped = {"was_cancelled": True, "result": list(results[:1])}
    return {"data": {"image": name}, "annotations": [{"result": list(results)}, dropped], **more}


ELLIPSE = {"x": 700 / WIDTH * 100, "y": 500 / HEIGHT * 100, "radiusX": 40 / WIDTH * 100, "radiusY": 10 / HEIGHT * 100}


@pytest.mark.parametrize(
    ("results", "box"),
    [
        ([result("ellipselabels", {**ELLIPSE, "rotation": 0, "ellipselabels": ["rock"]})], [660, 490, 740, 510]),
        ([result("ellipselabels", {**ELLIPSE, "rotation": 90, "ellipselabels": ["rock"]})], [690, 460, 710, 540]),
        ([result("rectangle", percent(BOX)), result("labels", {**percent(BOX), "labels": ["rock"]})], BOX.tolist()),
        ([result("labels", {**percent(BOX), "labels": ["rock"]}), result("rectangle", percent(BOX))], BOX.tolist()),
        (  # a quarter turn about the upper left corner
            [result("rectanglelabels", percent([500, 300, 600, 350]) | {"rotation": 90, "rectanglelabels": ["rock"]})],
            [450, 300, 500, 400],
        ),
        (
            [result("polygonlabels", {"points": [[10, 10], [20, 10], [20, 20]], "polygonlabels": ["Rock"]})],
            [193.6, 121.6, 387.2, 243.2],
        ),
    ],
)
def test_every_region_of_label_studio_with_an_area_becomes_a_box(tmp_path, results, box):
    done = import_labels(write(tmp_path / "a.json", [studio(*results)]), tmp_path / "out", site=POLAR)
    assert read_back(tmp_path / "out") == [("rock", [round(value, 1) for value in box])]
    assert (done.boxes, done.skipped) == (1, {})


def test_runs_of_a_brush_are_decoded_as_by_label_studio():
    opacity = decode_brush(BRUSH, 20 * 12 * 4).reshape(12, 20, 4)[..., 3]
    expected = np.zeros((12, 20), int)
    expected[3:8, 5:14] = 255
    expected[4, 9] = 0
    expected[8, 5:14:2] = 255
    np.testing.assert_array_equal(opacity, expected)
    with pytest.raises(FormatError):
        decode_brush(BRUSH[:30], 20 * 12 * 4)


def packed(mask):
    """Runs of a brush as Label Studio packs them: four channels a pixel, here without repeated values."""
    values = np.repeat(mask.astype(np.uint8).ravel() * 255, 4)
    bits = [f"{len(values):032b}", f"{7:05b}", "0011" * 4]
    changes = [0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)]
    for start, end in pairwise(changes):
        for first in range(start, end, 16):
            bits.append(f"100{min(16, end - first) - 1:04b}{values[start]:08b}")
    text = "".join(bits)
    text += "0" * (-len(text) % 8)
    return [int(text[i : i + 8], 2) for i in range(0, len(text), 8)]


def test_the_box_of_a_brush_on_a_resized_image_is_in_pixels_of_the_photo(tmp_path):
    mask = np.zeros((76, 121), bool)  # a sixteenth of the photo
    mask[10:14, 30:36] = True
    brush = result("brushlabels", {"format": "rle", "rle": packed(mask), "brushlabels": ["shadow"]},
                   original_width=121, original_height=76)  # fmt: skip
    done = import_labels(write(tmp_path / "a.json", [studio(brush)]), tmp_path / "out", site=POLAR)
    assert read_back(tmp_path / "out") == [("shadow", [480, 160, 576, 224])]
    assert done.read == {"brush": 1}


@pytest.mark.parametrize(
    ("results", "form"),
    [
        ([result("keypointlabels", {"x": 1, "y": 1, "width": 0.2, "keypointlabels": ["rock"]})], "keypoint"),
        ([result("rectangle", percent(BOX))], "rectangle without a label"),
        ([result("choices", {"choices": ["rock"]})], "choices"),
        (
            [result("rectanglelabels", {**percent(BOX), "rectanglelabels": ["rock"]}, image_rotation=90)],
            "rectangle on a rotated image",
        ),
    ],
)
def test_a_region_without_a_box_is_counted(tmp_path, results, form):
    sound = studio(result("rectanglelabels", {**percent(BOX), "rectanglelabels": ["rock"]}), name=f"{OTHER}.png")
    done = import_labels(
        write(tmp_path / "a.json", [studio(*results), sound]), tmp_path / "out", keep_empty=True, site=polar()
    )
    assert (done.boxes, done.skipped, done.unread) == (1, {form: 1}, [str(KEY)])


@pytest.mark.parametrize("control", ["label", "bbox", "rocks", "tag-1"])
@pytest.mark.parametrize("field", ["image", "img", "photo_url"])
def test_json_min_may_have_any_names_of_controls_and_images(tmp_path, control, field):
    rectangle = percent(BOX) | {"rectanglelabels": ["rock"], "original_width": WIDTH, "original_height": HEIGHT}
    ellipse = ELLIPSE | {"rotation": 0, "ellipselabels": ["shadow"]}
    row = {
        field: f"/data/upload/1/1a2b3c4d-{KEY}.png",
        "id": 1,
        "annotator": 1,
        control: [rectangle],
        "more": [ellipse],
    }
    done = import_labels(write(tmp_path / "a.json", [row]), tmp_path / "out", site=POLAR)
    assert sorted(read_back(tmp_path / "out")) == [("rock", BOX.tolist()), ("shadow", [660, 490, 740, 510])]
    assert done.read == {"rectangle": 1, "ellipse": 1}


def test_predictions_are_used_only_without_annotations(tmp_path):
    rectangle = result("rectanglelabels", {**percent(BOX), "rectanglelabels": ["rock"]})
    predicted = {"data": {"image": f"{KEY}.png"}, "predictions": [{"result": [rectangle]}]}
    done = import_labels(write(tmp_path / "a.json", [predicted]), tmp_path / "alone", site=POLAR)
    assert done.boxes == 1
    assert any("predictions" in line for line in done.report())
    tasks = [predicted | {"annotations": []}, studio(rectangle, name=f"{OTHER}.png")]
    done = import_labels(write(tmp_path / "b.json", tasks), tmp_path / "out", keep_empty=True, site=POLAR)
    assert (done.photos, done.unread, done.skipped.total()) == (1, [str(KEY)], 1)


@pytest.mark.parametrize(
    "content",
    [
        [{"image_id": 1, "category_id": 1, "bbox": [1, 2, 3, 4], "score": 0.5}],
        [{"data": {"img": "holiday.png"}}],
        [{"image": f"{KEY}.png", "annotations": [{"label": "rock", "coordinates": {}}]}],
        [{"img": f"{KEY}.png", "other": f"{OTHER}.png", "label": []}],
        [studio(result("rectanglelabels", {**percent(BOX), "rectanglelabels": ["rock", "shadow"]}))],
        [studio(result("rectanglelabels", {"x": 1, "rectanglelabels": ["rock"]}))],
        {"shapes": [], "imagePath": "a.png"},
        {},
    ],
)
def test_invalid_json_is_an_error_without_internal_names(tmp_path, content):
    with pytest.raises(FormatError) as caught:
        import_labels(write(tmp_path / "a.json", content), tmp_path / "out", site=POLAR)
    assert not any(word in str(caught.value) for word in ("KeyError", "AttributeError", "_Runs", "TypeError"))


def coco_file(*annotations, name=f"{KEY}.png", width=WIDTH, height=HEIGHT):
    rows = [{"id": number, "image_id": 5, "category_id": 0, **one} for number, one in enumerate(annotations, 1)]
    image = {"id": 5, "file_name": name, "width": width, "height": height}
    return {"images": [image], "categories": [{"id": 0, "name": "rock"}], "annotations": rows}


@pytest.mark.parametrize(
    ("annotation", "box", "form"),
    [
        ({"bbox": [900, 590, 100, 20], "attributes": {"rotation": 90.0}}, [940, 550, 960, 650], "rotated box"),
        ({"bbox": [900, 590, 100, 20], "attributes": {"rotation": 0.0}}, [900, 590, 1000, 610], "box"),
        ({"segmentation": [10, 20, 14, 20, 14, 24, 10, 24]}, [10, 20, 14, 24], "polygon"),
        (
            {
                "bbox": [10, 20, 4, 4],
                "iscrowd": 1,
                "segmentation": {"size": [1216, 1936], "counts": [12180, 4, 2342192]},
            },
            [10, 20, 14, 24],
            "crowd region",
        ),
        ({"segmentation": {"size": [1216, 1936], "counts": [12180, 4, 2341992]}}, [10, 20, 11, 24], "mask"),
    ],
)
def test_every_annotation_of_coco_becomes_a_box(tmp_path, annotation, box, form):
    if form == "crowd region":
        annotation["segmentation"]["counts"][2] = WIDTH * HEIGHT - 12184
    done = import_labels(write(tmp_path / "a.json", coco_file(annotation)), tmp_path / "out", site=POLAR)
    assert read_back(tmp_path / "out") == [("rock", box)]
    assert done.read == {form: 1}


def test_boxes_of_resized_images_are_scaled_and_other_aspects_are_errors(tmp_path):
    content = coco_file({"bbox": [250, 150, 50, 20]}, width=968, height=608)
    import_labels(write(tmp_path / "a.json", content), tmp_path / "out", site=POLAR)
    assert read_back(tmp_path / "out") == [("rock", BOX.tolist())]
    content["images"][0]["height"] = 968
    with pytest.raises(FormatError):
        import_labels(write(tmp_path / "b.json", content), tmp_path / "square", site=POLAR)


@pytest.mark.parametrize(
    "annotations",
    [
        [{"bbox": [0.5, 0.5, 0.05, 0.05]}],
        [{"bbox": [100, 100, 60, 40]}, {"bbox": [1400, 900, 1500, 950]}],
        [{"bbox": [100, 100, 160, 140], "area": 2400}],
        [{"bbox": [100, 100, 160, 140], "segmentation": [[100, 100, 160, 100, 160, 140]]}],
        [{"bbox": [5, 5, 60, 40]}, {"bbox": [900, 500, 1000, 560]}, {"bbox": [20, 20, 80, 60]}],
        [{"bbox": [100, 100, -60, 40]}],
        [{"bbox": [100, 100, 60, 40], "segmentation": [3, "a"]}],
    ],
)
def test_implausible_boxes_of_coco_are_errors_with_the_annotation(tmp_path, annotations):
    with pytest.raises(FormatError) as caught:
        import_labels(write(tmp_path / "a.json", coco_file(*annotations)), tmp_path / "out", site=POLAR)
    assert "_Runs" not in str(caught.value)


LINES = "1 0.5 0.5 0.05 0.05\n0 0.42 0.51 0.48 0.51 0.48 0.53 0.42 0.53\n"  # the first is the rock wherever 0 is shadow


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("classes.txt", "shadow\nrock\n"),
        ("labels/train/classes.txt", "shadow\nrock\n"),
        ("obj.names", "shadow\nrock\n"),
        ("data.yaml", "names: [shadow, rock]\n"),
        ("any.yml", "names:\n  0: Shadow\n  1: Rock\n"),
        ("data.yaml", "names: {'1': rock, '0': shadow}\n"),
        ("notes.json", '{"categories": [{"id": 1, "name": "rock"}, {"id": 0, "name": "shadow"}]}'),
    ],
)
@pytest.mark.parametrize("handed", [".", "labels", "labels/train"])
def test_class_lists_of_any_form_are_used_from_the_folder_or_up_to_two_above(tmp_path, file, content, handed):
    write(tmp_path / f"set/labels/train/{KEY}.txt", LINES)
    write(tmp_path / "set" / file, content)
    done = import_labels(tmp_path / "set" / handed, tmp_path / "out", site=POLAR)
    assert [kind for kind, _ in read_back(tmp_path / "out")] == ["rock", "shadow"]
    assert any(file.rsplit("/", 1)[-1] in line for line in done.notes)


def test_a_class_list_in_another_folder_of_the_data_set_is_used(tmp_path):
    write(tmp_path / f"set/labels/train/{KEY}.txt", LINES)
    write(tmp_path / "set/meta/data.yaml", "names: [shadow, rock]\n")
    import_labels(tmp_path / "set", tmp_path / "out", site=POLAR)
    assert [kind for kind, _ in read_back(tmp_path / "out")] == ["rock", "shadow"]


def test_without_a_class_list_the_default_is_stated(tmp_path, polarsim):
    write(tmp_path / f"set/labels/{KEY}.txt", LINES)
    done = polarsim("import", tmp_path / "set", tmp_path / "out")
    assert "no class list found: assuming 0 rock, 1 shadow" in done.stdout.splitlines()
    assert [kind for kind, _ in read_back(tmp_path / "out")] == ["shadow", "rock"]


@pytest.mark.parametrize(
    "files",
    [
        {"a.yaml": "names: [rock, shadow]", "data.yaml": "names: [shadow, rock]"},
        {"labels/classes.txt": "rock\nshadow", "data.yaml": "names: [shadow, rock]"},
        {"classes.txt": "rock\nshadow", "obj.names": "shadow\nrock"},
        {"data.yaml": "names: {rock: 0, shadow: 1}"},
        {"data.yaml": "names: rock"},
        {"data.yaml": "names: [rock]"},
        {"data.yaml": "names: [rock, rock]"},
        {"data.yaml": "names: [rock, pebble]"},
        {"data.yaml": "names: [rock, shadow]\nkpt_shape: [4, 3]"},
    ],
)
def test_an_ambiguous_class_list_is_an_error(tmp_path, files):
    write(tmp_path / f"set/labels/{KEY}.txt", LINES)
    for name, content in files.items():
        write(tmp_path / "set" / name, content)
    with pytest.raises(FormatError):
        import_labels(tmp_path / "set", tmp_path / "out", site=POLAR)


def test_names_of_roboflow_are_read_and_other_files_counted(tmp_path):
    write(tmp_path / f"set/train/labels/{KEY}_png.rf.0123456789abcdef.txt", LINES)
    write(tmp_path / f"set/valid/labels/{OTHER}_jpg.rf.AbC9.txt", LINES)
    write(tmp_path / "set/README.roboflow.txt", "made by a tool")
    write(tmp_path / "set/data.yaml", "names: [shadow, rock]")
    done = import_labels(tmp_path / "set", tmp_path / "out", site=POLAR)
    assert (done.photos, done.boxes, done.skipped.total()) == (2, 4, 1)
    write(tmp_path / f"set/train/labels/{KEY}_png.rf.ffff.txt", LINES)  # an augmented copy
    with pytest.raises(FormatError, match=str(KEY)):
        import_labels(tmp_path / "set", tmp_path / "again", site=POLAR)
    write(tmp_path / "none/holiday.txt", LINES)
    with pytest.raises(FormatError, match=r"holiday\.txt"):
        import_labels(tmp_path / "none", tmp_path / "again", site=POLAR)


@pytest.mark.parametrize(
    "lines",
    [
        "0 0.5 0.5 0.05 0.05 17",
        "0 0.5 0.5 0.05 0.05\n0 0.5 0.5 0.05 0.05 0.9 1",
        "0 0.5 0.5 0.05 0.05 0.9 3",
        "0 0.5 0.5 0.05 0.05 0.9 1.7",
        "0 0.5 0.5 0.05 0.05 1 0.9",
        "0 0.5 0.5 0.05 0.05 0.9 0.1 0.2",
        "0 968 608 97 61",
    ],
)
def test_invalid_yolo_lines_are_errors_with_the_line(tmp_path, lines):
    path = write(tmp_path / f"set/{KEY}.txt", lines + "\n")
    with pytest.raises(FormatError):
        import_labels(tmp_path / "set", tmp_path / "out", site=POLAR)
    for read in (yolo.read_boxes, yolo.read_detections, yolo.read_boxes_or_polygons,
                 yolo.read_polygons, yolo.read_shapes):  # fmt: skip
        with pytest.raises(FormatError):
            read(path, SIZE)


def zipped(folder, archive, separator="/"):
    with zipfile.ZipFile(archive, "w") as file:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            entry = zipfile.ZipInfo(str(path.relative_to(folder)).replace("/", separator))
            file.writestr(entry, path.read_bytes())
    return archive


@pytest.mark.parametrize("form", [None, "cvat", "coco", "yolo", "label-studio"])
@pytest.mark.parametrize("how", ["folder", "zip", "zip of Windows"])
def test_exports_are_read_as_they_were_downloaded(tmp_path, form, how):
    content = {
        "cvat": {"annotations.xml": cvat(SOUND), "images/a.png": "no picture"},
        "coco": {"annotations/instances_default.json": coco_file({"bbox": [900, 590, 100, 20]}), "images/a.png": ""},
        "yolo": {f"obj_train_data/{KEY}.txt": "1 0.490702 0.493421 0.051653 0.016447\n", "obj.names": "shadow\nrock\n"},
        "label-studio": {
            "project-1.json": [studio(result("labels", {**percent([900, 590, 1000, 610]), "labels": ["rock"]}))]
        },
    }
    for name, text in content[form or "cvat"].items():
        write(tmp_path / "set" / name, text)
    source = tmp_path / "set"
    if how != "folder":
        source = zipped(source, tmp_path / "set.zip", "\\" if "Windows" in how else "/")
    done = import_labels(source, tmp_path / "out", form or "auto", site=POLAR)
    assert done.boxes == 1
    ((kind, box),) = read_back(tmp_path / "out")
    np.testing.assert_allclose(box, [900, 590, 1000, 610], atol=0.1)
    assert kind == "rock"
    assert not any("tmp/tmp" in note for note in done.notes)


def test_an_archive_without_labels_is_an_error_with_the_files(tmp_path):
    write(tmp_path / "set/images/one.png", "no picture")
    with pytest.raises(FormatError, match=r"set\.zip"):
        import_labels(zipped(tmp_path / "set", tmp_path / "set.zip"), tmp_path / "out", site=POLAR)


def test_a_folder_of_two_formats_or_of_none_is_an_error_with_the_files(tmp_path):
    write(tmp_path / "set/annotations.xml", cvat(SOUND))
    write(tmp_path / "set/instances.json", coco_file({"bbox": [900, 590, 100, 20]}))
    with pytest.raises(FormatError, match=r"annotations\.xml.*instances\.json"):
        import_labels(tmp_path / "set", tmp_path / "out", site=POLAR)
    assert import_labels(tmp_path / "set", tmp_path / "out", "coco", site=POLAR).boxes == 1
    with pytest.raises(FormatError, match=r"annotations\.xml"):
        import_labels(tmp_path / "set", tmp_path / "more", "yolo", site=POLAR)


@pytest.mark.parametrize("tool", ["cvat", "label-studio"])
def test_exports_of_polarsim_read_back(tmp_path, tool):
    drawn = [("rock", [0, 0, 40, 9]), ("shadow", [1800, 1100, 1930, 1216]), ("rock", [701, 303, 705, 311])]
    if tool == "cvat":
        labels = [Annotation(kind, number, np.array(box, float)) for number, (kind, box) in enumerate(drawn)]
        coco.write_coco(tmp_path / "set/annotations/instances_default.json", {KEY: labels, OTHER: []}, polar(), SIZE)
        write_json(tmp_path / "set/labels.json", cvat_labels())
    else:
        rows = [
            key_columns(KEY) | {"kind": kind, "rock": number, "source": "fused", "confidence": 0.8}
            | dict(zip(("x0", "y0", "x1", "y1"), map(float, box), strict=True))
            for number, (kind, box) in enumerate(drawn)
        ]  # fmt: skip
        write(tmp_path / "set/tasks.json", label_studio_tasks(label_table(rows), [KEY, OTHER], "set/images", SIZE))
        write(tmp_path / "set/interface.xml", "<View/>")
    done = import_labels(tmp_path / "set", tmp_path / "out", site=POLAR)
    assert sorted(read_back(tmp_path / "out")) == sorted(drawn)
    assert (done.boxes, done.skipped, done.empty) == (len(drawn), {}, [str(OTHER)])


@pytest.mark.parametrize("size", [(WIDTH, HEIGHT), (968, 608)])
def test_detections_read_back_from_coco_and_label_files(tmp_path, size):
    box = np.array([100, 100, 150, 130], float)
    found = Annotation("shadow", -1, box, confidence=0.7312)
    image = {"id": 1, "file_name": f"../photos/{KEY}.png", "width": size[0], "height": size[1]}
    coco.write_coco_images(tmp_path / "found/coco.json", [(image, [found])], "Found by a detector")
    yolo.write_boxes(tmp_path / f"found/labels/{KEY}.txt", np.array([1]), box[None], size, np.array([0.7312]))
    for source in ("coco.json", "labels"):
        done = import_labels(tmp_path / "found" / source, tmp_path / f"from {source}", site=POLAR)
        ((kind, back),) = read_back(tmp_path / f"from {source}")
        np.testing.assert_allclose(back, box * WIDTH / size[0], atol=0.1)
        assert (kind, done.skipped) == ("shadow", {})
    with pytest.raises(FormatError, match="--format"):
        import_labels(tmp_path / "found", tmp_path / "both", site=POLAR)
    image["file_name"] = "holiday.png"
    coco.write_coco_images(tmp_path / "other.json", [(image, [found])], "Found by a detector")
    with pytest.raises(FormatError, match=r"holiday\.png"):
        import_labels(tmp_path / "other.json", tmp_path / "other", site=POLAR)
