"""Linter for labelled photos: detects defects from other exposures, geometry and light, without the photos."""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    lint_release="folders",
    lint_pictures="folders",
    Report="findings",
)
