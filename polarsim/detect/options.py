"""Options of the detect stage."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, Field, ValidationInfo, field_validator, model_validator

from polarsim.user_path import UserPath

# The detector that comes with polarsim, its card beside it; docs/notes/detect.md says how it was made.
PACKAGED = Path(__file__).parent / "packaged" / "rocks.pt"
PACKAGED_ROVER = PACKAGED.with_name("rover.pt")  # the same, fine-tuned on pictures of drives
VIEWS = "views"  # the training domain of pictures that nobody photographed
SplitName = Literal["photo", "view", "position", "terrain"]


class StereoOptions(BaseModel, extra="forbid", frozen=True):
    """Depth from pairs of images by a method that is not trained, OpenCV's semi-global matching."""

    run: bool = Field(False, description="Match all pairs of photos and of twins, about a second a pair.")
    scale: float = Field(
        0.5, gt=0, le=1, description="Size of matched images over that of a photo; smaller ones are faster and coarser."
    )
    exposures_ms: tuple[int, ...] = Field((), description="Exposures of matched images, ms. Empty: all.")


class SplitOptions(BaseModel, extra="forbid", frozen=True):
    """Division of photos into training, validation and test."""

    seed: int = Field(0, ge=0, description="Seed of splits and mixes.")
    test_share: float = Field(1 / 3, gt=0, lt=1, description="Share of photos, views, positions or terrains to test.")
    test_terrains: tuple[int, ...] = Field(
        (), description="Test terrains of the split by terrain. Empty: drawn at random."
    )


class PicturesOptions(BaseModel, extra="forbid", frozen=True):
    """Size of the images that detectors are trained and tested on."""

    imgsz: int = Field(
        320,
        ge=64,
        multiple_of=32,
        description="Longer side of the detectors' input, px; larger images show smaller rocks and take longer.",
    )
    stored_px: int = Field(
        0,
        ge=0,
        description="Longer side of stored images, px, for trainings that zoom and several inference widths; 0: imgsz.",
    )

    @property
    def longer_side(self) -> int:
        """Of the pictures that are stored, px."""
        return self.stored_px or self.imgsz


class DetectorOptions(BaseModel, extra="forbid", frozen=True):
    """Architecture and training of a detector."""

    model: str = Field(
        "yolov5n",
        pattern="^(yolov5[nsmlx]|yolov8[nsmlx]|yolov9[tsmce]|yolov10[nsmblx]|yolo(11|12|26)[nsmlx]|compact(-l)?)$",
        description="compact and compact-l are our own (BSD-3-Clause), all others Ultralytics' (AGPL-3.0).",
    )
    pretrained: UserPath | Literal["packaged"] | None = Field(
        None,
        description="Weights to start from (.pt); `packaged`: those that come with polarsim, of model compact. None: "
        "random weights.",
    )
    epochs: int = Field(4, ge=1, description="Number of passes over the training images; the paper has 200.")
    batch: int = Field(4, ge=1, description="Images in a training step; more need more memory.")
    learning_rate: float = Field(0.002, gt=0, description="Peak learning rate of AdamW.")
    augment: bool = Field(
        False, description="Mirror, move and scale training images at random; pays off in long trainings."
    )
    mosaic: bool = Field(False, description="Combine four images into each training image; pays off in long trainings.")

    @model_validator(mode="after")
    def _fits_the_model(self) -> Self:
        if self.pretrained == "packaged" and self.model != "compact":
            raise ValueError(f"pretrained: the packaged detector is of model compact, not {self.model}")
        if self.mosaic and self.model.startswith("compact"):
            raise ValueError(f"mosaic: detector {self.model} has none")
        return self

    @property
    def start_weights(self) -> Path | None:
        """Return the file of the weights that training starts from."""
        return PACKAGED if self.pretrained == "packaged" else self.pretrained

    @property
    def start(self) -> str:
        """Return the name of the start weights in tables."""
        return self.start_weights.name if self.start_weights else "scratch"


class TrainingOptions(DetectorOptions, extra="forbid", frozen=True):
    """Architecture and training of the run's own detectors."""

    masks: bool = Field(
        False,
        description="Learn masks of ground, rocks and shadows from rendered images too (compact and compact-l), for "
        "`polarsim detect --masks`.",
    )
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "auto",
        description="Numbers of convolutions in training, Ultralytics' on a CPU only. auto: bfloat16 where the "
        "processor has it, 1.5 times as fast.",
    )

    @model_validator(mode="after")
    def _has_masks(self) -> Self:
        if self.masks and not self.model.startswith("compact"):
            raise ValueError(f"masks: detector {self.model} has none, choose compact or compact-l")
        return self


class OtherDetector(DetectorOptions, extra="forbid", frozen=True):
    """Architecture and training of a further detector."""

    trained_on: tuple[str, ...] = Field((), description="Training domains. Empty: all of them.")


class PredictionOptions(BaseModel, extra="forbid", frozen=True):
    """These options say how a detector looks at pictures, those of the test and those that select its weights."""

    device: Literal["auto", "cpu", "cuda"] = Field(
        "cpu", description="Detectors run here, in training too; auto: on cuda where there is one."
    )
    precision: Literal["float32", "bfloat16"] = Field(
        "float32",
        description="Precision of a compact detector's convolutions while it predicts. bfloat16 is faster where the "
        "processor has instructions for it, and an error elsewhere.",
    )
    confidence: float = Field(0.001, gt=0, lt=1, description="Predictions from this confidence on are written.")
    nms_iou: float = Field(
        0.6, gt=0, lt=1, description="Above this IoU the less confident of two boxes is dropped, as in YOLOv5's val."
    )
    mirrored: bool = Field(
        False,
        description="Detectors look at every picture mirrored left to right too, and what they find in both is merged: "
        "more is found, in twice the time.",
    )
    widths: tuple[Annotated[int, Field(ge=64, multiple_of=32)], ...] = Field(
        (),
        description="Detectors look at a picture at these widths, px, ascending: small rocks are found in "
        "wide pictures, large rocks in narrow ones. None: at the width of the training.",
    )
    gates_px: tuple[Annotated[float, Field(gt=0)], ...] = Field(
        (),
        description="Boxes with a longer side below this, px of a photo 1936 px wide, are taken from the "
        "wider one of two widths; there is one gate between each two widths, descending.",
    )
    mask_widths: tuple[Annotated[int, Field(ge=64, multiple_of=32)], ...] = Field(
        (),
        description="Masks are the mean of what is seen at these widths of a picture, px. None: at the widths at which "
        "the detector looks for boxes.",
    )

    sand_only: bool = Field(
        True,
        description="Where the camera's pose is known (cover photos, photos and twins of a run), boxes whose foot lies "
        "beyond the sandbox's sand are left out: cards, cloth and lamps are no rocks.",
    )

    @model_validator(mode="after")
    def _are_sizes(self) -> Self:
        if len(self.gates_px) != max(0, len(self.widths) - 1):
            raise ValueError(f"{len(self.widths)} widths and {len(self.gates_px)} gates_px: there is one gate fewer")
        if sorted(set(self.widths)) != list(self.widths) or sorted(self.gates_px, reverse=True) != list(self.gates_px):
            raise ValueError("widths ascend, gates_px descend")
        return self


class ComparisonOptions(BaseModel, extra="forbid", frozen=True):
    """Metrics and their confidence intervals."""

    iou_confidence: float = Field(
        0.25, ge=0, lt=1, description="Minimum confidence in IOU_mean, IPD and false positives; the paper states none."
    )
    resampled: Literal["view", "photo"] = Field(
        "view",
        description="Unit of the bootstrap of 95 % intervals: views (terrain, position, camera) or photos. Photos of "
        "one view show the same rocks.",
    )
    resamples: int = Field(1000, ge=100, description="Number of bootstrap samples; more make steadier intervals.")


class DetectOptions(BaseModel, extra="forbid", frozen=True):
    """The defaults train small and short, from scratch; the paper trains for 200 epochs from trained weights."""

    run: bool = Field(
        True,
        description="Detectors are trained and compared where there are photos; false leaves out this stage, its "
        "tables and figures.",
    )
    seeds: tuple[int, ...] = Field(
        (0,), min_length=1, description="Every detector is trained once with each of these seeds."
    )
    splits: tuple[SplitName, ...] = Field(
        ("photo",),
        min_length=1,
        description="These units are drawn for the test, each with detectors and rows in the tables of its "
        "own. photo: photos, as in the paper, so that views lie on both sides; view: terrain, "
        "position and camera; position: terrain and position, both cameras; terrain: whole "
        "terrains.",
    )
    views: UserPath | None = Field(
        None,
        description="The training domain `views` is read from this folder, which `polarsim render VIEWS.yaml` "
        "wrote without --preview.",
    )
    mixes: dict[str, dict[str, float]] = Field(
        {},
        description="Training domains are made of others: name -> domain -> weight. 0.5 takes half of the "
        "domain's pictures, 2 takes each twice.",
    )

    split: SplitOptions = Field(
        SplitOptions(), description="These options say which pictures train, choose weights and test."
    )
    pictures: PicturesOptions = Field(
        PicturesOptions(), description="This section says which pictures detectors are shown."
    )
    training: TrainingOptions = Field(TrainingOptions(), description="This section says how detectors are trained.")
    others: dict[str, OtherDetector] = Field(
        {},
        description="Detectors of further models are trained, by a name and how: `yolo: {model: yolov8n}`. They have "
        "rows of their own in `tables/detection`; all else a run shows of detectors is of those that `training` says.",
    )
    prediction: PredictionOptions = Field(
        PredictionOptions(), description="This section says how detectors look at pictures."
    )
    comparison: ComparisonOptions = Field(
        ComparisonOptions(), description="This section says how their predictions are compared."
    )
    stereo: StereoOptions = Field(
        StereoOptions(), description="This section adds stereo depth as a second kind of evaluation."
    )

    @field_validator("splits", "seeds")
    @classmethod
    def _named_once(cls, values: tuple[object, ...]) -> tuple[object, ...]:
        if len(set(values)) < len(values):
            raise ValueError("named twice")
        return values

    @field_validator("seeds")
    @classmethod
    def _not_negative(cls, values: tuple[int, ...]) -> tuple[int, ...]:
        if min(values) < 0:
            raise ValueError(f"seed {min(values)}, expected 0 or more")
        return values

    @field_validator("mixes", "others")
    @classmethod
    def _names_of_folders(cls, named: dict[str, Any], info: ValidationInfo) -> dict[str, Any]:
        for name in named:
            if not re.fullmatch(r"[a-z][a-z0-9-]*", name):
                raise ValueError(f"{info.field_name}: {name!r}, expected a name of small letters, digits and -")
        return named

    @field_validator("mixes")
    @classmethod
    def _possible_mixes(cls, mixes: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
        for name, weights in mixes.items():
            if not weights or not all(0 < weight < math.inf for weight in weights.values()):
                raise ValueError(f"mix {name}: expected domains with weights above 0")
        return mixes
