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
    """Depth comes from pairs of photos by a method that is not trained, OpenCV's semi-global matching."""

    run: bool = Field(
        False, description="All pairs of photos and of twins are matched, which costs about a second a pair."
    )
    scale: float = Field(
        0.5,
        gt=0,
        le=1,
        description="Matched pictures have this size over that of a photo; smaller ones are faster and coarser.",
    )
    exposures_ms: tuple[int, ...] = Field((), description="Pictures of these exposures are matched, ms; none: of all.")
    nearest_m: float = Field(1.5, gt=0, description="Depths from this on are looked for, m; a nearer one takes longer.")
    farthest_m: float = Field(9, gt=0, description="Depths up to this are looked for, m.")
    bad_mm: float = Field(20, gt=0, description="A pixel beyond this depth error is bad, mm.")
    bad_percent: float = Field(
        1, gt=0, description="A pixel beyond this depth error is bad in the relative score, percent of the depth."
    )
    min_rock_px: int = Field(25, ge=1, description="Rocks with fewer pixels of the matched picture are left out.")

    @model_validator(mode="after")
    def _depths_are_ordered(self) -> Self:
        if self.nearest_m >= self.farthest_m:
            raise ValueError(f"nearest_m {self.nearest_m:g} must be below farthest_m {self.farthest_m:g}")
        return self


class SplitOptions(BaseModel, extra="forbid", frozen=True):
    """These options say which pictures train, choose weights and test."""

    seed: int = Field(0, ge=0, description="Splits and mixes are drawn with this seed.")
    test_share: float = Field(1 / 3, gt=0, lt=1, description="This share of what is drawn is the test part.")
    test_terrains: tuple[int, ...] = Field(
        (), description="The test part of the split by terrain has these terrains; where none is named, they are drawn."
    )
    val_share: float = Field(
        0.1,
        gt=0,
        lt=1,
        description="This share of what is left selects weights; it is drawn like the test (where it is less "
        "than half a view, position or terrain: by photo).",
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


class TrainingOptions(BaseModel, extra="forbid", frozen=True):
    """These options say how a detector is trained."""

    model: str = Field(
        "yolov5n",
        pattern="^(yolov5[nsmlx]|yolov8[nsmlx]|yolov9[tsmce]|yolov10[nsmblx]|yolo(11|12|26)[nsmlx]|compact(-l)?)$",
        description="This detector is trained: compact and compact-l are our own (BSD-3-Clause), all others "
        "Ultralytics' (AGPL-3.0).",
    )
    pretrained: UserPath | Literal["packaged"] | None = Field(
        None,
        description="Training starts from these weights (.pt); `packaged`: from those of the detector that "
        "comes with polarsim, for model compact. None: from random weights.",
    )
    pretrained_url: str | None = Field(
        None,
        pattern="^(https|file)://",
        description="Weights `pretrained` are fetched from this address if they are missing.",
    )
    pretrained_sha256: str | None = Field(
        None,
        pattern="^[0-9a-fA-F]{64}$",
        description="What is fetched has this SHA-256 checksum; pretrained_url needs it.",
    )
    epochs: int = Field(4, ge=1, description="Training passes over its pictures so often; the paper has 200.")
    batch: int = Field(4, ge=1, description="A training step sees so many pictures; more need more memory.")
    learning_rate: float = Field(0.002, gt=0, description="The learning rate of AdamW rises to this at most.")
    augment: bool = Field(
        False, description="Training pictures are mirrored, moved and scaled at random; pays off in long trainings."
    )
    mosaic: bool = Field(False, description="A training picture is made of four; pays off in long trainings.")
    masks: bool = Field(
        False,
        description="The detectors compact and compact-l learn to tell ground, rocks and shadows apart pixel by pixel "
        "too, from the masks that rendered pictures come with; `polarsim detect --masks` then writes a mask of every "
        "picture.",
    )
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "auto",
        description="Detectors compute convolutions in such numbers while they train, Ultralytics' on a CPU alone. "
        "auto: bfloat16 where the processor has instructions for it (1.5 to 1.7 times as fast), else float32. Weights "
        "differ between the two by as much as between two machines.",
    )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.pretrained_url and not (isinstance(self.pretrained, Path) and self.pretrained_sha256):
            raise ValueError("pretrained_url needs pretrained, where the file goes, and pretrained_sha256")
        if self.pretrained == "packaged" and self.model != "compact":
            raise ValueError(f"pretrained: the packaged detector is of model compact, not {self.model}")
        if self.mosaic and self.model.startswith("compact"):
            raise ValueError(f"mosaic: detector {self.model} has none")
        if self.masks and not self.model.startswith("compact"):
            raise ValueError(f"masks: detector {self.model} has none, choose compact or compact-l")
        return self

    @property
    def start_weights(self) -> Path | None:
        """The file of weights that a training starts from."""
        return PACKAGED if self.pretrained == "packaged" else self.pretrained

    @property
    def start(self) -> str:
        """What a training starts from, as tables name it."""
        return self.start_weights.name if self.start_weights else "scratch"


class OtherDetector(TrainingOptions, extra="forbid", frozen=True):
    """These options say how a detector of a further model is trained, and on what."""

    trained_on: tuple[str, ...] = Field((), description="It is trained on these domains; none named: on all of them.")


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
    """These options say how what detectors found is scored and compared."""

    seed: int = Field(0, ge=0, description="The bootstrap of the intervals draws by this seed.")
    iou_confidence: float = Field(
        0.25,
        ge=0,
        lt=1,
        description="Predictions from this confidence on count in IOU_mean, IPD and false positives; the "
        "paper states none.",
    )
    undetected: Literal["zero", "left_out"] = Field(
        "zero", description="In IPD, a labelled rock that no prediction overlaps counts as IoU 0, or is left out."
    )
    unpaired: Literal["left_out", "zero"] = Field(
        "left_out",
        description="In IPD, a rock that is labelled in one domain only is left out, or counts as IoU 0 in the other.",
    )
    resampled: Literal["view", "photo"] = Field(
        "view",
        description="The bootstrap of 95 % intervals draws views (terrain, position, camera), whose photos "
        "show the same rocks, or photos.",
    )
    resamples: int = Field(
        1000,
        ge=100,
        description="The 95 % intervals have this many bootstrap samples; more take longer and make them steadier.",
    )


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
