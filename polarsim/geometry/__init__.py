"""Pure arrays in, arrays out: poses, lenses, rays, boxes, polygons."""

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
