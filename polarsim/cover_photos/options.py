"""Options of the cover photos and of the detectors that are tested on them."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field, field_validator

from polarsim.photo import TERRAINS, PhotoKey
from polarsim.scenes.options import SceneOptions

CARVED = 0  # stands for a terrain where rocks are not scanned but carved by the analog's generator
VAL_SHARE = 0.08  # of each terrain's scenes and of the windows of photos, to select the weights
SCENE_PICTURES = 400  # of a fine-tuning, lest the detector forget scenes
WIDEST_PX = 1792  # to which photos are shrunk, at most, before windows are cut


class FineTuningOptions(BaseModel, extra="forbid", frozen=True):
    """Training of a detector of scenes on labelled cover photos of the terrains that it is not tested on."""

    windows: int = Field(
        0,
        ge=0,
        description="Number of randomly shrunk windows of each photo, every tenth the whole photo. 0: no fine-tuning.",
    )
    epochs: int = Field(4, ge=1, description="Number of passes over the windows.")
    learning_rate: float = Field(0.0003, gt=0, description="Peak learning rate of AdamW.")


class CoversOptions(BaseModel, extra="forbid", frozen=True):
    """Detectors are trained on randomised scenes and tested on the published cover photos of terrains left out."""

    run: bool = Field(
        False, description="Add this stage to the default target: hours on a CPU, and it needs the published release."
    )
    folds: tuple[tuple[int, ...], ...] = Field(
        (),
        description="Terrains that each detector is tested and not trained on. Empty: each terrain in turn.",
    )
    keys: tuple[str, ...] = Field(
        (),
        description="Known photo keys of cover photos; those of others are found by boxes and shadows.",
    )
    scenes: SceneOptions = Field(SceneOptions(), description="Scenes that detectors are trained on.")
    carved_scenes: int = Field(
        512,
        ge=0,
        description="Number of scenes of generated rocks, on which every detector is trained first. 0: random weights.",
    )
    carved_epochs: int = Field(24, ge=1, description="Number of passes over the scenes of generated rocks.")
    fine_tuning: FineTuningOptions = Field(
        FineTuningOptions(), description="A second test after fine-tuning on cover photos of the other folds."
    )
    widths: tuple[Annotated[int, Field(ge=64, multiple_of=32)], ...] = Field(
        (512, 640, 768, 896, 1024, 1280, 1536, 1792),
        description="Inference widths to choose from, px, each fold's on the photos of the other folds; unused where "
        "`detect.prediction.widths` is set.",
    )
    publish: bool = Field(
        False, description="Train a detector on all terrains too and write it as `covers/detector.pt`."
    )

    @field_validator("keys")
    @classmethod
    def _keys_of_photos(cls, keys: tuple[str, ...]) -> tuple[str, ...]:
        stations = [PhotoKey.parse(key).station for key in keys]
        if len(set(stations)) < len(stations):
            raise ValueError("two keys name one terrain and position, which has one cover photo")
        return keys

    @field_validator("folds")
    @classmethod
    def _terrains_once(cls, folds: tuple[tuple[int, ...], ...]) -> tuple[tuple[int, ...], ...]:
        tested = [terrain for fold in folds for terrain in fold]
        if unknown := sorted(set(tested) - set(TERRAINS)):
            raise ValueError(f"terrain {unknown[0]}, expected 1 to 13")
        if len(set(tested)) < len(tested) or not all(folds):
            raise ValueError("a fold without terrains, or a terrain in two folds")
        return folds
