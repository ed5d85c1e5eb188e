"""Options of the detect stage."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, Field, field_validator, model_validator

from polarsim.photo import Terrain
from polarsim.user_path import UserPath

# Detector included in polarsim, with a model card in the same folder; docs/notes/detect.md describes the training.
PACKAGED = Path(__file__).parent / "packaged" / "rocks.pt"
PACKAGED_ROVER = PACKAGED.with_name("rover.pt")  # PACKAGED after fine-tuning on images of drives
PACKAGED_FIELD = PACKAGED.with_name("field.pt")  # PACKAGED after training on scenes beyond the sandbox
VIEWS = "views"  # training domain of rendered novel viewpoints
SplitName = Literal["photo", "view", "position", "terrain"]
InferenceWidth = Annotated[int, Field(ge=64, multiple_of=32)]  # px
FolderName = Annotated[str, Field(pattern="^[a-z][a-z0-9-]*$")]  # part of paths and of file names
MixWeight = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class StereoOptions(BaseModel, extra="forbid", frozen=True):
    """Stereo depth by OpenCV's semi-global matching, a method without training."""

    run: bool = Field(False, description="Match all pairs of photos and of twins, about a second a pair.")
    scale: float = Field(
        0.5, gt=0, le=1, description="Size of matched images relative to photos. Smaller images are faster and coarser."
    )
    exposures_ms: tuple[int, ...] = Field((), description="Exposures of matched images, ms. Empty: all.")


class SplitOptions(BaseModel, extra="forbid", frozen=True):
    """Division of photos into training, validation and test."""

    seed: int = Field(0, ge=0, description="Seed of splits and mixes.")
    test_share: float = Field(1 / 3, gt=0, lt=1, description="Share of photos, views, positions or terrains to test.")
    test_terrains: tuple[Terrain, ...] = Field(
        (), description="Test terrains of the split by terrain. Empty: selected at random."
    )


class PicturesOptions(BaseModel, extra="forbid", frozen=True):
    """Size of the images that detectors are trained and tested on."""

    imgsz: int = Field(
        320,
        ge=64,
        multiple_of=32,
        description="Longer side of the detector input, px. Larger images show smaller rocks and take longer.",
    )
    stored_px: int = Field(
        0,
        ge=0,
        description="Longer side of stored images, px; raise it above imgsz for several inference widths. 0: imgsz.",
    )

    @property
    def longer_side(self) -> int:
        """Longer side of stored images, px."""
        return self.stored_px or self.imgsz


class DetectorOptions(BaseModel, extra="forbid", frozen=True):
    """Architecture and training of a detector."""

    model: str = Field(
        "yolov5n",
        pattern="^(yolov5[nsmlx]|yolov8[nsmlx]|yolov9[tsmce]|yolov10[nsmblx]|yolo(11|12|26)[nsmlx]|compact(-l)?)$",
        description="Model. compact and compact-l belong to polarsim (BSD-3-Clause), YOLO models to Ultralytics "
        "(AGPL-3.0).",
    )
    pretrained: UserPath | Literal["packaged"] | None = Field(
        None,
        description="Initial weights (.pt). `packaged`: the compact detector included in polarsim. None: random "
        "weights.",
    )
    epochs: int = Field(4, ge=1, description="Number of passes over the training images; the paper uses 200.")
    batch: int = Field(4, ge=1, description="Number of images in a training step. More images need more memory.")
    learning_rate: float = Field(0.002, gt=0, description="Peak learning rate of AdamW.")
    augment: bool = Field(
        False, description="Mirror, shift and scale training images at random. Useful in long trainings."
    )
    mosaic: bool = Field(False, description="Combine four images into each training image. Useful in long trainings.")

    @model_validator(mode="after")
    def _fits_the_model(self) -> Self:
        if self.pretrained == "packaged" and self.model != "compact":
            raise ValueError(f"pretrained: the packaged detector requires model compact, not {self.model}")
        if self.mosaic and self.model.startswith("compact"):
            raise ValueError(f"mosaic: not supported by model {self.model}, set it to false")
        return self

    @property
    def start_weights(self) -> Path | None:
        """Return the file of the initial weights."""
        return PACKAGED if self.pretrained == "packaged" else self.pretrained

    @property
    def start(self) -> str:
        """Return the name of the initial weights in tables."""
        return self.start_weights.name if self.start_weights else "scratch"


class TrainingOptions(DetectorOptions, extra="forbid", frozen=True):
    """Architecture and training of the main detectors of a run."""

    masks: bool = Field(
        False,
        description="Also train masks of ground, rocks and shadows on rendered images, for `polarsim detect --masks`. "
        "Requires compact or compact-l.",
    )
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "auto",
        description="Precision of convolutions in training; for Ultralytics models on a CPU only. auto: bfloat16 "
        "where it is faster (AMD processors with AVX512-BF16, Intel processors with AMX).",
    )

    @model_validator(mode="after")
    def _has_masks(self) -> Self:
        if self.masks and not self.model.startswith("compact"):
            raise ValueError(f"masks: not supported by model {self.model}, choose compact or compact-l")
        return self


class OtherDetector(DetectorOptions, extra="forbid", frozen=True):
    """Architecture and training of a further detector."""

    trained_on: tuple[str, ...] = Field((), description="Training domains. Empty: all domains.")


class PredictionOptions(BaseModel, extra="forbid", frozen=True):
    """Inference of a detector, in the test and in the validation that selects the weights."""

    device: Literal["auto", "cpu", "cuda"] = Field(
        "cpu", description="Device of inference and training. auto: cuda if available."
    )
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "float32",
        description="Precision of convolutions in the inference. auto: bfloat16 where it is faster, see `training`.",
    )
    confidence: float = Field(
        0.001, gt=0, lt=1, description="Confidence threshold of written predictions. Higher values write fewer boxes."
    )
    nms_iou: float = Field(
        0.6,
        gt=0,
        lt=1,
        description="IoU threshold of non-maximum suppression, as in the validation of YOLOv5. Higher values keep more "
        "boxes.",
    )
    mirrored: bool = Field(
        False,
        description="Merge the predictions of each image and its mirror image. Finds more objects in twice the time.",
    )
    widths: tuple[InferenceWidth, ...] = Field(
        (),
        description="Inference widths, px, ascending. Wide images show small rocks, narrow images large rocks. Empty: "
        "training width.",
    )
    gates_px: tuple[Annotated[float, Field(gt=0)], ...] = Field(
        (),
        description="Box sizes at which detection switches between adjacent inference widths, descending, px at photo "
        "width 1936.",
    )
    mask_widths: tuple[InferenceWidth, ...] = Field(
        (),
        description="Inference widths of masks, px; class probabilities are averaged. Empty: the widths of boxes.",
    )

    @model_validator(mode="after")
    def _are_sizes(self) -> Self:
        if len(self.gates_px) != (expected := max(0, len(self.widths) - 1)):
            raise ValueError(f"{len(self.gates_px)} given for {len(self.widths)} widths, expected {expected} gates_px")
        if sorted(set(self.widths)) != list(self.widths) or sorted(self.gates_px, reverse=True) != list(self.gates_px):
            raise ValueError("widths must ascend and gates_px must descend")
        return self


class ComparisonOptions(BaseModel, extra="forbid", frozen=True):
    """Metrics and their confidence intervals."""

    iou_confidence: float = Field(
        0.25, ge=0, lt=1, description="Confidence threshold of IOU_mean, IPD and false positives; not in the paper."
    )
    resampled: Literal["view", "photo"] = Field(
        "view",
        description="Unit of the bootstrap of 95 % intervals: views (terrain, position, camera) or photos. Photos of "
        "a view are correlated.",
    )
    resamples: int = Field(
        1000, ge=100, description="Number of bootstrap replicates. More replicates give more precise intervals."
    )


class DetectOptions(BaseModel, extra="forbid", frozen=True):
    """Training and evaluation of detectors.

    The defaults train small detectors for few epochs from random weights; the paper uses 200 epochs and pretrained
    weights.
    """

    run: bool = Field(
        True,
        description="Train and evaluate detectors if the run has photos.",
    )
    seeds: tuple[Annotated[int, Field(ge=0)], ...] = Field(
        (0,), min_length=1, description="Random seeds of training. Each detector is trained once per seed."
    )
    splits: tuple[SplitName, ...] = Field(
        ("photo",),
        min_length=1,
        description="Units of the test split, each with separate detectors. photo: as in the paper; view: terrain, "
        "position, camera; position: both cameras; terrain.",
    )
    views: UserPath | None = Field(
        None,
        description="Folder of the training domain `views`, written by `polarsim render VIEWS.yaml` without --preview.",
    )
    mixes: dict[FolderName, Annotated[dict[str, MixWeight], Field(min_length=1)]] = Field(
        {},
        description="Mixed training domains: name -> domain -> weight. 0.5: half of the images; 2: each image twice.",
    )

    split: SplitOptions = Field(SplitOptions(), description="Division of photos into training, validation and test.")
    pictures: PicturesOptions = Field(PicturesOptions(), description="Size of the detector input.")
    training: TrainingOptions = Field(TrainingOptions(), description="Architecture and training of detectors.")
    others: dict[FolderName, OtherDetector] = Field(
        {},
        description="Further detectors by name, such as `yolo: {model: yolov8n}`. They appear only in "
        "`tables/detection`.",
    )
    prediction: PredictionOptions = Field(PredictionOptions(), description="Inference: device, thresholds, widths.")
    comparison: ComparisonOptions = Field(
        ComparisonOptions(), description="Metrics of predictions and their confidence intervals."
    )
    elsewhere: dict[FolderName, UserPath] = Field(
        {},
        description="Folders of images from outside POLAR by name, with images/ and labels/ (YOLO) or masks/, for the "
        "target `elsewhere`.",
    )
    stereo: StereoOptions = Field(StereoOptions(), description="Stereo depth as a second evaluation of twins.")

    @field_validator("splits", "seeds")
    @classmethod
    def _named_once(cls, values: tuple[object, ...]) -> tuple[object, ...]:
        if len(set(values)) < len(values):
            raise ValueError("repeated value, list each value once")
        return values
