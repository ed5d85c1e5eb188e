"""Linter for labelled photos: detects defects from other exposures, geometry and light, without the photos."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    lint_release="folders",
    lint_pictures="folders",
    Report="findings",
)
