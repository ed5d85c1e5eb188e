"""What the configuration says about fine-tuning the detector on board."""

from __future__ import annotations

from pydantic import BaseModel, Field

from polarsim.detect.options import TrainingOptions
from polarsim.user_path import UserPath

FINE_TUNED = "fine_tuned"  # name of the detector that other drives have made of the one on board


class DriveTuningOptions(BaseModel, extra="forbid", frozen=True):
    """The detector on board goes on with labelled pictures of other drives, before it looks at those of this run."""

    drives: tuple[UserPath, ...] = Field(
        (),
        description="It is trained on the front camera's pictures of these drives, such as "
        "`results/OTHER/rover/seed0`: of other runs, over other ground than this run's. None: it is taken as it is.",
    )
    every: int = Field(1, ge=1, description="Every so many-th picture of a drive is trained on.")
    windows: int = Field(
        3, ge=1, description="So many windows of each picture, resized at random, every tenth of the whole picture."
    )
    window_px: int = Field(512, ge=64, description="Windows are so wide, px: as the pictures it was trained on.")
    widest_px: int = Field(
        1280, ge=64, description="Windows are cut from the picture resized to widths from `window_px` to this, px."
    )
    val_share: float = Field(
        0.08, gt=0, lt=1, description="This share of the pictures selects the weights and is not trained on."
    )
    seed: int = Field(0, ge=0, description="Another seed draws other windows, and trains in another order.")
    training: TrainingOptions = Field(
        TrainingOptions(model="compact", epochs=6, batch=4, learning_rate=0.0003, augment=True),
        description="This section says how it is trained; its model is that of the detector, which it starts from.",
    )
