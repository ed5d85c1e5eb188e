"""Rounding of poses and lenses before they are written: sums in threads differ in the last bits, files must not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from polarsim.geometry.lens import Lens
from polarsim.geometry.poses import Pose
from polarsim.geometry.stereo import StereoRig


def rounded(pose: Pose) -> Pose:
    """Round to 1e-6 m and 1e-7 rad."""
    rotvec = np.round(Rotation.from_matrix(pose.rotation).as_rotvec(), 7)
    return Pose.from_rotvec(rotvec, np.round(pose.translation, 6) + 0.0)


def rounded_rig(rig: StereoRig) -> StereoRig:
    """Round to 1e-4 px, 1e-7 in the distortion, and the pose between the cameras as `rounded`."""
    return StereoRig(_rounded_lens(rig.left), _rounded_lens(rig.right), rounded(rig.left_from_right))


def rounded_metrics(metrics: dict[str, float]) -> dict[str, float]:
    """Round metrics of a fit to six digits."""
    return {name: float(f"{value:.6g}") for name, value in metrics.items()}


def _rounded_lens(lens: Lens) -> Lens:
    fx, fy, cx, cy = (round(value, 4) for value in (lens.fx, lens.fy, lens.cx, lens.cy))
    k1, k2, p1, p2, k3 = (round(term, 7) for term in lens.distortion)
    return replace(lens, fx=fx, fy=fy, cx=cx, cy=cy, distortion=(k1, k2, p1, p2, k3))
