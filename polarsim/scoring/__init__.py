"""Evaluation of a run against ground truth or annotations, which only this package reads."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    Labels="score",
    count_boxes="score",
    count_photo="score",
    score_folders="score",
)
