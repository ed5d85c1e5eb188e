"""Stage 2, scans, stereo photos or labels to rig poses: where the cameras stood in the sandbox."""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    measure_ranges="range_maps",
    register_scans="scans",
    locate_cameras="locate",
    refine_cameras="photos",
)
