"""Stage 2, scans or labels to rig poses: where the cameras stood in the sandbox."""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    register_scans="scans",
    locate_cameras="locate",
    refine_cameras="photos",
)
