"""Training, storage and inference of masks."""

import json
import shutil
from dataclasses import replace

import cv2
import numpy as np
import pytest

from polarsim.annotate.detections import draw_detections
from polarsim.detect import detectors
from polarsim.detect.dataset import dataset_images, image_entry, write_yolo_dataset
from polarsim.detect.detect_pictures import detect_in_images, prediction_options
from polarsim.detect.masks import class_mask, segment_pictures, within_boxes
from polarsim.detect.options import PACKAGED, PredictionOptions, TrainingOptions
from polarsim.errors import DetectError
from polarsim.formats import png, tables, yolo
from polarsim.run_files import class_masks
from tests.detect.conftest import train

torch = pytest.importorskip("torch")

from polarsim.detect.detectors.compact.loss import MASK_WEIGHT, mask_loss  # noqa: E402
from polarsim.detect.detectors.compact.network import STRIDE  # noqa: E402
from polarsim.detect.detectors.compact.pictures import TrainingImage, augment, class_shares  # noqa: E402
from polarsim.detect.detectors.compact.training import _mean_iou, fitness_of  # noqa: E402
from polarsim.detect.detectors.compact.weights import network  # noqa: E402
from tests.support.polar_photos import HEIGHT, WIDTH  # noqa: E402

PREDICTION = PredictionOptions(device="cpu")
SIZE = (64, 40)  # width and height of test images, px
GROUND, ROCK, SHADOW = range(3)


def scene(random) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return image and mask (h, w) and boxes (2, 4) of a bright rock with a dark shadow on grey ground."""
    x, y = random.integers(4, 30), random.integers(4, 20)
    picture, mask = np.full(SIZE[::-1], 110, np.uint8), np.zeros(SIZE[::-1], np.uint8)
    boxes = np.array([[x, y, x + 12, y + 12], [x + 12, y, x + 28, y + 12]])
    for kind, value, (x0, y0, x1, y1) in ((ROCK, 230, boxes[0]), (SHADOW, 10, boxes[1])):
        picture[y0:y1, x0:x1], mask[y0:y1, x0:x1] = value, kind
    return picture, mask, boxes


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    folder, random = tmp_path_factory.mktemp("masks"), np.random.default_rng(0)
    entries = []
    for number in range(14):
        picture, mask, boxes = scene(random)
        png.write_png(folder / f"made/images/{number}.png", picture)
        class_masks.write_class_mask(folder / f"made/masks/{number}.png", mask)
        yolo.write_boxes(folder / f"made/labels/{number}.txt", [0, 1], boxes, SIZE)
        entries.append(
            image_entry(folder / "made", str(number), "train" if number < 8 else "val" if number < 12 else "test")
        )
    (folder / "dataset").mkdir()
    write_yolo_dataset("made", folder / "dataset", entries, folder / "dataset", {})
    return folder / "dataset"


def trained(dataset, folder):
    options = TrainingOptions(model="compact", epochs=16, batch=2, learning_rate=0.005, masks=True)
    return train(dataset, folder, "a", options, SIZE[0])


@pytest.fixture(scope="module")
def weights(dataset, tmp_path_factory):
    return trained(dataset, tmp_path_factory.mktemp("weights"))


@pytest.mark.slow
def test_the_loss_decreases_and_masks_agree_with_the_images(dataset, weights, tmp_path):
    curve = tables.read_csv(weights.with_suffix(".csv"))
    assert curve["train_mask_loss"].iloc[-1] < 0.5 * curve["train_mask_loss"].iloc[0]
    assert curve["val_mask_iou"].iloc[-1] > 0.6
    segment_pictures(
        weights=[weights],
        dataset=dataset,
        masks=tmp_path / "masks",
        size=(WIDTH, HEIGHT),
        options=PREDICTION,
        threads=1,
    )
    for name in dataset_images(dataset, "test"):
        seen = class_masks.read_class_mask(tmp_path / f"masks/{name}.png")
        assert seen.shape == (HEIGHT, WIDTH)
        shown = cv2.resize(
            class_masks.read_class_mask(dataset / f"masks/test/{name}.png"),
            (WIDTH, HEIGHT),
            interpolation=cv2.INTER_NEAREST,
        )
        assert np.mean(seen == shown) > 0.9


def test_a_missing_mask_head_is_added_and_an_unused_head_is_dropped(weights):
    old = network("compact", detectors.read_detector(PACKAGED).state, masks=False).state_dict()
    with_head = network("compact", old, masks=True).state_dict()
    assert all(torch.equal(with_head[name], value.float()) for name, value in old.items() if value.is_floating_point())
    own = detectors.read_detector(weights).state
    assert set(with_head) == set(own)
    assert set(network("compact", own, masks=False).state_dict()) == set(old)
    assert set(network("compact", own).state_dict()) == set(own)
    cut = {name: value for name, value in own.items() if name != "mask.1.weight"}
    with pytest.raises(DetectError):
        network("compact", cut)


def test_initial_weights_do_not_depend_on_the_mask_head():
    states = []
    for masks in (False, True):
        torch.manual_seed(3)
        states.append(network("compact", masks=masks).state_dict())
    assert all(torch.equal(value, states[1][name]) for name, value in states[0].items())


def test_a_picture_without_a_mask_is_named(dataset, tmp_path):
    shutil.copytree(dataset, tmp_path / "bare")
    next((tmp_path / "bare/masks/val").iterdir()).unlink()
    with pytest.raises(DetectError, match=r"detect\.training\.masks"):
        trained(tmp_path / "bare", tmp_path)
    assert not (tmp_path / "a.pt").exists()


def test_a_detector_without_a_head_is_refused_before_anything_is_written(tmp_path):
    png.write_png(tmp_path / "a.png", np.zeros((40, 64), np.uint8))
    packaged = detectors.read_detector(PACKAGED)
    state = network("compact", packaged.state, masks=False).state_dict()
    detectors.write_detector(tmp_path / "rocks.pt", replace(packaged, state=state))
    with pytest.raises(DetectError, match=r"rocks\.pt"):
        detect_in_images(
            pictures=[tmp_path / "a.png"], weights=[tmp_path / "rocks.pt"], out=tmp_path / "out",
            options=prediction_options([], [], "cpu"), threads=1, masks=True,
        )  # fmt: skip
    assert not (tmp_path / "out").exists()


def test_external_images_get_masks_of_equal_size(weights, tmp_path, monkeypatch):
    picture, mask, boxes = scene(np.random.default_rng(5))
    found = np.column_stack([boxes * np.tile([150 / SIZE[0], 94 / SIZE[1]], 2), [0.95, 0.95], [0, 1]])
    # After this short training, few boxes are detected.
    monkeypatch.setattr("polarsim.detect.detect_pictures.predict_images", lambda *_: iter([found]))
    large = cv2.resize(picture, (150, 94), interpolation=cv2.INTER_LINEAR)
    png.write_png(tmp_path / "a.png", large)
    png.write_png(tmp_path / "b.png", large.astype(np.uint16) * 257)
    detect_in_images(
        pictures=[tmp_path / "a.png", tmp_path / "b.png"], weights=[weights, weights], out=tmp_path / "out",
        options=prediction_options([], [], "cpu"), threads=1, confidence=0.9, masks=True, draw=draw_detections,
    )  # fmt: skip
    shown = cv2.resize(mask, (150, 94), interpolation=cv2.INTER_NEAREST)
    first = class_masks.read_class_mask(tmp_path / "out/masks/a.png")
    assert np.mean(first == shown) > 0.9
    assert class_masks.read_class_mask(tmp_path / "out/masks/b.png").shape == first.shape
    drawn = cv2.imread(str(tmp_path / "out/pictures/a.jpg")).astype(int)[:94]  # without the legend
    yellow = drawn[..., 2] - drawn[..., 0]  # red over blue
    assert yellow[first == ROCK].mean() > yellow[first == GROUND].mean() + 20
    assert len(json.loads((tmp_path / "out/coco.json").read_text())["images"]) == 2


@pytest.mark.parametrize("size", [(64, 40), (100, 70), (1936, 1216)])
def test_masks_are_aligned_with_the_image(size):
    """The network is replaced by the cells of the bright block; includes padding and several widths."""

    def bright_cells(pictures):
        assert pictures.shape[1] % 32 == pictures.shape[2] % 32 == 0
        rock = class_shares((pictures[0] > 180).astype(np.uint8), STRIDE)[1]
        return np.stack([1 - rock, rock, np.zeros_like(rock)])[None]

    width, height = size
    picture = np.full((height, width), 60, np.uint8)
    picture[round(0.4 * height) : round(0.7 * height), round(0.2 * width) : round(0.5 * width)] = 250
    for widths in ((640,), (320, 480)):
        seen = class_mask([(bright_cells, widths)], picture, size)
        assert seen.shape == picture.shape
        rows, columns = np.nonzero(seen == ROCK)
        found = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]) / [*size, *size]
        np.testing.assert_allclose(found, [0.2, 0.4, 0.5, 0.7], atol=0.012)


def test_mask_pixels_outside_boxes_of_their_class_are_ground():
    mask = np.array([[1, 1, 2, 2], [1, 1, 2, 2], [0, 1, 1, 2]], np.uint8)
    found = np.array([[0.6, 0, 3, 2, 0.9, 0], [2, 1, 4, 2.2, 0.9, 1]])  # a rock, a shadow
    np.testing.assert_array_equal(within_boxes(mask, found), [[1, 1, 0, 0], [1, 1, 2, 2], [0, 0, 0, 2]])
    assert not within_boxes(mask, np.zeros((0, 6))).any()


def test_shares_of_a_cell_by_hand():
    mask = np.array([[1, 1, 0, 2], [1, 255, 0, 2]], np.uint8)
    np.testing.assert_allclose(class_shares(mask, 2), [[[0, 0.5]], [[0.75, 0]], [[0, 0.5]]])


def test_the_mask_loss_agrees_with_a_calculation_by_hand():
    known = torch.tensor([0.75, 0.25, 0]).view(1, 3, 1, 1)
    loss = mask_loss(torch.zeros(1, 3, 1, 1), known)
    assert float(loss) == pytest.approx(MASK_WEIGHT * np.log(3))
    sure = torch.tensor([0.0, 0, 50]).view(1, 3, 1, 1).requires_grad_()
    assert mask_loss(sure, known).item() == pytest.approx(MASK_WEIGHT * 50)
    nothing = mask_loss(sure, torch.zeros(1, 3, 1, 1))
    nothing.backward()
    assert nothing.item() == 0
    assert (sure.grad == 0).all()


@pytest.mark.parametrize("seed", range(6))
def test_augmentation_moves_mask_and_boxes_with_the_image(seed):
    pixels, mask = np.full((96, 160), 60, np.uint8), np.zeros((96, 160), np.uint8)
    pixels[30:60, 50:90], mask[30:60, 50:90] = 200, ROCK
    boxes = np.array([[50.0, 30, 90, 60]])
    picture = augment(TrainingImage(pixels, np.array([0]), boxes, mask), np.random.default_rng(seed))
    bright = picture.pixels > (int(picture.pixels.max()) + 60) // 2
    assert np.mean(bright == (picture.mask == ROCK)) > 0.99
    assert set(np.unique(picture.mask)) <= {GROUND, ROCK, class_masks.IGNORED}
    rows, columns = np.nonzero(bright)
    found = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    np.testing.assert_allclose(picture.boxes, [found], atol=1.01)
    assert picture.classes.tolist() == [0]


def test_weights_are_chosen_by_boxes_and_masks():
    row = {"val_map50": 0.6, "val_map50_95": 0.3}
    assert fitness_of(row) == pytest.approx(0.06 + 0.27)
    assert fitness_of(row | {"val_mask_iou": 0.5}) == pytest.approx(0.06 + 0.27 + 0.5)
    assert _mean_iou(np.array([[4, 1, 0], [1, 3, 0], [0, 0, 0]])) == pytest.approx(0.6)  # only rocks have pixels
    assert _mean_iou(np.diag([9, 0, 0])) == 0
