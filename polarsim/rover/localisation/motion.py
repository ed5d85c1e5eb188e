"""Motion of a camera between two pictures, with its covariance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.geometry.poses import Pose


@dataclass(frozen=True)
class Motion:
    """Estimated motion of the rectified left camera (x right, y down, z forward) from one stereo pair to the next.

    The covariance belongs to the errors of rotation phi (3,), rad, in the frame of the camera now, and of translation
    tau (3,), m, in the frame of the camera before: true rotation = rotation Exp(phi), true translation = translation +
    tau.
    """

    before_from_now: Pose
    covariance: np.ndarray  # (6, 6) of phi, tau
    inliers: int  # number of points that agree with the motion
