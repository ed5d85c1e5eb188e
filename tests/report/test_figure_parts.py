"""Parts of figures: styles of curves, positions of names, scales of axes."""

import numpy as np
import pandas as pd
import pytest

from polarsim.annotate.overlay import OverlayStyle, draw_labels
from polarsim.formats.tables import label_table
from polarsim.geometry.size_frequency import fit_abundance
from polarsim.photo import COLOURS
from polarsim.render.parameters import HAPKE_SETS
from polarsim.report.figures.brdf import line_style
from polarsim.report.figures.canvas import FIGURE_WIDTH, name_positions, note, page
from polarsim.report.figures.detections import _with_boxes
from polarsim.report.figures.offsets import RANGES_MM, range_mm
from polarsim.report.figures.rock_sizes import draw_numbers, draw_terrains
from tests.support.label_rows import label_row

LETTER = (0.09, 0.13)


def test_every_parameter_set_has_a_different_style():
    styles = [tuple(line_style(number).values()) for number in range(len(HAPKE_SETS))]
    assert len(set(styles)) == len(HAPKE_SETS) > 6  # more sets than colours


def test_names_of_adjacent_boxes_do_not_overlap():
    boxes = {"195": (-1.3, 0.9, -1.1, 1.1), "180": (-1.25, 0.7, -1.1, 0.9), "182": (-0.8, 0.8, -0.6, 1.0)}
    boxes |= {"181": (-0.78, 0.78, -0.58, 0.98)}  # nearly the same rock
    positions = name_positions(boxes, LETTER)
    assert set(positions) == set(boxes)
    names = list(positions)
    for number, name in enumerate(names):
        for other in names[:number]:
            distance = np.abs(np.subtract(positions[name], positions[other]))
            assert distance[0] >= 0.98 * 3 * LETTER[0] or distance[1] >= 0.98 * LETTER[1], (name, other)


def test_the_name_of_a_single_box_is_above_it():
    assert name_positions({"7": (0.0, 0.0, 1.0, 1.0)}, LETTER) == {"7": (0.5, 1 + LETTER[1] / 2)}


@pytest.mark.parametrize(("spread_mm", "reach_mm"), [(0.2, 0.5), (0.6, 2.0), (3.0, 10.0), (500.0, 20.0)])
def test_the_colour_scale_covers_95_percent_of_the_offsets(spread_mm, reach_mm):
    offsets = np.random.default_rng(0).normal(0, spread_mm, 20_000)
    offsets[0] = 1e4  # outliers are ignored
    assert range_mm(offsets) == reach_mm
    assert reach_mm in RANGES_MM


def test_predicted_boxes_do_not_cover_rock_ids():
    labels = label_table([label_row("01_A_off_30_L_0256", rock=188, box=(600, 500, 900, 700))])
    grey = np.full((1216, 1936, 3), 90, np.uint8)
    through = pd.DataFrame(
        {"x0": 0.0, "x1": 1900.0, "y0": np.arange(460.0, 500, 4), "y1": 1200.0}
    )  # the rows of the id's digits
    labels_only, with_boxes = (_with_boxes(grey, labels, rows, 968).astype(int) for rows in (through[:0], through))
    letters = np.abs(labels_only - COLOURS["rock"]).max(axis=-1) < 30
    assert letters.sum() > 100
    assert (np.abs(with_boxes - labels_only).max(axis=-1)[letters] == 0).all()


def test_the_letter_size_of_labels_can_be_set():
    table = label_table([label_row("01_A_off_30_L_0256", rock=188, box=(600, 500, 900, 700))])
    grey = np.full((1216, 1936, 3), 90, np.uint8)
    images = [draw_labels(grey, table, 400, OverlayStyle(letter_px=size)).astype(int) for size in (0, 20)]
    small, large = (int((np.abs(image - COLOURS["rock"]).max(axis=-1) < 60).sum()) for image in images)
    assert large > small + 60


def test_a_long_note_is_not_cut(tmp_path):  # by _words_are_whole
    with page(tmp_path / "note.png", FIGURE_WIDTH, 300) as sheet:
        note(sheet, "The smallest phase angle in this run is 17.4 degrees (01_A_off_30_R_0128), too far from " * 2)


@pytest.mark.parametrize(
    "diameters",
    [
        {"yard-a": np.geomspace(0.07, 0.36, 34), "yard-b": np.geomspace(0.04, 0.14, 11)},
        {"yard-a": np.array([0.36]), "a-long-name-of-a-test-yard": np.geomspace(0.03, 0.3, 30)},
        {1: np.geomspace(0.05, 0.3, 50), 3: np.array([0.9]), 6: np.zeros(0), 11: np.array([0.1, 0.2])},
    ],
)
def test_names_of_terrains_are_inside_the_axes_of_rock_sizes(tmp_path, diameters):
    every, areas = np.concatenate(list(diameters.values())), dict.fromkeys(diameters, 18.0)
    area = sum(areas.values())
    with page(tmp_path / "sizes.png", FIGURE_WIDTH, 640) as sheet:
        axes = sheet.subplots(1, 3)[0]
        draw_terrains(axes, diameters, areas)
        draw_numbers(axes, every, area, fit_abundance(every, area, 0.08), 0.08)
        sheet.draw_without_rendering()
        frame = axes.get_window_extent()
        names = {text.get_text(): text.get_window_extent() for text in axes.texts}
    assert len(names) == sum(len(values) > 0 for values in diameters.values())
    for name, box in names.items():
        assert frame.x0 <= box.x0 < box.x1 <= frame.x1, name
        assert frame.y0 <= box.y0 < box.y1 <= frame.y1, name
