"""A linter for labelled photos: defects that siblings, geometry and light show without looking at a picture."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    lint_release="folders",
    lint_pictures="folders",
    Report="findings",
)
