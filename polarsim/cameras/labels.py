"""A position localised by its seed boxes and the terrain's rock meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from polarsim.cameras.options import LocalisationOptions
from polarsim.cameras.refine import BoxFit, EdgeNoise, PosePrior, check_pose, refine_pose
from polarsim.cameras.search import candidate_centres, search_pose
from polarsim.errors import RegistrationError
from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.poses import Pose, yaw_pitch_roll
from polarsim.survey import MAX_OFF_SURVEY

MIN_BOXES = 3  # positions with fewer boxes or meshes are localised by the survey
ROLL_SD_DEG = 2.9  # prior on the roll of a tripod about level
SURVEY_WEIGHT = 0.05  # sum of IoU that one unit of the prior's chi squared costs
START_GATES_PX = (120.0, 80.0, 50.0, 35.0, 25.0, 25.0)  # of re-assignment, from afar
FINAL_GATES_PX = (60.0, 40.0, 30.0, 30.0)  # of the last fit
# Standard deviations of a box edge, px; edges nearer than 3 px to the photo's border are not measured. In the last fits
# edges that are far off hardly count.
START_NOISE, FINAL_NOISE = EdgeNoise(6.0, 3.0), EdgeNoise(3.0, 3.0, "cauchy", loss_scale=2.0)
MIN_FIT = 0.52  # sum of IoU over what could match that speaks for itself
MIN_LED_FIT, MIN_LEAD = 0.4, 0.15  # ... and that suffices with such a lead over the next best pose
START_DIRECTIONS = 64  # points a rock while hypotheses are refined from afar
SAME_POSITION = 0.1  # metres: fits that end nearer to each other are one
NO_LEAD = 0.1  # of the share: a pose that leads another one by less is a guess, however much both explain


@dataclass(frozen=True)
class LabelLocalisation:
    """The best fit, and the best of those that end elsewhere."""

    fit: BoxFit
    runner_up: float  # share of the next best other pose; 0 where there is none
    prior: PosePrior  # what was known of the pose
    boxes: np.ndarray  # (b, 4) pixels: what it rests on

    @property
    def share(self) -> float:
        """Summed IoU over the number of pairs that could be."""
        return share_of(self.fit, self.boxes)


def localise_by_labels(
    boxes: np.ndarray, outlines: Outlines, lens: Lens, surveyed: Pose | None, options: LocalisationOptions
) -> LabelLocalisation:
    """Find the left camera's pose from boxes and meshes, with no start; not yet checked, see `checked`.

    Every hypothesis of the search is refined to the end before poses are compared: rough fits of one and the same pose
    stand decimetres apart.

    Parameters
    ----------
    boxes : (b, 4) float
        Rock boxes of the left photo, pixels.
    surveyed : Pose or None
        Where the survey has the left camera: tells the side from which the terrain is seen, and decides between
        poses that explain the boxes alike.

    Raises
    ------
    RegistrationError
        Too few boxes or meshes, or no pose explains any of them.
    """
    if min(len(boxes), len(outlines)) < MIN_BOXES:
        raise RegistrationError(f"{len(boxes)} boxes and {len(outlines)} meshes, a pose needs {MIN_BOXES} of each")
    prior = survey_prior(surveyed, options)
    azimuth = None if surveyed is None else float(np.arctan2(surveyed.translation[1], surveyed.translation[0]))
    centres = candidate_centres(azimuth, float(np.median(outlines.centres[:, 2])))
    starts = [start.sandbox_from_left for start in search_pose(outlines, boxes, lens, centres)]
    fits = _distinct(_final_fits(starts, boxes, outlines, lens, prior), prior)
    if not fits:
        raise RegistrationError("no pose puts any rock on any box")
    rival = max((share_of(fit, boxes) for fit in fits[1:]), default=0.0)
    return LabelLocalisation(fits[0], rival, prior, boxes)


def share_of(fit: BoxFit, boxes: np.ndarray) -> float:
    """Summed IoU of a fit over the number of pairs that could be: rocks in view, or boxes (b, 4) where fewer."""
    return fit.sum_iou / max(1, min(fit.in_view, len(boxes)))


def checked(localisation: LabelLocalisation) -> LabelLocalisation:
    """Refuse a pose that explains too little, is no better than another one, or stands where no tripod stood.

    Raises
    ------
    RegistrationError
        With the shares, or the distance from the survey.
    """
    leads = localisation.share >= MIN_LED_FIT and localisation.share - localisation.runner_up >= MIN_LEAD
    if localisation.share < MIN_FIT and not leads:
        raise RegistrationError(
            f"the best pose explains {localisation.share:.2f} of what could match, the next "
            f"{localisation.runner_up:.2f}; {MIN_FIT:g}, or {MIN_LED_FIT:g} with a lead of {MIN_LEAD:g}, is needed"
        )
    if localisation.share - localisation.runner_up < NO_LEAD:
        raise RegistrationError(
            f"two poses explain the {len(localisation.boxes)} boxes nearly alike, {localisation.share:.2f} and "
            f"{localisation.runner_up:.2f} of what could match"
        )
    off = _off_survey(localisation)
    if off > MAX_OFF_SURVEY:
        raise RegistrationError(
            f"the pose that explains the boxes best stands {off:.1f} m from the survey's position, at most "
            f"{MAX_OFF_SURVEY:g} m are believed: are these another position's boxes?"
        )
    return localisation


def is_likely(localisation: LabelLocalisation) -> bool:
    """Whether a pose that `checked` refuses is still likelier than the survey's: enough to move labels in the image.

    It holds wherever a tripod may have stood. Of 19 positions of 03, 08, 11, 12 that few seeds did not localise, which
    explained 0.19 to 0.82 of what could match, rocks that the ground moved from Left to Right by such a pose met drawn
    ones with F1 0.82, by the survey's pose with 0.60; at no position was it worse.
    """
    return _off_survey(localisation) <= MAX_OFF_SURVEY


def _off_survey(localisation: LabelLocalisation) -> float:
    """Distance of the left camera from its surveyed position, metres; 0 where nobody surveyed it."""
    if not np.isfinite(localisation.prior.sd[0]):
        return 0.0
    return float(np.linalg.norm(localisation.fit.sandbox_from_left.translation - localisation.prior.mean[:3]))


def survey_prior(surveyed: Pose | None, options: LocalisationOptions) -> PosePrior:
    """The survey as a prior; without it only the roll is known to be small."""
    roll = np.radians(ROLL_SD_DEG)
    if surveyed is None:
        return PosePrior(np.zeros(6), np.append(np.full(5, np.inf), roll))
    yaw, pitch, _ = yaw_pitch_roll(surveyed)
    angle = np.radians(options.survey_sd_deg)
    sd = np.array([options.survey_sd_m] * 3 + [angle, angle, roll])
    return PosePrior(np.array([*surveyed.translation, yaw, pitch, 0.0]), sd)


def _final_fits(
    starts: list[Pose], boxes: np.ndarray, outlines: Outlines, lens: Lens, prior: PosePrior
) -> list[BoxFit]:
    thin = outlines.thinned(START_DIRECTIONS)
    fits = []
    for start in starts:
        near = refine_pose(start, thin, boxes, lens, prior, START_GATES_PX, START_NOISE)
        pose = refine_pose(near, outlines, boxes, lens, prior, FINAL_GATES_PX, FINAL_NOISE)
        fits.append(check_pose(pose, outlines, boxes, lens, prior, FINAL_NOISE))
    return fits


def _distinct(fits: list[BoxFit], prior: PosePrior) -> list[BoxFit]:
    """The best fit of each position, best first; what lies off the survey counts a little less."""

    def worth(fit: BoxFit) -> float:
        return fit.sum_iou - SURVEY_WEIGHT * prior.chi2(fit.sandbox_from_left)

    kept: list[BoxFit] = []
    for fit in sorted(fits, key=worth, reverse=True):
        if not any(_same(fit, other) for other in kept):
            kept.append(fit)
    return kept


def _same(first: BoxFit, second: BoxFit) -> bool:
    return bool(
        np.linalg.norm(first.sandbox_from_left.translation - second.sandbox_from_left.translation) < SAME_POSITION
    )
