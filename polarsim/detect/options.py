"""Options of the detect stage."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, Field, field_validator, model_validator

# The detector that comes with polarsim, its card beside it; docs/notes/detect.md says how it was made.
PACKAGED = Path(__file__).parent / "packaged" / "rocks.pt"
VIEWS = "views"  # the training domain of pictures that nobody photographed
SplitName = Literal["photo", "view", "position", "terrain"]


class StereoOptions(BaseModel, extra="forbid", frozen=True):
    """Depth from pairs of photos, a method that is not trained: OpenCV's semi-global matching."""

    run: bool = Field(False, description="Match all pairs of photos and of twins; costs about a second a pair.")
    scale: float = Field(0.5, gt=0, le=1, description="Size of the matched pictures, of a photo's.")
    exposures_ms: tuple[int, ...] = Field((), description="Exposures to match, ms; none: all.")
    nearest_m: float = Field(1.5, gt=0, description="Nearest depth that is looked for, m.")
    farthest_m: float = Field(9, gt=0, description="Farthest depth that is looked for, m.")
    bad_mm: float = Field(20, gt=0, description="Depth error from which a pixel is bad, mm.")
    bad_percent: float = Field(1, gt=0, description="The same, in percent of the depth.")
    min_rock_px: int = Field(25, ge=1, description="Rocks with fewer pixels of the matched picture are left out.")

    @model_validator(mode="after")
    def _depths_are_ordered(self) -> Self:
        if self.nearest_m >= self.farthest_m:
            raise ValueError(f"nearest_m {self.nearest_m:g} must be below farthest_m {self.farthest_m:g}")
        return self


class SplitOptions(BaseModel, extra="forbid", frozen=True):
    """Which pictures train, choose weights and test."""

    seed: int = Field(0, ge=0, description="Seed of the splits and of the mixes.")
    test_share: float = Field(1 / 3, gt=0, lt=1, description="Share of what is drawn that is the test part.")
    test_terrains: tuple[int, ...] = Field(
        (), description="Terrains of the test part of the split by terrain; where none is named, they are drawn."
    )
    val_share: float = Field(
        0.1,
        gt=0,
        lt=1,
        description="Share of what is left that selects weights, drawn like the test (where it is less than half a "
        "view, position or terrain: by photo).",
    )


class PicturesOptions(BaseModel, extra="forbid", frozen=True):
    """How photos and twins become the pictures that detectors are shown."""

    imgsz: int = Field(320, ge=64, multiple_of=32, description="Longer side of the pictures that detectors see, px.")
    tone: Literal["gamma", "percentile", "linear", "fixed"] = Field(
        "gamma",
        description="Curve from 12 to 8 bits. linear: the full range; percentile: stretched; gamma: stretched, then "
        "1/2.2; fixed: as if exposed for tone_exposure_ms, then 1/2.2.",
    )
    tone_exposure_ms: float = Field(
        256, gt=0, description="The exposure that curve `fixed` brings all pictures to, ms; what is beyond white clips."
    )
    tone_percentile: float = Field(99.5, gt=50, le=100, description="Percentile of the picture that becomes white.")
    tone_floor_dn: float = Field(64, gt=0, description="Least white point above black, DN: it keeps dark noise dark.")
    min_mean_dn: float = Field(
        0, ge=0, description="Pictures with a lower mean above black, DN, are left out; 0: none."
    )
    stored_px: int = Field(
        0,
        ge=0,
        description="Longer side of the stored pictures, px, for trainings that zoom and for detection at several "
        "widths; 0: imgsz. A full photo has 1936.",
    )

    @property
    def longer_side(self) -> int:
        """Of the pictures that are stored, px."""
        return self.stored_px or self.imgsz


class TrainingOptions(BaseModel, extra="forbid", frozen=True):
    """How a detector is trained."""

    model: str = Field(
        "yolov5n",
        pattern="^(yolov5[nsmlx]|yolov8[nsmlx]|yolov9[tsmce]|yolov10[nsmblx]|yolo(11|12|26)[nsmlx]|compact(-l)?)$",
        description="Detector: compact and compact-l are our own (BSD-3-Clause), all others Ultralytics' (AGPL-3.0).",
    )
    pretrained: Path | Literal["packaged"] | None = Field(
        None,
        description="Weights to start from (.pt), or `packaged`: those of the detector that comes with polarsim, for "
        "model compact. None: random weights.",
    )
    pretrained_url: str | None = Field(
        None,
        pattern="^(https|file)://",
        description="Where to fetch `pretrained` from if it is missing.",
    )
    pretrained_sha256: str | None = Field(
        None, pattern="^[0-9a-fA-F]{64}$", description="Checksum of what is fetched; needed for pretrained_url."
    )
    epochs: int = Field(4, ge=1, description="Passes over the training pictures; the paper has 200.")
    batch: int = Field(4, ge=1, description="A training step sees so many pictures; more need more memory.")
    learning_rate: float = Field(0.002, gt=0, description="Largest learning rate of AdamW.")
    augment: bool = Field(
        False, description="Training pictures are mirrored, moved and scaled at random; pays off in long trainings."
    )
    mosaic: bool = Field(False, description="A training picture is made of four; pays off in long trainings.")
    precision: Literal["auto", "float32", "bfloat16"] = Field(
        "auto",
        description="Numbers in which compact and compact-l compute convolutions while they train. auto: bfloat16 "
        "where the processor has instructions for it (about 1.7 times as fast), else float32. Weights differ between "
        "the two by as much as between two machines.",
    )

    @model_validator(mode="after")
    def _is_consistent(self) -> Self:
        if self.pretrained_url and not (isinstance(self.pretrained, Path) and self.pretrained_sha256):
            raise ValueError("pretrained_url needs pretrained, where the file goes, and pretrained_sha256")
        if self.pretrained == "packaged" and self.model != "compact":
            raise ValueError(f"pretrained: the packaged detector is of model compact, not {self.model}")
        if self.mosaic and self.model.startswith("compact"):
            raise ValueError(f"mosaic: detector {self.model} has none")
        return self

    @property
    def start_weights(self) -> Path | None:
        """The file of weights that a training starts from."""
        return PACKAGED if self.pretrained == "packaged" else self.pretrained

    @property
    def start(self) -> str:
        """What a training starts from, as tables name it."""
        return self.start_weights.name if self.start_weights else "scratch"


class PredictionOptions(BaseModel, extra="forbid", frozen=True):
    """How a detector looks at pictures, those of the test and those that select its weights."""

    device: Literal["auto", "cpu", "cuda"] = Field(
        "cpu", description="Where detectors run, in training too; auto: cuda where there is one."
    )
    confidence: float = Field(0.001, gt=0, lt=1, description="Least confidence of a prediction that is written.")
    nms_iou: float = Field(
        0.6, gt=0, lt=1, description="IoU above which the less confident of two boxes is dropped, as in YOLOv5's val."
    )
    widths: tuple[Annotated[int, Field(ge=64, multiple_of=32)], ...] = Field(
        (),
        description="Widths of a picture at which detectors look at it, px, ascending: small rocks are found in wide "
        "pictures, large rocks in narrow ones. None: the width of the training.",
    )
    gates_px: tuple[Annotated[float, Field(gt=0)], ...] = Field(
        (),
        description="Between each two widths the longer side of a box, px of a photo 1936 px wide, below which the "
        "wider picture is asked; descending.",
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
    """How what detectors found is scored and compared."""

    seed: int = Field(0, ge=0, description="The bootstrap of the intervals draws by this seed.")
    iou_confidence: float = Field(
        0.25,
        ge=0,
        lt=1,
        description="Least confidence of a prediction in IOU_mean, IPD and false positives; the paper states none.",
    )
    undetected: Literal["zero", "left_out"] = Field(
        "zero", description="In IPD, a labelled rock that no prediction overlaps: IoU 0, or left out."
    )
    unpaired: Literal["left_out", "zero"] = Field(
        "left_out", description="In IPD, a rock labelled in one domain only: left out, or IoU 0 in the other."
    )
    resampled: Literal["view", "photo"] = Field(
        "view",
        description="What the bootstrap of 95 % intervals draws: views (terrain, position, camera), whose photos show "
        "the same rocks, or photos.",
    )
    resamples: int = Field(1000, ge=100, description="Bootstrap samples of the 95 % intervals.")


class DetectOptions(BaseModel, extra="forbid", frozen=True):
    """The defaults train small and short, from scratch, as the demo does. The paper: 200 epochs, pre-trained."""

    run: bool = Field(
        True,
        description="Detectors are trained and compared where there are photos; false leaves out this stage, its "
        "tables and figures.",
    )
    seeds: tuple[int, ...] = Field(
        (0,), min_length=1, description="Seeds of training: every detector is trained once with each."
    )
    splits: tuple[SplitName, ...] = Field(
        ("photo",),
        min_length=1,
        description="What is drawn for the test, each with detectors and rows in the tables of its own. photo: photos, "
        "as in the paper, so that views lie on both sides; view: terrain, position and camera; position: terrain and "
        "position, both cameras; terrain: whole terrains.",
    )
    views: Path | None = Field(
        None,
        description="Folder that `polarsim render VIEWS.yaml` wrote, without --preview: the training domain `views`.",
    )
    mixes: dict[str, dict[str, float]] = Field(
        {},
        description="Training domains made of others: name -> domain -> weight. 0.5 takes half of the domain's "
        "pictures, 2 takes each twice.",
    )

    split: SplitOptions = Field(SplitOptions(), description="Which pictures train, choose weights and test.")
    pictures: PicturesOptions = Field(PicturesOptions(), description="The pictures that detectors are shown.")
    training: TrainingOptions = Field(TrainingOptions(), description="How detectors are trained.")
    prediction: PredictionOptions = Field(PredictionOptions(), description="How detectors look at pictures.")
    comparison: ComparisonOptions = Field(ComparisonOptions(), description="How their predictions are compared.")
    stereo: StereoOptions = Field(StereoOptions(), description="Stereo depth as a second kind of evaluation.")

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

    @field_validator("mixes")
    @classmethod
    def _possible_mixes(cls, mixes: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
        for name, weights in mixes.items():
            if not re.fullmatch(r"[a-z][a-z0-9-]*", name):
                raise ValueError(f"mix {name!r}: expected a name of small letters, digits and -")
            if not weights or not all(0 < weight < math.inf for weight in weights.values()):
                raise ValueError(f"mix {name}: expected domains with weights above 0")
        return mixes
