"""Options of cover photos and of the detectors tested on them."""

from __future__ import annotations

from pydantic import BaseModel, Field, field_validator

from polarsim.detect.options import InferenceWidth
from polarsim.photo import PhotoKey, Terrain
from polarsim.scenes.options import SceneOptions
from polarsim.site_parts import TerrainName

CARVED = 0  # terrain number of scenes with rocks of the generator of the analog instead of scanned rocks
VAL_SHARE = 0.08  # validation share of the scenes of each terrain and of the windows of photos
SCENE_PICTURES = 400  # number of scene images in fine-tuning, to prevent forgetting
WIDEST_PX = 1792  # maximum width of reduced photos from which windows are cut


class FineTuningOptions(BaseModel, extra="forbid", frozen=True):
    """Fine-tuning of detectors on labelled cover photos of terrains outside the test."""

    windows: int = Field(
        0,
        ge=0,
        description="Number of random windows of each photo at random scales. 0: no fine-tuning.",
    )
    epochs: int = Field(4, ge=1, description="Number of passes over the windows.")
    learning_rate: float = Field(0.0003, gt=0, description="Peak learning rate of AdamW.")


class CoversOptions(BaseModel, extra="forbid", frozen=True):
    """Detectors trained on randomised scenes and tested on published cover photos of excluded terrains."""

    run: bool = Field(
        False, description="Add this stage to the default target. Takes hours on a CPU and requires the release."
    )
    folds: tuple[tuple[TerrainName, ...], ...] = Field(
        (),
        description="Test terrains of each fold, excluded from its training. Empty: one fold per terrain.",
    )
    keys: tuple[str, ...] = Field(
        (),
        description="Known photo keys of cover photos. The keys of unlisted photos are derived from boxes and shadows.",
    )
    scenes: SceneOptions = Field(SceneOptions(), description="Randomised scenes for the training.")
    carved_scenes: int = Field(
        512,
        ge=0,
        description="Number of scenes of generated rocks for the pretraining of all detectors. 0: random weights.",
    )
    carved_epochs: int = Field(24, ge=1, description="Number of passes over the scenes of generated rocks.")
    fine_tuning: FineTuningOptions = Field(
        FineTuningOptions(), description="Second test, after fine-tuning on the cover photos of the training folds."
    )
    widths: tuple[InferenceWidth, ...] = Field(
        (512, 640, 768, 896, 1024, 1280, 1536, 1792),
        description="Candidate inference widths, px, selected for each fold on the training folds. Ignored if "
        "`detect.prediction.widths` is set.",
    )
    publish: bool = Field(
        False, description="Also train a detector on all terrains and write it to `covers/detector.pt`."
    )

    @field_validator("keys")
    @classmethod
    def _keys_of_photos(cls, keys: tuple[str, ...]) -> tuple[str, ...]:
        stations = [PhotoKey.parse(key).station for key in keys]
        if len(set(stations)) < len(stations):
            raise ValueError("two keys of the same terrain and position, which has only one cover photo")
        return keys

    @field_validator("folds")
    @classmethod
    def _terrains_once(cls, folds: tuple[tuple[Terrain, ...], ...]) -> tuple[tuple[Terrain, ...], ...]:
        tested = [terrain for fold in folds for terrain in fold]
        if len(set(tested)) < len(tested) or not all(folds):
            raise ValueError("a fold without terrains, or a terrain in two folds")
        return folds
