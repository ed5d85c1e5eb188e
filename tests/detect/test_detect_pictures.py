"""`polarsim detect`: images of any size and bit depth, and the output files."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from polarsim.annotate.detections import draw_detections
from polarsim.cli import app
from polarsim.detect import detectors, tone
from polarsim.detect.detect_pictures import detect_in_images, prediction_options, read_any
from polarsim.detect.inference_widths import ClassInferenceWidths, InferenceWidths
from polarsim.detect.options import PACKAGED, PredictionOptions
from polarsim.detect.predict import predict_images
from polarsim.errors import DetectError
from polarsim.geometry.boxes import iou
from polarsim.geometry.images import resize_longer_side
from polarsim.photo import BOX_CLASSES, ROCK
from tests.detect.lumps import CENTRES, lit_lumps

torch = pytest.importorskip("torch")
BOX = np.array([100, 80, 180, 140], float)  # bright block in an image of 640 x 400 px


@pytest.fixture
def weights(tmp_path):
    from polarsim.detect.detectors.compact.weights import network

    state = {name: value.half() for name, value in network("compact").state_dict().items()}
    detectors.write_detector(tmp_path / "blocks.pt", detectors.Detector("compact", 320, 1, "scratch", state))
    return tmp_path / "blocks.pt"


def brightest(pictures):
    """Replace the network by a function that returns the box of the bright block in each image."""
    points = [np.argwhere(picture > 200) for picture in pictures]
    return [np.array([[*p.min(0)[::-1], *(p.max(0)[::-1] + 1), 0.9, 0]], float) for p in points]


@pytest.fixture
def block_finder(monkeypatch):
    class Family:
        load = staticmethod(lambda *_: brightest)

    monkeypatch.setattr("polarsim.detect.detectors.models.family", lambda _: Family)


def picture(size=(640, 400), depth=np.uint8, channels=1):
    scale = size[0] / 640
    x0, y0, x1, y1 = (BOX * scale).astype(int)
    bright, dark = {np.uint8: (250, 40), np.uint16: (60000, 3000)}[depth]
    pixels = np.full((size[1], size[0]), dark, depth)
    pixels[y0:y1, x0:x1] = bright
    return pixels if channels == 1 else np.repeat(pixels[..., None], channels, axis=2)


def test_boxes_are_in_pixels_of_each_picture_whatever_its_size_depth_and_colour(weights, block_finder, tmp_path):
    folder = tmp_path / "in"
    folder.mkdir()
    cv2.imwrite(str(folder / "whole.png"), picture())
    cv2.imwrite(str(folder / "half.png"), picture((320, 200)))
    cv2.imwrite(str(folder / "colour.jpg"), picture(channels=3))
    cv2.imwrite(str(folder / "deep.tif"), picture(depth=np.uint16))
    (folder / "empty.jpg").touch()
    (folder / "broken.png").write_bytes((folder / "whole.png").read_bytes()[:200])
    found = detect_in_images(
        pictures=[folder], weights=[weights], out=tmp_path / "out", options=PredictionOptions(), threads=1,
        draw=draw_detections,
    )  # fmt: skip
    assert found["picture"].tolist() == [
        "colour.jpg",
        "deep.tif",
        "half.png",
        "whole.png",
    ]  # without these two
    corners = found[["x0", "y0", "x1", "y1"]].to_numpy()
    np.testing.assert_allclose(corners[[0, 1, 3]], [BOX] * 3, atol=2.5)  # one input pixel is two image pixels
    np.testing.assert_allclose(corners[2], BOX / 2, atol=1.5)
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "out/detections.csv"), found, check_dtype=False)
    fields = (tmp_path / "out/labels/half.txt").read_text().split()
    assert (fields[0], fields[5]) == ("0", "0.9000")
    np.testing.assert_allclose(float(fields[1]) * 320, (corners[2, 0] + corners[2, 2]) / 2, atol=0.1)
    images = {row["file_name"]: row for row in json.loads((tmp_path / "out/coco.json").read_text())["images"]}
    assert all((tmp_path / "out" / name).is_file() for name in images)
    half = images[f"../{folder.name}/half.png"]
    assert (half["width"], half["height"]) == (320, 200)
    drawn = cv2.imread(str(tmp_path / "out/pictures/whole.jpg")).astype(int)
    assert (drawn.shape[0] > 400, drawn.shape[1]) == (True, 640)
    orange = (drawn[..., 2] - drawn[..., 0]) > 100
    x0, y0, _, y1 = BOX.round().astype(int)
    assert orange[y0 + 4 : y1 - 4, x0 - 4 : x0 + 6].any(axis=1).all()  # the left edge
    assert orange[400:].sum() > 50  # the legend
    assert drawn[y0 - 14 : y0 - 4, x0 : x0 + 24].std() > 20 > drawn[y0 - 14 : y0 - 4, x0 - 30 : x0 - 6].std()  # .90


def test_boxes_of_several_detectors_are_merged(weights, tmp_path, monkeypatch):
    """The second detector shifts the block by two input pixels to the right and adds a box."""

    def shifted(pictures):
        return [
            np.vstack([row + np.array([2, 0, 2, 0, 0, 0]), [10, 10, 40, 40, 0.8, 0]]) for row in brightest(pictures)
        ]

    finders = iter([brightest, shifted])

    class Family:
        load = staticmethod(lambda *_: next(finders))

    monkeypatch.setattr("polarsim.detect.detectors.models.family", lambda _: Family)
    other = weights.with_name("other.pt")
    other.write_bytes(weights.read_bytes())
    cv2.imwrite(str(tmp_path / "one.png"), picture())
    found = detect_in_images(
        pictures=[tmp_path / "one.png"], weights=[weights, other], out=tmp_path / "out", options=PredictionOptions(),
        threads=1,
    )  # fmt: skip
    assert found["confidence"].tolist() == [0.9, 0.4]
    np.testing.assert_allclose(found.loc[0, ["x0", "x1"]].astype(float), BOX[[0, 2]] + 2, atol=2.5)  # shift of 4 px / 2
    assert "blocks.pt, other.pt" in (tmp_path / "out/coco.json").read_text()


def test_unusable_input_is_a_one_line_error_without_output(weights, tmp_path):
    def run(*pictures, out=tmp_path / "out"):
        detect_in_images(pictures=pictures, weights=[weights], out=out, options=PredictionOptions(), threads=1)

    (tmp_path / "text.png").write_text("no picture")
    (tmp_path / "empty").mkdir()
    for name, times in (("text.png", 1), ("empty", 1), ("absent.png", 1), ("text.png", 2)):
        with pytest.raises(DetectError) as error:
            run(*[tmp_path / name] * times)
        assert error.value.path == tmp_path / name
    with pytest.raises(DetectError):
        run(tmp_path / "text.png", out=tmp_path / "empty")
    assert not (tmp_path / "out").exists()


def test_pictures_in_floats_are_refused(tmp_path):
    cv2.imwrite(str(tmp_path / "float.tif"), np.ones((8, 8), np.float32))
    with pytest.raises(DetectError):
        read_any(tmp_path / "float.tif")


def test_inconsistent_options_are_a_one_line_error():
    assert prediction_options(["512", "896"], ["64"], "cpu").gates_px == (64.0,)
    for widths, gates in ((["wide"], []), (["512", "896"], [])):
        with pytest.raises(DetectError):
            prediction_options(widths, gates, "cpu")


def test_an_image_of_a_different_aspect_ratio_is_not_stretched():
    """In a 16:9 image of a rover, boxes must not be scaled vertically to the aspect ratio of photos (1.12)."""
    pixels = np.zeros((1080, 1920), np.uint8)
    pixels[600:700, 400:520] = 255

    (found,) = predict_images(
        brightest, [pixels], ClassInferenceWidths.same(InferenceWidths((960,))), 0.5, (1920, 1080)
    )
    np.testing.assert_allclose(found[0, :4], [400, 600, 520, 700], atol=2.1)


@pytest.mark.parametrize(
    ("model", "precision", "there"),
    [
        ("compact", "float32", True),
        ("compact", "bfloat16", True),
        ("compact", "bfloat16", False),
        ("yolov5n", "bfloat16", True),
        ("yolov5n", "bfloat16", False),
    ],
)
def test_a_detector_uses_the_requested_precision_or_fails(weights, tmp_path, monkeypatch, model, precision, there):
    """Neither the processor nor the command changes the precision."""
    seen = []
    monkeypatch.setattr("polarsim.detect.detectors.models.has_bfloat16", lambda _: there)

    class Family:
        load = staticmethod(
            lambda *_: lambda pictures: seen.append(torch.is_autocast_enabled("cpu")) or brightest(pictures)
        )

    monkeypatch.setattr("polarsim.detect.detectors.models.family", lambda _: Family)
    detectors.write_detector(weights, replace(detectors.read_detector(weights), model=model))
    cv2.imwrite(str(tmp_path / "one.png"), picture())
    given = [str(tmp_path / "one.png"), "--out", str(tmp_path / "out"), "--weights", str(weights), "--device", "cpu"]
    done = CliRunner().invoke(app, ["detect", *given, *([] if precision == "float32" else ["--precision", precision])])
    if precision == "float32" or there:
        assert done.exit_code == 0
        assert f"precision {precision}" in done.output
        assert seen == [precision == "bfloat16"]
    else:
        assert isinstance(done.exception, DetectError) or done.exit_code == 1
        assert not (tmp_path / "out").exists()
        assert seen == []


@pytest.mark.parametrize(("model", "there"), [("compact", True), ("compact", False), ("yolov5n", True)])
def test_automatic_precision_is_bfloat16_if_faster(weights, monkeypatch, model, there):
    seen = []

    class Family:
        load = staticmethod(lambda *_: lambda _pictures: seen.append(torch.is_autocast_enabled("cpu")) or [])

    monkeypatch.setattr("polarsim.detect.detectors.devices.has_fast_bfloat16", lambda _: there)
    monkeypatch.setattr("polarsim.detect.detectors.models.family", lambda _: Family)
    detector = replace(detectors.read_detector(weights), model=model)
    detectors.load_detector(detector, weights.parent, PredictionOptions(precision="auto"), 1)(np.zeros((1, 32, 32)))
    assert seen == [there]


def test_bfloat16_and_float32_detect_the_same_objects():
    """Confident rocks of the packaged detector agree within one pixel on the image of lumps."""
    options = prediction_options([], [], "cpu")
    loaded = detectors.load_detector(detectors.read_detector(PACKAGED), PACKAGED.parent, options, 1)
    sizes, pictures = ClassInferenceWidths.same(InferenceWidths((960,))), [lit_lumps()]
    with torch.autocast("cpu", torch.bfloat16):
        (fast,) = predict_images(loaded, pictures, sizes, 0.5, (968, 608))
    (exact,) = predict_images(loaded, pictures, sizes, 0.5, (968, 608))
    sure = exact[(exact[:, 4] > 0.5) & (exact[:, 5] == BOX_CLASSES.index(ROCK))]
    assert len(sure) == len(CENTRES)
    overlap = iou(sure[:, :4], fast[:, :4]) * (sure[:, None, 5] == fast[:, 5])
    alike = fast[overlap.argmax(axis=1)]
    np.testing.assert_allclose(alike[:, :4], sure[:, :4], atol=1)
    np.testing.assert_allclose(alike[:, 4], sure[:, 4], atol=0.03)


def test_fused_batch_norms_do_not_change_the_output(rng, tmp_path, monkeypatch):
    """Scores and boxes of `load` agree with the training network with random batch norms."""
    from polarsim.detect.detectors.compact.weights import network, to_input

    torch.manual_seed(0)
    module, options = network("compact"), PredictionOptions(device="cpu")
    torch.nn.init.normal_(module.edges.weight, std=0.05)  # initial boxes are equal
    for value in module.state_dict().values():
        if value.ndim == 1:
            value += torch.from_numpy(rng.uniform(0, 0.5, value.shape)).to(value.dtype)
    state = {name: value.half() for name, value in module.state_dict().items()}
    answers = []
    monkeypatch.setattr(
        "polarsim.detect.detectors.compact.weights.decode_boxes",
        lambda logits, boxes, _: answers.append((logits.sigmoid(), boxes)) or [np.zeros((0, 6))] * len(logits),
    )
    pictures = rng.integers(0, 256, (2, 64, 96), np.uint8)
    detectors.load_detector(detectors.Detector("compact", 96, 1, "scratch", state), tmp_path, options, 1)(pictures)
    with torch.inference_mode():
        logits, boxes = network("compact", state).eval()(to_input(pictures, "cpu"))
    ((scores, corners),) = answers
    assert min(float(scores.std()) / 1e-3, float(corners.std())) > 1  # the output differs between cells
    torch.testing.assert_close(scores, logits.sigmoid(), rtol=0, atol=1e-4)
    torch.testing.assert_close(corners, boxes, rtol=1e-3, atol=0.01)


def test_eight_bit_images_are_averaged(rng):
    """Averages of integers agree with rounded averages of floats."""
    pixels = rng.integers(0, 256, (76, 121), np.uint8)
    np.testing.assert_allclose(resize_longer_side(pixels, 112), tone.shrink(pixels, 112), atol=0.51)


def test_rocks_of_an_underexposed_picture_are_found(tmp_path):
    """The packaged detector finds every lump at an eighth of the brightness."""
    cv2.imwrite(str(tmp_path / "dark.png"), lit_lumps() // 8)
    options = prediction_options(["960"], [], "cpu")
    found = detect_in_images(
        pictures=[tmp_path / "dark.png"], weights=[PACKAGED], out=tmp_path / "out", options=options, threads=1,
        confidence=0.5, draw=draw_detections,
    )  # fmt: skip
    rocks = found[found["kind"] == ROCK]
    middles = np.column_stack([rocks["x0"] + rocks["x1"], rocks["y0"] + rocks["y1"]]) / 2
    near = np.linalg.norm(middles[:, None] - CENTRES, axis=2).min(axis=0)
    assert near.max() < 12
    height = len(lit_lumps())
    drawn = cv2.imread(str(tmp_path / "out" / "pictures" / "dark.jpg"))
    assert drawn[:height].min(axis=2).max() > 200  # brightened; boxes and texts have no blue or no red
