"""Speed and memory of detectors on the available device, and the predicted time of the paper's full protocol.

    python benchmarks/detectors.py [--models compact yolov5n] [--imgsz 640] [--device auto] [--threads 2] [--json]

Images are noise with 20 blobs each, about as many objects as in photos of that size. Start-up time is excluded: the
training time is the difference of a long and a short training. Every detector has a separate process, so that its peak
of memory is measured separately. Rates are of wall time; on a busy machine use the CPU seconds.

Last metrics (AMD EPYC, Zen 4, one thread of a busy machine, `--imgsz 288 --pictures 8`), CPU time per image: compact
64 ms for training, 34 ms for inference, 569 MB; yolov5n 93 ms, 47 ms, 742 MB. With so few images, validation and
checkpoint of an epoch dominate: compact on 259 images 43 ms. The paper's protocol on this thread: 97 and 182 hours.
NVIDIA H100 (`--device cuda --imgsz 640 --pictures 160`): training of compact 148 images/s, of yolov8n in batches of 16
172; inference 64 and 120.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from polarsim.detect.detectors import choose_device, detector_name, load_torch
from polarsim.detect.options import PredictionOptions, TrainingOptions
from polarsim.detect.predict import predict
from polarsim.detect.train import train_detector
from polarsim.formats import png, tables, yolo
from polarsim.site import polar

PAPER_TRAINED, PAPER_EPOCHS, PAPER_DETECTORS = 3460, 200, 3
PAPER_PREDICTED, PAPER_PAIRS = 5190, 9
SHORT, LONG = 1, 4  # epochs


def make_dataset(root: Path, imgsz: int, train: int, test: int) -> Path:
    """Write a data set in the format of `polarsim.detect.dataset`."""
    random = np.random.default_rng(0)
    width_px, height_px = polar().images.size
    height = round(imgsz * height_px / width_px)
    parts = ["train"] * train + ["val"] * 2 + ["test"] * test
    keys = [str(key) for terrain in range(1, 13) for key in sorted(polar().photos_of(terrain))][: len(parts)]
    for key, part in zip(keys, parts, strict=True):
        pixels = random.normal(90, 12, (height, imgsz))
        low = random.uniform(0, (width_px - 130, height_px - 100), (20, 2))
        boxes = np.concatenate([low, low + random.uniform(30, (120, 90), (20, 2))], axis=1)
        for x0, y0, x1, y1 in np.rint(boxes * imgsz / width_px).astype(int):
            pixels[y0:y1, x0:x1] = 200
        png.write_png(root / "images" / part / f"{key}.png", np.clip(pixels, 0, 255).astype(np.uint8))
        yolo.write_boxes(root / "labels" / part / f"{key}.txt", np.zeros(20, int), boxes, size=polar().images.size)
    tables.write_csv(root / "pictures.csv", pd.DataFrame({"key": keys, "part": parts}))
    return root


def measure(model: str, given: argparse.Namespace) -> dict[str, object]:
    """Measure rates, memory and predicted time of a detector."""
    root = Path(tempfile.mkdtemp())
    try:
        options = TrainingOptions(model=model, batch=given.batch)
        prediction = PredictionOptions(device=given.device)
        dataset = make_dataset(root / "data", given.imgsz, given.pictures, given.pictures)
        _train(root, dataset, options, prediction, SHORT, given)  # includes the imports
        spent = {epochs: _train(root, dataset, options, prediction, epochs, given) for epochs in (SHORT, LONG)}
        train_s, train_cpu_s = (
            (long - short) / (LONG - SHORT) / given.pictures
            for short, long in zip(spent[SHORT], spent[LONG], strict=True)
        )
        _predict(root, dataset, prediction, given.threads)  # includes start-up
        predict_s, predict_cpu_s = (
            value / given.pictures for value in _predict(root, dataset, prediction, given.threads)
        )
        return {
            "detector": detector_name(model),
            "device": _device_name(given.device),
            "imgsz": given.imgsz,
            "batch": given.batch,
            "threads": given.threads,
            "train_images_per_s": round(1 / train_s, 2),
            "train_cpu_ms_per_image": round(1000 * train_cpu_s, 1),
            "predict_images_per_s": round(1 / predict_s, 2),
            "predict_cpu_ms_per_image": round(1000 * predict_cpu_s, 1),
            "memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
            "gpu_memory_mb": _gpu_memory_mb(),
            **paper_hours(train_s, predict_s),
        }
    finally:
        shutil.rmtree(root, ignore_errors=True)


def paper_hours(train_s: float, predict_s: float) -> dict[str, float]:
    """Return the hours of the paper's protocol, from seconds per image.

    It has 3 detectors, 200 epochs of 3,460 images, and 9 times 5,190 predictions.
    """
    one = PAPER_TRAINED * PAPER_EPOCHS * train_s / 3600
    predictions = PAPER_PREDICTED * PAPER_PAIRS * predict_s / 3600
    return {
        "paper_train_one_h": round(one, 2),
        "paper_predict_h": round(predictions, 2),
        "paper_total_h": round(PAPER_DETECTORS * one + predictions, 2),
    }


def _train(
    root: Path,
    dataset: Path,
    options: TrainingOptions,
    prediction: PredictionOptions,
    epochs: int,
    given: argparse.Namespace,
) -> tuple[float, float]:
    """Return wall and CPU seconds."""
    start = time.perf_counter(), time.process_time()
    train_detector(
        dataset=dataset,
        weights=root / "detector.pt",
        curve=root / "detector.csv",
        options=options.model_copy(update={"epochs": epochs}),
        prediction=prediction,
        imgsz=given.imgsz,
        seed=0,
        threads=given.threads,
        work=root / "work",
    )
    return time.perf_counter() - start[0], time.process_time() - start[1]


def _predict(root: Path, dataset: Path, options: PredictionOptions, threads: int) -> tuple[float, float]:
    start = time.perf_counter(), time.process_time()
    predict(
        weights=root / "detector.pt",
        dataset=dataset,
        predictions=root / "predictions.parquet",
        site=polar(),
        options=options,
        threads=threads,
    )
    return time.perf_counter() - start[0], time.process_time() - start[1]


def _device_name(device: str) -> str:
    return load_torch().cuda.get_device_name() if choose_device(device) == "cuda" else "cpu"


def _gpu_memory_mb() -> int:
    torch = load_torch()
    return round(torch.cuda.max_memory_allocated() / 2**20) if torch.cuda.is_available() else 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", default=["compact", "yolov5n"])
    parser.add_argument("--imgsz", type=int, default=640, help="px")
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--device", default="auto", choices=["auto", "cpu", "cuda"])
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--pictures", type=int, default=24, help="number of images for training, and for inference")
    parser.add_argument("--json", action="store_true", help="print a list with an object per detector")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)  # a single detector, in this process
    given = parser.parse_args()
    if given.here:
        sys.stdout.write(json.dumps(measure(given.models[0], given)))
        return
    rows = []
    for model in given.models:
        words = [f"--{name}={getattr(given, name)}" for name in ("imgsz", "batch", "device", "threads", "pictures")]
        command = [sys.executable, __file__, "--here", "--models", model, *words]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{model}: {done.stderr.strip().splitlines()[-1]}")
        rows.append(json.loads(done.stdout.splitlines()[-1]))
    sys.stdout.write(json.dumps(rows, indent=1) + "\n" if given.json else pd.DataFrame(rows).T.to_string(header=False))
    sys.stdout.write("" if given.json else "\n")


if __name__ == "__main__":
    main()
