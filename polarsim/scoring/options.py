"""Options of the evaluation."""

from __future__ import annotations

from pydantic import BaseModel, Field

from polarsim.user_path import UserPath


class ScoringOptions(BaseModel, extra="forbid", frozen=True):
    """Reference of the evaluation. It does not change the other results."""

    annotated_root: UserPath | None = Field(
        None,
        description="Folder of annotations for the evaluation, in the layout of the release. null: folder of the seeds "
        "or source.",
    )
