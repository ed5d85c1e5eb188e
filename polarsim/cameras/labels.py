"""Localisation of a position by its seed boxes and the terrain's rock meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.cameras.refine import BoxFit, EdgeNoise, PosePrior, check_pose, refine_pose
from polarsim.cameras.search import SearchRanges, candidate_centres, search_pose
from polarsim.errors import RegistrationError
from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.poses import Pose, yaw_pitch_roll
from polarsim.photo import photo_scale

MIN_BOXES = 3  # positions with fewer boxes or meshes are localised by the survey
# Standard deviations of a tripod from its survey: position on each axis; yaw and pitch. They fit the real data.
SURVEY_SD_M, SURVEY_SD_DEG = 0.4, 5
ROLL_SD_DEG = 2.9  # prior on the roll of a tripod about level
SURVEY_WEIGHT = 0.05  # sum of IoU that a unit of the prior's chi squared costs
START_GATES_PX = (120.0, 80.0, 50.0, 35.0, 25.0, 25.0)  # of re-assignment in the first fit
FINAL_GATES_PX = (60.0, 40.0, 30.0, 30.0)  # of re-assignment in the last fit
# In the last fits outliers have little weight.
START_NOISE, FINAL_NOISE = EdgeNoise(6.0, 3.0), EdgeNoise(3.0, 3.0, "cauchy", loss_scale=2.0)
MIN_FIT = 0.52  # sum of IoU over possible matches at which a pose needs no lead
MIN_LED_FIT, MIN_LEAD = 0.4, 0.15  # minimum with a lead over the second best pose, and that lead
START_DIRECTIONS = 64  # points per rock in the first fit
DUPLICATE_FIT_DISTANCE = 0.1  # metres: nearer fits are the same pose
REQUIRED_LEAD = 0.1  # minimum lead over the second best pose, whatever share both explain


@dataclass(frozen=True)
class LabelLocalisation:
    """Best fit, and the share of the best fit at another position."""

    fit: BoxFit
    runner_up: float  # share of the second best pose; 0 if there is none
    prior: PosePrior
    boxes: np.ndarray  # (b, 4) pixels

    @property
    def share(self) -> float:
        """Summed IoU over the number of possible pairs."""
        return explained_share(self.fit, self.boxes)


def localise_by_labels(
    boxes: np.ndarray,
    outlines: Outlines,
    lens: Lens,
    surveyed: Pose | None,
    ranges: SearchRanges,
) -> LabelLocalisation:
    """Estimate the pose of the left camera from boxes and meshes without a start; see also `check_localisation`.

    Every hypothesis of the search is refined to the end before poses are compared, because rough fits of the same
    pose differ by decimetres.

    `boxes` (b, 4): rock boxes of the left photo, pixels.
    `surveyed`: surveyed pose of the left camera. It restricts the azimuth of the search, and decides between poses that
    explain the boxes equally well.
    """
    if min(len(boxes), len(outlines)) < MIN_BOXES:
        raise RegistrationError(f"{len(boxes)} boxes and {len(outlines)} meshes, a pose needs {MIN_BOXES} of each")
    prior = survey_prior(surveyed)
    azimuth = None if surveyed is None else float(np.arctan2(surveyed.translation[1], surveyed.translation[0]))
    centres = candidate_centres(azimuth, float(np.median(outlines.centres[:, 2])), ranges)
    starts = [start.sandbox_from_left for start in search_pose(outlines, boxes, lens, centres, surveyed)]
    fits = _distinct(_final_fits(starts, boxes, outlines, lens, prior), prior)
    if not fits:
        raise RegistrationError("no pose projects any rock onto any box")
    rival = max((explained_share(fit, boxes) for fit in fits[1:]), default=0.0)
    return LabelLocalisation(fits[0], rival, prior, boxes)


def explained_share(fit: BoxFit, boxes: np.ndarray) -> float:
    """Return the summed IoU of a fit over the number of possible pairs: rocks in view or boxes (b, 4), the smaller."""
    return fit.sum_iou / max(1, min(fit.in_view, len(boxes)))


def check_localisation(localisation: LabelLocalisation, max_error_m: float) -> LabelLocalisation:
    """Refuse a pose that explains too few boxes, is ambiguous, or exceeds `max_error_m` (metres) from the survey."""
    leads = localisation.share >= MIN_LED_FIT and localisation.share - localisation.runner_up >= MIN_LEAD
    if localisation.share < MIN_FIT and not leads:
        raise RegistrationError(
            f"the best pose explains {localisation.share:.2f} of the possible matches, the second "
            f"{localisation.runner_up:.2f}; {MIN_FIT:g}, or {MIN_LED_FIT:g} with a lead of {MIN_LEAD:g}, is needed"
        )
    if localisation.share - localisation.runner_up < REQUIRED_LEAD:
        raise RegistrationError(
            f"two poses explain the {len(localisation.boxes)} boxes almost equally, {localisation.share:.2f} and "
            f"{localisation.runner_up:.2f} of the possible matches"
        )
    off = _off_survey(localisation)
    if off > max_error_m:
        raise RegistrationError(
            f"the best pose is {off:.1f} m from the survey's position, the maximum is {max_error_m:g} m: check "
            f"whether these boxes belong to another position"
        )
    return localisation


def is_plausible(localisation: LabelLocalisation, max_error_m: float) -> bool:
    """Return whether a pose that `check_localisation` refuses is good enough to move labels in the image.

    This holds for poses near a surveyed tripod. At 19 positions of 03, 08, 11, 12 with few seeds, refused poses
    explained 0.19 to 0.82 of the possible matches. Boxes that the ground transferred from left to right by such poses
    matched annotated boxes with F1 0.82, by the surveyed poses with 0.60; no position was worse than by the survey.
    """
    return _off_survey(localisation) <= max_error_m


def _off_survey(localisation: LabelLocalisation) -> float:
    """Return the distance of the left camera from its surveyed position, metres; 0 without a survey."""
    if not np.isfinite(localisation.prior.sd[0]):
        return 0.0
    return float(np.linalg.norm(localisation.fit.sandbox_from_left.translation - localisation.prior.mean[:3]))


def survey_prior(surveyed: Pose | None) -> PosePrior:
    """Return the survey as a prior; without a survey only the roll has a prior."""
    roll = np.radians(ROLL_SD_DEG)
    if surveyed is None:
        return PosePrior(np.zeros(6), np.append(np.full(5, np.inf), roll))
    yaw, pitch, _ = yaw_pitch_roll(surveyed)
    angle = np.radians(SURVEY_SD_DEG)
    sd = np.array([SURVEY_SD_M] * 3 + [angle, angle, roll])
    return PosePrior(np.array([*surveyed.translation, yaw, pitch, 0.0]), sd)


def _final_fits(
    starts: list[Pose], boxes: np.ndarray, outlines: Outlines, lens: Lens, prior: PosePrior
) -> list[BoxFit]:
    thin, scale = outlines.thinned(START_DIRECTIONS), photo_scale(lens.width)
    start_gates, final_gates = ([scale * gate for gate in gates] for gates in (START_GATES_PX, FINAL_GATES_PX))
    fits = []
    for start in starts:
        near = refine_pose(start, thin, boxes, lens, prior, start_gates, START_NOISE)
        pose = refine_pose(near, outlines, boxes, lens, prior, final_gates, FINAL_NOISE)
        fits.append(check_pose(pose, outlines, boxes, lens, prior, FINAL_NOISE))
    return fits


def _distinct(fits: list[BoxFit], prior: PosePrior) -> list[BoxFit]:
    """Return the best fit of each position, best first; distance from the survey lowers the rank slightly."""

    def worth(fit: BoxFit) -> float:
        return fit.sum_iou - SURVEY_WEIGHT * prior.chi2(fit.sandbox_from_left)

    kept: list[BoxFit] = []
    for fit in sorted(fits, key=worth, reverse=True):
        if not any(_is_duplicate(fit, other) for other in kept):
            kept.append(fit)
    return kept


def _is_duplicate(first: BoxFit, second: BoxFit) -> bool:
    return bool(
        np.linalg.norm(first.sandbox_from_left.translation - second.sandbox_from_left.translation)
        < DUPLICATE_FIT_DISTANCE
    )
