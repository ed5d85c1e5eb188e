from html.parser import HTMLParser

import numpy as np

from polarsim.formats import png, tables, yolo
from polarsim.lint.errata import lint_and_draw
from polarsim.site import polar
from tests.lint.conftest import BOXES, CLASSES, KEY, path
from tests.support.polar_photos import HEIGHT, SIZE, WIDTH


class Counted(HTMLParser):
    """Count tags and classes of shapes in a page."""

    def __init__(self):
        super().__init__()
        self.seen = {}

    def handle_starttag(self, tag, attrs):
        for name in [tag, *dict(attrs).get("class", "").split()]:
            self.seen[name] = self.seen.get(name, 0) + 1


def annotated(root, tmp_path, twins=()):
    lint_and_draw(
        site=polar(), root=root, twins=twins, page=tmp_path / "errata.html", table=tmp_path / "defects.csv", workers=1
    )
    page = Counted()
    page.feed((tmp_path / "errata.html").read_text())
    return page.seen, tables.read_csv(tmp_path / "defects.csv", ["code", "severity", "file", "line"])


def test_each_defect_has_a_figure_with_wrong_and_missing_boxes(root, tmp_path):
    yolo.write_boxes(path(root, 1024), CLASSES[1:], BOXES[1:], size=SIZE)  # the first rock is missing
    yolo.write_boxes(path(root, 512), [*CLASSES, 1], [*BOXES, BOXES[-1]], size=SIZE)  # the last shadow is repeated
    seen, table = annotated(root, tmp_path)
    assert sorted(table["code"]) == ["B201", "E301", "E305"]
    assert (seen["svg"], seen["lacking"], seen["wrong"]) == (3, 1, 2)
    assert seen["shape"] == 5 + 6 + 6


def test_a_defect_is_drawn_on_the_twin_of_its_photo(root, tmp_path):
    yolo.write_boxes(path(root, 1024), CLASSES[1:], BOXES[1:], size=SIZE)
    yolo.write_boxes(path(root, 512), [*CLASSES, 1], [*BOXES, BOXES[-1]], size=SIZE)
    twins = tmp_path / "twins"
    twins.mkdir()
    png.write_png(twins / f"{KEY.with_exposure(512)}.png", np.full((HEIGHT, WIDTH), 900, np.uint16))
    seen, _ = annotated(root, tmp_path, [twins])
    assert (seen["svg"], seen["image"]) == (3, 2)  # both findings of 512 ms, not the finding of 1,024 ms


def test_a_sound_set_has_an_empty_page(root, tmp_path):
    seen, table = annotated(root, tmp_path)
    assert len(table) == 0
    assert "svg" not in seen
