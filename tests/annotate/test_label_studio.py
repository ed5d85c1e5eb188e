from xml.etree import ElementTree

import pytest

from polarsim.annotate.export import label_studio_interface, label_studio_tasks
from polarsim.formats.tables import key_columns, label_table
from polarsim.photo import NO_ROCK, PhotoKey
from polarsim.site import polar

KEY = PhotoKey.parse("01_A_off_30_L_0256")


def label(kind, rock, box, confidence=1.0):
    row = {"kind": kind, "rock": rock, "source": "fused", "confidence": confidence}
    return key_columns(KEY) | row | dict(zip(("x0", "y0", "x1", "y1"), map(float, box), strict=True))


def results(rows):
    """Rectangles and relations of the only task."""
    (task,) = label_studio_tasks(label_table(rows), [KEY], "out/images", polar().images.size)
    (prediction,) = task["predictions"]
    parts = prediction["result"]
    return [part for part in parts if part["type"] != "relation"], [
        part for part in parts if part["type"] == "relation"
    ]


def test_positions_are_percentages_of_the_image_size():
    ((rectangle,), _) = results([label("rock", 7, (193.6, 608, 387.2, 912), 0.75)])
    assert rectangle["value"] == {
        "x": 10, "y": 50, "width": 10, "height": 25, "rotation": 0, "rectanglelabels": ["rock"],
    }  # fmt: skip
    assert (rectangle["original_width"], rectangle["original_height"]) == (1936, 1216)
    assert rectangle["score"] == 0.75
    assert rectangle["meta"] == {"text": ["rock 7"]}


def test_a_shadow_is_related_only_to_the_rock_with_the_same_id():
    rows = [
        label("rock", 7, (10, 10, 20, 20)),
        label("rock", NO_ROCK, (30, 10, 40, 20)),
        label("shadow", 7, (5, 15, 12, 22)),
        label("shadow", NO_ROCK, (25, 15, 32, 22)),
        label("shadow", 8, (45, 15, 52, 22)),
    ]
    rectangles, (relation,) = results(rows)
    by_id = {part["id"]: part for part in rectangles}
    assert len(by_id) == len(rows)
    assert by_id[relation["from_id"]]["value"]["x"] * 19.36 == pytest.approx(5, abs=1e-3)
    assert by_id[relation["to_id"]]["value"]["x"] * 19.36 == pytest.approx(10, abs=1e-3)


def test_the_interface_has_the_names_in_rectangles():
    ((rectangle,), _) = results([label("rock", 7, (10, 10, 20, 20))])
    interface = ElementTree.fromstring(label_studio_interface())
    (image,), (labels,) = interface.findall("Image"), interface.findall("RectangleLabels")
    assert image.get("value") == "$image"
    assert (labels.get("name"), labels.get("toName")) == (rectangle["from_name"], rectangle["to_name"])
    assert image.get("name") == rectangle["to_name"]
    assert [part.get("value") for part in labels] == ["rock", "shadow"]
