"""Geometry without files: poses, lenses, rays, boxes, polygons; functions of arrays that return arrays."""

from polarsim.public import offered

__all__, __getattr__, __dir__ = offered(
    __name__,
    Camera="camera",
    Lens="lens",
    Pose="poses",
    looking="poses",
    fit_pose="poses",
    StereoRig="stereo",
    stated_rig="stereo",
    Mesh="meshes",
)
