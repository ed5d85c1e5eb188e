"""Evaluation of a run against ground truth or annotations, which only this package reads."""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    PhotoLabels="score",
    count_boxes="score",
    count_photo="score",
    score_folders="score",
)
