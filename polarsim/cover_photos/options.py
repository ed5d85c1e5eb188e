"""Options of the cover photos and of the detectors that are tested on them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field, field_validator

from polarsim.photo import TERRAINS, USUAL_EXPOSURE_MS, WIDTH, PhotoKey
from polarsim.scenes.options import SceneOptions

CARVED = 0  # stands for a terrain where rocks are not scanned but carved by the analog's generator
ChosenOn = Literal["photos", "scenes", "none"]


class FineTuningOptions(BaseModel, extra="forbid", frozen=True):
    """A detector of scenes goes on with labelled cover photos of the terrains that it is not tested on."""

    windows: int = Field(
        0,
        ge=0,
        description="So many windows of each photo, shrunk at random, are trained on, every tenth of the whole photo. "
        "0: no detector is fine-tuned.",
    )
    widest_px: int = Field(
        1792,
        ge=64,
        le=WIDTH,
        description="Windows are cut from the photo shrunk to widths from that of the stored pictures to this, px, if "
        "it is more.",
    )
    scene_pictures: int = Field(
        400, ge=0, description="So many pictures of scenes are trained on beside them, lest the detector forget these."
    )
    epochs: int = Field(4, ge=1, description="Fine-tuning passes over its pictures so often.")
    learning_rate: float = Field(0.0003, gt=0, description="The learning rate rises to this at most.")


class CoversOptions(BaseModel, extra="forbid", frozen=True):
    """Detectors are trained on strewn scenes and tested on the published cover photos of terrains left out."""

    run: bool = Field(
        False, description="The default target trains and tests them too: hours on a CPU, with the published release."
    )
    folds: tuple[tuple[int, ...], ...] = Field(
        (),
        description="Each detector is tested on the terrains of one fold and trained on rocks of the run's other ones. "
        "Where none is named, each of the run's terrains is left out in turn.",
    )
    keys: tuple[str, ...] = Field(
        (),
        description="These are the photo keys of cover photos whose camera or azimuth is known; those of all others "
        "are told by the boxes drawn into them and by the shadows that they show.",
    )
    exposure_ms: int = Field(
        USUAL_EXPOSURE_MS, gt=0, description="A cover photo is scored by labels of this exposure or the nearest, ms."
    )
    scenes: SceneOptions = Field(SceneOptions(), description="Detectors are trained on such scenes.")
    carved_scenes: int = Field(
        512,
        ge=0,
        description="So many scenes show rocks that the analog's generator carves. One detector is trained on them "
        "alone, once, and that of every fold and seed starts from its weights: it has seen no scanned rock. 0: folds "
        "start from random weights.",
    )
    carved_epochs: int = Field(24, ge=1, description="That detector's training passes over its pictures so often.")
    fine_tuning: FineTuningOptions = Field(
        FineTuningOptions(),
        description="Detectors of scenes are tested as they are, and once more after a fine-tuning on the labelled "
        "cover photos of all terrains but those of their fold.",
    )
    widths: tuple[Annotated[int, Field(ge=64, multiple_of=32)], ...] = Field(
        (512, 640, 768, 896, 1024, 1280, 1536, 1792),
        description="These widths of a picture, px, are tried, unless `detect.prediction.widths` names those at which "
        "detectors look at the photos.",
    )
    widths_chosen_on: ChosenOn = Field(
        "photos",
        description="Each fold's widths, and the gates between them, are chosen without its terrains. photos: on the "
        "cover photos of all other folds, as their own detectors see them; scenes: on further scenes of the terrains "
        "that it is trained on, as large as a photo; none: photos are looked at as wide as the training's pictures.",
    )
    width_scenes: int = Field(
        8,
        ge=1,
        description="With `widths_chosen_on: scenes` so many scenes of each terrain's rocks are rendered for that "
        "choice alone; more make it steadier and take longer.",
    )
    publish: bool = Field(
        False, description="A detector of the rocks of all terrains is trained too, to take away: `covers/detector.pt`."
    )
    val_share: float = Field(
        0.08, gt=0, lt=1, description="This share of each terrain's scenes selects the weights and is not trained on."
    )
    val_terrains: int = Field(
        0,
        ge=0,
        description="All scenes of so many terrains, drawn of those that a fold is trained on, select the weights "
        "instead: weights are then chosen by rocks that the training has not seen.",
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
