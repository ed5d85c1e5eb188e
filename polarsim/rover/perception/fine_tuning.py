"""Fine-tune a detector on the front camera's labelled pictures of drives."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from polarsim.detect import detectors, tone
from polarsim.detect.dataset import image_entry, write_yolo_dataset
from polarsim.detect.options import PredictionOptions, TrainingOptions
from polarsim.detect.split import TRAIN, VAL
from polarsim.detect.train import train_detector
from polarsim.detect.training_windows import draw_windows, make_folders, write_window
from polarsim.errors import RoverError, with_path
from polarsim.formats import png, yolo
from polarsim.formats.files import writing_folder
from polarsim.randomness import generator
from polarsim.rover.cameras.layout import labels_folder
from polarsim.rover.perception.detections import boxes_with_contrast
from polarsim.rover.perception.options import DriveTuningOptions
from polarsim.rover.vehicle.camera_names import FRONT
from polarsim.run_files.picture_sets import PictureSet

DOMAIN = "drives"  # domain of the data set
_SEED = 0
_VAL_SHARE = 0.08  # share of validation pictures, which select the weights
_WINDOW_PX = 512  # picture width in the training of the packaged detectors
_WIDEST_PX = 1280  # maximum width of a resized picture from which windows are cut
_LEARNING_RATE, _BATCH = 0.0003, 4  # low rate, since few epochs must not erase earlier training


def make_drive_dataset(*, dataset: Path, options: DriveTuningOptions) -> None:
    """Write a data set of windows of the pictures of `options.drives`, without a test part.

    All windows of a picture belong to the same part. Labels that are not visible in the picture are excluded.
    """
    random = generator(_SEED, "rover", "fine tuning")
    entries, count = [], 0
    with writing_folder(dataset) as folder:
        raw = folder / "windows"
        make_folders(raw)
        for picture_name, path, labels in _pictures(options):
            part = VAL if random.random() < _VAL_SHARE else TRAIN
            with with_path(path):
                eight = tone.to_8_bits(png.read_png(path))
            classes, boxes = yolo.read_boxes(labels, eight.shape[::-1])
            kept = boxes_with_contrast(eight, boxes)
            numbers = range(count, count + options.windows)
            drawn = draw_windows(eight, classes[kept], boxes[kept], numbers, _WINDOW_PX, _WIDEST_PX, random)
            for number, window in zip(numbers, drawn, strict=True):
                name = f"{picture_name}_w{number - count}"
                write_window(raw, name, window)
                entries.append(image_entry(raw, name, part))
            count += options.windows
        facts = {"drives": [drive.as_posix() for drive in options.drives]}
        write_yolo_dataset(DOMAIN, dataset, entries, folder, facts, needed=(TRAIN, VAL))


def fine_tune(
    *,
    dataset: Path,
    start: Path,
    weights: Path,
    curve: Path,
    options: DriveTuningOptions,
    prediction: PredictionOptions,
    threads: int,
    work: Path,
) -> None:
    """Fine-tune the detector `start`; its inference widths are kept."""
    before = detectors.read_detector(start)
    training = TrainingOptions(
        model=before.model, epochs=options.epochs, batch=_BATCH, learning_rate=_LEARNING_RATE, augment=True
    )
    trained = work / "trained.pt"
    train_detector(
        dataset=dataset,
        weights=trained,
        curve=curve,
        options=training,
        prediction=prediction,
        imgsz=_WINDOW_PX,
        seed=_SEED,
        threads=threads,
        work=work,
        start=start,
    )
    # The calibration of `start` is not copied, since fine-tuning changes the confidences.
    detectors.write_detector(weights, replace(detectors.read_detector(trained), sizes=before.sizes))
    trained.unlink()


def _pictures(options: DriveTuningOptions) -> Iterator[tuple[str, Path, Path]]:
    """Yield name in the data set, picture and labels of every `every`-th picture of each set of the front camera."""
    for number, drive in enumerate(options.drives):
        sets = [path for path in sorted((drive / FRONT).glob("*_*_*")) if path.is_dir() and any(path.glob("*.png"))]
        if not sets:
            raise RoverError(f"no pictures of {FRONT}", path=drive)
        for folder in sets:
            with with_path(folder):
                labels = labels_folder(drive, FRONT, PictureSet.parse(folder.name).sun)
            for path in sorted(folder.glob("*.png"))[:: options.every]:
                yield f"drive{number}_{folder.name}_{path.stem}", path, labels / f"{path.stem}.txt"
