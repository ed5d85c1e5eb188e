"""Options of the detect stage."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, Field


class DetectOptions(BaseModel, extra="forbid", frozen=True):
    """The defaults train small and short, from scratch, as the demo does. The paper: 200 epochs, pre-trained."""

    model: str = Field("yolov5n", pattern="^yolov5[nsmlx]$", description="Architecture and size of the judge.")
    pretrained: Path | None = Field(None, description="Weights to start from (.pt); none: random weights.")
    epochs: int = Field(4, ge=1, description="Passes over the training pictures; the paper has 200.")
    imgsz: int = Field(320, ge=64, multiple_of=32, description="Longer side of the judge's pictures, px.")
    batch: int = Field(4, ge=1, description="Pictures a training step.")
    learning_rate: float = Field(0.002, gt=0, description="Largest learning rate of AdamW.")
    augment: bool = Field(
        False, description="Mirror, move and scale the training pictures at random; pays off in long trainings."
    )
    mosaic: bool = Field(False, description="Train on four pictures at once; pays off in long trainings.")
    device: Literal["auto", "cpu", "cuda"] = Field(
        "cpu", description="Where judges run; auto: cuda where there is one."
    )
    seed: int = Field(0, ge=0, description="Seed of the split, of training, and of the bootstrap.")

    split: Literal["photo", "terrain"] = Field(
        "photo",
        description="photo: a random share of the photos is the test (as in the paper); terrain: whole terrains.",
    )
    test_share: float = Field(1 / 3, gt=0, lt=1, description="Share of the photos (or terrains) in the test part.")
    test_terrains: tuple[int, ...] = Field((), description="Terrains of the test part; none: drawn. For split terrain.")
    val_share: float = Field(0.1, gt=0, lt=1, description="Share of the photos left for training that selects weights.")

    tone: Literal["gamma", "percentile", "linear"] = Field(
        "gamma",
        description="From 12 to 8 bits. linear: the full range; percentile: stretched; gamma: stretched, then 1/2.2.",
    )
    tone_percentile: float = Field(99.5, gt=50, le=100, description="Percentile of the picture that becomes white.")
    tone_floor_dn: float = Field(64, gt=0, description="Least white point above black, DN: keeps dark noise dark.")
    min_mean_dn: float = Field(0, ge=0, description="Darker pictures (mean above black, DN) are left out; 0 keeps all.")
    downsize: bool = Field(True, description="Store the pictures at imgsz; false: at full size.")

    confidence: float = Field(0.001, gt=0, lt=1, description="Least confidence of a prediction that is written.")
    nms_iou: float = Field(
        0.6, gt=0, lt=1, description="IoU above which the less confident of two boxes is dropped, as in YOLOv5's val."
    )
    max_boxes: int = Field(300, ge=1, description="Most predictions a picture, the surest ones.")
    iou_confidence: float = Field(
        0.25,
        ge=0,
        lt=1,
        description="Least confidence of a prediction in IOU_mean, IPD and false alarms; the paper states none.",
    )
    undetected: Literal["zero", "left_out"] = Field(
        "zero", description="In IPD, a labelled rock that no prediction overlaps: IoU 0, or left out."
    )
    unpaired: Literal["left_out", "zero"] = Field(
        "left_out", description="In IPD, a rock labelled in one domain only: left out, or IoU 0 in the other."
    )
    false_alarm_overlap: float = Field(
        0.1,
        gt=0,
        le=1,
        description="A predicted rock is a false alarm if it covers less than this share of the smaller one of it and "
        "each rock label.",
    )
    resampled: Literal["view", "photo"] = Field(
        "view",
        description="What the bootstrap of 95 % intervals draws: views (terrain, position, camera), whose photos show "
        "the same rocks, or photos.",
    )
    resamples: int = Field(1000, ge=100, description="Bootstrap samples of the 95 % intervals.")
    group_resamples: int = Field(
        200, ge=100, description="The same for groups of photos and size classes, of which there are many."
    )
