"""Geometry without files: poses, lenses, rays, boxes, polygons; functions of arrays that return arrays."""

from polarsim.public import lazy_exports

__all__, __getattr__, __dir__ = lazy_exports(
    __name__,
    Camera="camera",
    Lens="lens",
    Pose="poses",
    camera_pose="poses",
    fit_pose="poses",
    StereoRig="stereo",
    Mesh="meshes",
)
