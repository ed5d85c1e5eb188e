"""How good a run is: what compares with truth or with people's labels; nothing else reads those."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    Labels="score",
    count_boxes="score",
    count_photo="score",
    score_folders="score",
)
