import itertools

import cv2
import numpy as np
import pandas as pd
import pytest

from polarsim.formats import obj, png, release, yolo
from polarsim.formats.tables import label_table, typed, write_csv, write_parquet
from polarsim.geometry.boxes import box_around_points
from polarsim.geometry.casters import make_caster
from polarsim.photo import BOX_CLASSES, PhotoKey
from polarsim.report.figures import comparison
from polarsim.report.figures.canvas import FIGURE_WIDTH, PREDICTED, rgb
from polarsim.report.figures.comparison import draw_comparison
from polarsim.report.figures.cover_photos import cover_key
from polarsim.report.figures.detectors import draw_detection, draw_ipd
from polarsim.report.figures.difference import STOPS, _palette
from polarsim.report.figures.labels import draw_label_errors, draw_reliability, edge_errors
from polarsim.report.figures.offsets import draw_offsets
from polarsim.report.figures.residuals import draw_residuals
from polarsim.report.figures.terrain import STEP, draw_terrain, oblique, oblique_view, top_view
from polarsim.run_files.inventory import Inventory, write_inventory
from polarsim.run_files.rigs import read_all_localised
from polarsim.run_files.scene import read_terrain
from polarsim.schemas.evaluation import LABEL_PAIRS
from polarsim.schemas.report import DETECTION, IPD
from polarsim.scoring.label_pairs import EDGES, TRUE_EDGES
from polarsim.scoring.reliability import COLUMNS as RELIABILITY_COLUMNS
from polarsim.site import polar
from tests.report.pixels import coloured, is_drawn
from tests.support.label_rows import label_row
from tests.support.polar_photos import SIZE
from tests.support.polar_survey import SANDBOX

NARROW = 600  # px
WIDE = 1300  # px
ORIGIN = {"run": "demo", "source": "analog", "config": "1a2b3c4d"}
KEY = PhotoKey.parse("03_A_off_30_L_0256")


def terrain_drawn(folder, to):
    draw_terrain(
        site=polar(),
        terrain=3,
        rocks=folder / "rocks.parquet",
        meshes=folder / "meshes",
        meshes_figure=to / "meshes.png",
        crops_figure=to / "crops.png",
        width=NARROW,
    )
    return to / "meshes.png", to / "crops.png"


def test_figures_of_meshes_are_reproducible_and_depend_on_rocks_and_the_source_of_the_ground(tmp_path, world):
    world.write(tmp_path)
    shown = terrain_drawn(tmp_path, tmp_path / "shown")
    assert all(is_drawn(figure) and coloured(figure) > 0.01 for figure in shown)
    bare = tmp_path / "bare"
    world.write(bare, rocks=())
    first, second = (terrain_drawn(bare, tmp_path / name) for name in ("first", "second"))
    for figure, repeated in zip(first, second, strict=True):
        assert is_drawn(figure)
        assert figure.read_bytes() == repeated.read_bytes()
    write_csv(bare / "meshes/meshes.csv", pd.DataFrame([{"mesh": obj.ground_name(3), "made_from": "fitted"}]))
    fitted, _ = terrain_drawn(bare, tmp_path / "fitted")
    assert fitted.read_bytes() != first[0].read_bytes()


def offsets_drawn(folder, rows, name, width=WIDE):
    columns = {"rock": "int64", **dict.fromkeys(("x", "y", "z", "offset_mm"), "float64")}
    write_parquet(folder / "offsets.parquet", pd.DataFrame(rows, columns=list(columns)).astype(columns))
    draw_offsets(site=polar(), terrain=3, offsets=folder / "offsets.parquet", figure=folder / name, width=width)
    return png.read_png(folder / name)[..., :3].astype(int)


def test_surface_outside_the_true_one_is_drawn_red_and_inside_blue(tmp_path):
    rng = np.random.default_rng(1)
    points = rng.uniform(-1.5, 1.5, (3000, 3))
    counts = []
    for offset in (5.0, -5.0):
        pixels = offsets_drawn(tmp_path, [(1, *position, offset) for position in points], f"{offset:g}.png")[:, :650]
        counts.append([((pixels[..., a] - pixels[..., b]) > 60).sum() for a, b in ((0, 2), (2, 0))])
    (red, no_blue), (no_red, blue) = counts
    assert red > 4 * no_blue  # the colour bar has some of both
    assert blue > 4 * no_red


def test_offsets_have_whole_labels_and_a_note_without_visible_surface(tmp_path):  # labels: _words_are_whole
    assert (offsets_drawn(tmp_path, [], "none.png") < 200).any()
    rows = [(rock, 0.1, 0.2, 0.3, offset) for rock in (-1, 1) for offset in (-4.0, 4.5)]
    offsets_drawn(tmp_path, rows, "offsets.png", FIGURE_WIDTH)


def described(folder, photos, covers=None):
    """Write a table of photos and an inventory with the cover photos by position; return the paths."""
    rows = [{"key": str(key), "path": str(path)} for key, path in photos.items()]
    write_parquet(folder / "photos.parquet", pd.DataFrame(rows, columns=["key", "path"]))
    write_inventory(folder / "inventory.json", Inventory(3, "analog", cover_photos=covers or {}))
    return {"photos": folder / "photos.parquet", "inventory": folder / "inventory.json"}


def residuals_drawn(folder, name, twins=None, covers=None):
    draw_residuals(
        site=polar(),
        terrain=3,
        cameras=folder / "cameras",
        meshes=folder / "meshes",
        seeds=folder / "seeds",
        **described(folder, {}, covers),
        twins=twins,
        figure=folder / name,
        width=WIDE,
    )
    return png.read_png(folder / name)[..., :3].astype(int)


def test_displaced_boxes_get_arrows_and_matching_boxes_none(tmp_path, world):
    world.write(tmp_path)
    localised = read_all_localised(tmp_path / "cameras")
    scene = read_terrain(tmp_path / "meshes", 3, SANDBOX)
    position, rig = sorted(localised.items())[0]
    boxes = np.array([box_around_points(rig.project("L", scene.rock_vertices(rock))) for rock in scene.rocks])
    arrows = []
    for off in (0, 8):
        yolo.write_boxes(
            tmp_path / "seeds" / f"03_{position}_off_30_L_0256.txt", np.zeros(len(boxes)), boxes + off, size=SIZE
        )
        pixels = residuals_drawn(tmp_path, f"{off}.png")[:-60]  # without the legend
        arrows.append((np.abs(pixels - rgb(PREDICTED)).max(axis=-1) < 40).sum())
    assert arrows[1] > 2 * arrows[0] + 50


def test_without_photos_the_background_of_residuals_is_a_twin(tmp_path, world):
    world.write(tmp_path)
    position = sorted(read_all_localised(tmp_path / "cameras"))[0]
    png.write_png(tmp_path / f"twins/03_{position}_off_30_L_0256.png", np.full((1216, 1936), 4000, np.uint16))
    (tmp_path / "seeds").mkdir(exist_ok=True)
    bare, on_twin = (
        residuals_drawn(tmp_path, name, twins=twins) for name, twins in (("a.png", None), ("b.png", tmp_path / "twins"))
    )
    assert (bare < 80).any()  # neither photos nor seeds are needed
    middle = bare.shape[0] // 2
    assert np.median(bare[middle, 50:300]) == 90
    assert np.median(on_twin[middle, 50:300]) == 255


@pytest.mark.parametrize(("off_px", "grey"), [(0, 200), (130, 90)])
def test_a_cover_photo_of_the_right_camera_is_not_a_background_of_residuals(tmp_path, world, off_px, grey):
    """The boxes of the left camera are 130 px off in a photo of the right camera."""
    world.write(tmp_path)
    position = sorted(read_all_localised(tmp_path / "cameras"))[0]
    boxes = np.array([[400.0, 500, 520, 580], [1200, 700, 1290, 760]])
    yolo.write_boxes(tmp_path / "seeds" / f"03_{position}_off_30_L_0256.txt", np.zeros(len(boxes)), boxes, size=SIZE)
    cover = np.full((1216, 1936, 3), 200, np.uint8)
    for x0, y0, x1, y1 in boxes.astype(int):
        cv2.rectangle(cover, (x0 + off_px, y0), (x1 + off_px, y1), (255, 0, 0), 4)
    png.write_png(tmp_path / "cover.png", cover)
    shown = residuals_drawn(tmp_path, "drawn.png", covers={position: "cover.png"})
    assert np.median(shown[shown.shape[0] // 2, 50:300]) == grey


def test_a_cube_from_above_has_the_true_area_height_and_position(tmp_path, world):
    world.write(tmp_path)
    scene = read_terrain(tmp_path / "meshes", 3, SANDBOX)
    top = top_view(scene, make_caster(scene.vertices, scene.faces), SANDBOX)
    on_rock = top.rock == 1
    assert on_rock.sum() * STEP**2 == pytest.approx(0.2**2, rel=0.06)
    np.testing.assert_allclose(top.height[on_rock], 0.05 + 0.1, atol=1e-5)
    rows, columns = np.nonzero(on_rock)
    assert -2 + STEP * (columns.mean() + 0.5) == pytest.approx(0.5, abs=0.01)
    assert 2 - STEP * (rows.mean() + 0.5) == pytest.approx(0.4, abs=0.01)


def test_the_oblique_view_shows_tinted_rocks_and_shadows(tmp_path, world):
    world.write(tmp_path)
    scene = read_terrain(tmp_path / "meshes", 3, SANDBOX)
    pixels = oblique_view(scene, make_caster(scene.vertices, scene.faces), oblique(polar(), 3), 400).astype(int)
    tinted = pixels[..., 0] > pixels[..., 2] + 60
    dark = pixels.max(axis=-1) < 110
    assert 50 < tinted.sum() < 0.1 * tinted.size
    assert 50 < dark.sum() < 0.1 * dark.size


def label_pairs(*rows):
    """Return a table of pairs of (kind, task, label box, true box); a missing box is None."""
    table = pd.DataFrame({name: pd.Series([None] * len(rows), dtype="object") for name in LABEL_PAIRS.dtypes})
    for row, (kind, task, box, true) in enumerate(rows):
        table.loc[row, ["kind", "task", "hit", "against"]] = [kind, task, None not in (box, true), "truth"]
        table.loc[row, list(EDGES)] = box or [np.nan] * 4
        table.loc[row, list(TRUE_EDGES)] = true or [np.nan] * 4
    defaults = {"bool": False, "float64": np.nan, "int64": 0, "terrain": 0, "str": ""}
    filled = {name: table[name].fillna(defaults[kind]) for name, kind in LABEL_PAIRS.dtypes.items()}
    return typed(filled, LABEL_PAIRS)


def test_edge_errors_are_differences_to_the_true_box_by_kind_and_task():
    true = [100, 100, 160, 140]
    errors = edge_errors(
        label_pairs(
            ("rock", "Left to Right", [102, 100, 159, 143], true),
            ("shadow", "Left to Right", None, true),
            ("rock", "other exposures", [100, 100, 160, 141], true),
            ("rock", "other exposures", true, None),
        )
    )
    assert set(errors) == {("rock", "Left to Right"), ("rock", "other exposures")}
    np.testing.assert_allclose(errors["rock", "Left to Right"], [[2, 0, -1, 3]])
    np.testing.assert_allclose(errors["rock", "other exposures"], [[0, 0, 0, 1]])


def test_label_errors_are_drawn_with_and_without_labels(tmp_path):
    pairs = label_pairs(("rock", "Left to Right", [102, 100, 161, 140], [100, 100, 160, 140]))
    write_parquet(tmp_path / "pairs.parquet", pairs)
    write_parquet(tmp_path / "none.parquet", pairs[:0])
    for name in ("pairs", "none"):
        figure = tmp_path / f"{name}.png"
        draw_label_errors(terrain=3, pairs=tmp_path / f"{name}.parquet", figure=figure, width=NARROW)
        assert is_drawn(figure)
    assert coloured(tmp_path / "pairs.png") > coloured(tmp_path / "none.png") == 0


@pytest.mark.parametrize("kinds", [("rock", "shadow"), ("shadow",)])
def test_detection_and_ipd_are_drawn_with_and_without_rocks(tmp_path, kinds):
    domains = ("analog", "principled", "hapke")
    detection = [
        (t, e, kind, "photo", 0, True, "yolov5n", "scratch", 9, 320, 9, 0, 9, 0.5, 0.3, 0.4, "view", 3, *[0.1] * 6)
        for kind in kinds
        for t, e in itertools.product(domains, domains)
    ]
    ipd = [
        ("photo", 0, t, *pair, kind, 9, 0.1, 0.2, 0.0, 0.2, 0.1, 0.3, 3, "view", "zero", "left_out", 0.25)
        for kind in kinds
        for t in domains
        for pair in itertools.combinations(domains, 2)
    ]
    write_parquet(tmp_path / "d.parquet", pd.DataFrame(detection, columns=list(DETECTION.columns[:-3])))
    write_parquet(tmp_path / "i.parquet", pd.DataFrame(ipd, columns=list(IPD.columns[:-1])))
    draw_detection(detection=tmp_path / "d.parquet", figure=tmp_path / "detection.png", origin=ORIGIN, width=NARROW)
    draw_ipd(ipd=tmp_path / "i.parquet", figure=tmp_path / "ipd.png", origin=ORIGIN, width=NARROW)
    for name in ("detection", "ipd"):
        assert is_drawn(tmp_path / f"{name}.png")
        assert (coloured(tmp_path / f"{name}.png") > 0.05) == ("rock" in kinds)


def test_differences_of_all_twins_share_a_colour_bar(tmp_path, monkeypatch):
    """With a bar each, their texts overlapped with three twins."""
    bars = []
    monkeypatch.setattr(comparison, "difference_bar", lambda figure, axes, *_: bars.append(len(axes)))
    png.write_png(tmp_path / "photo.png", np.full((1216, 1936), 700, np.uint16))
    twins = {model: tmp_path / model for model in ("principled", "hapke", "fitted")}
    for folder in twins.values():
        png.write_png(folder / f"{KEY}.png", np.full((1216, 1936), 300, np.uint16))
    write_parquet(tmp_path / "labels.parquet", label_table([]))
    draw_comparison(
        key=KEY, **described(tmp_path, {KEY: tmp_path / "photo.png"}), twins=twins, labels=tmp_path / "labels.parquet",
        rendered=None, figure=tmp_path / "figure.png", size=(1936, 1216), width=2 * NARROW,
    )  # fmt: skip
    assert bars == [3]


def test_a_comparison_shows_the_available_images(tmp_path):
    png.write_png(tmp_path / "photo.png", np.full((1216, 1936), 700, np.uint16))
    png.write_png(tmp_path / f"hapke/{KEY}.png", np.full((1216, 1936), 300, np.uint16))
    write_parquet(tmp_path / "labels.parquet", label_table([label_row(KEY, "rock", 1, (100, 100, 500, 400))]))
    twins = {"principled": tmp_path / "none", "hapke": tmp_path / "hapke"}
    arguments = {
        "key": KEY,
        "labels": tmp_path / "labels.parquet",
        "rendered": None,
        "width": 2 * NARROW,
        "size": (1936, 1216),
    }
    with_photo = described(tmp_path, {KEY: tmp_path / "photo.png"})
    draw_comparison(**arguments, **with_photo, twins=twins, figure=tmp_path / "two.png")
    draw_comparison(**arguments, **described(tmp_path, {}), twins={}, figure=tmp_path / "none.png")
    shown = png.read_png(tmp_path / "two.png")
    # Photo left of the twin, with the white level of the photo: the twin has 284 DN above black, the photo 684 DN.
    rows = shown.shape[0]
    photo, twin = (np.median(shown[round(0.25 * rows) :][:20, at : at + 40]) for at in (280, 880))
    assert photo == 255
    assert twin == pytest.approx(255 * (284 / 684) ** (1 / 2.2), abs=2)
    # The twin is 1.27 stops too dark: the difference is blue, and the colour bar below it is red at the right end.
    difference = np.median(shown[round(0.65 * rows) :][:20, 880:920], axis=(0, 1))
    expected = _palette()[127 - round(127 * np.log2(684 / 284) / STOPS)]
    assert difference.tolist() == pytest.approx(expected.tolist(), abs=2)
    reds = (shown[round(0.8 * rows) :].astype(int) @ [1, -1, -1]) > 50
    assert reds[:, 900:].sum() > 20 > reds[:, :900].sum()
    assert is_drawn(tmp_path / "none.png", 2 * NARROW)


@pytest.mark.release
@pytest.mark.parametrize(("position", "camera"), [("A", "R"), ("C", "L")])
def test_a_cover_photo_is_identified_by_red_boxes(release_root, position, camera):
    """By visual inspection, 03 A is of the right camera and 03 C of the left camera."""
    cover = png.read_png(release.cover_photos(release_root, 3)[position])
    keys = [key for key in release.label_files(release_root, 3) if key.light == "off" and key.exposure_ms == 256]
    keys = [key for key in keys if key.position == position]
    assert cover_key(cover, hand_drawn(release_root, keys), keys, SIZE).camera == camera


@pytest.mark.release
def test_a_cover_photo_with_numbers_only_is_not_identified(release_root):
    cover = png.read_png(release.cover_photos(release_root, 4)["C"])
    keys = [key for key in release.label_files(release_root, 4) if key.position == "C" and key.exposure_ms == 256]
    assert cover_key(cover, hand_drawn(release_root, keys), keys, SIZE) is None


def hand_drawn(root, keys):
    rows = []
    for key in keys:
        classes, boxes = yolo.read_boxes(release.label_folder(root, key.terrain) / f"{key}.txt", size=SIZE)
        rows += [label_row(key, BOX_CLASSES[number], -1, box) for number, box in zip(classes, boxes, strict=True)]
    return label_table(rows)


def reliability_drawn(folder, rows, name):
    bins = pd.DataFrame(rows, columns=list(RELIABILITY_COLUMNS)).astype(RELIABILITY_COLUMNS)
    write_parquet(folder / "reliability.parquet", bins)
    draw_reliability(reliability=folder / "reliability.parquet", figure=folder / name, origin=ORIGIN, width=WIDE)
    return png.read_png(folder / name)[..., :3].astype(int)


def test_markers_of_confidence_and_share_coincide_if_the_confidence_is_calibrated(tmp_path):
    extents = {}
    for share in (0.5, 0.7, 0.98):
        point = {"kind": "rock", "label_source": "seed", "labels": 50, "low": 0.98, "high": 0.98, "confidence": 0.98}
        shares = dict.fromkeys(("right", "right_low", "right_high"), share) | {"brier": 0.1}
        pixels = reliability_drawn(tmp_path, [point | shares], f"{share}.png")[:-80, :650]  # without the legend
        row = np.argwhere(is_blue(pixels))[-1, 0] - 4  # the lowest marker, below the title of the source
        columns = np.flatnonzero(is_blue(pixels[row - 4 : row + 4]).any(axis=0))
        extents[share] = columns[-1] - columns[0]
    assert extents[0.98] < 20 < extents[0.7] < extents[0.5]


def is_blue(pixels):
    return (pixels[..., 2] > 130) & (pixels[..., 0] < 60)


def test_the_bars_of_label_errors_range_from_the_first_to_the_third_quartile(tmp_path):
    """The width of the bars is proportional to the spread of the errors."""
    widths = []
    for spread in (2, 8):
        rows = [
            ("rock", "other exposures", [100 + e, 100 + e, 160 + e, 140 + e], [100, 100, 160, 140])
            for e in np.linspace(-spread, spread, 41)
        ]
        write_parquet(tmp_path / "pairs.parquet", label_pairs(*rows))
        draw_label_errors(terrain=3, pairs=tmp_path / "pairs.parquet", figure=tmp_path / "errors.png", width=WIDE)
        blue = is_blue(png.read_png(tmp_path / "errors.png")[..., :3].astype(int)[:-50, : WIDE // 2])
        widths.append((blue.sum(axis=0) > 30).sum())  # columns of bars, not of lines
    assert widths[1] == pytest.approx(4 * widths[0], rel=0.1)


def test_a_run_without_compared_labels_has_a_note(tmp_path):
    assert (reliability_drawn(tmp_path, [], "none.png") < 200).any()
