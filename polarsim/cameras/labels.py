"""A position placed by its seed boxes and the terrain's rock meshes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from polarsim.cameras.options import CamerasOptions
from polarsim.cameras.refine import BoxFit, EdgeNoise, PosePrior, judge_pose, pose_of, refine_pose
from polarsim.cameras.search import candidate_centres, search_pose
from polarsim.cameras.shifts import Shifts, View, fit_shifts, shifted
from polarsim.errors import RegistrationError
from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import Outlines
from polarsim.geometry.poses import Pose, yaw_pitch_roll

START_DIRECTIONS = 64  # points a rock while hypotheses are compared
FINAL_LOSS_SCALE = 2.0  # of the Cauchy loss, in standard deviations of an edge
SAME_PLACE = 0.1  # metres: fits that end nearer to each other are one


@dataclass(frozen=True)
class LabelPlacement:
    """The best fit, and the best of those that end elsewhere."""

    fit: BoxFit
    share: float  # summed IoU over the number of pairs that could be
    runner_up: float  # the same of the next best other pose; 0 where there is none
    prior: PosePrior  # what was known of the pose


def place_by_labels(
    boxes: np.ndarray, outlines: Outlines, lens: Lens, surveyed: Pose | None, options: CamerasOptions
) -> LabelPlacement:
    """Find the left camera's pose from boxes and meshes, with no start.

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
        Too few boxes or meshes, or no pose explains enough of them.
    """
    if min(len(boxes), len(outlines)) < options.min_boxes:
        raise RegistrationError(
            f"{len(boxes)} boxes and {len(outlines)} meshes, a pose needs {options.min_boxes} of each"
        )
    prior = survey_prior(surveyed, options)
    rough, fine = EdgeNoise(options.start_edge_sd_px, options.border_px), final_noise(options)
    azimuth = None if surveyed is None else float(np.arctan2(surveyed.translation[1], surveyed.translation[0]))
    centres = candidate_centres(azimuth, float(np.median(outlines.centres[:, 2])), options)
    starts = search_pose(outlines, boxes, lens, centres, options)
    thin = outlines.thinned(START_DIRECTIONS)
    fits = []
    for start in starts:
        pose = refine_pose(start.sandbox_from_left, thin, boxes, lens, prior, options.start_gates_px, rough)
        fits.append(judge_pose(pose, thin, boxes, lens, prior, options.match_gate_px, rough))
    if not fits:
        raise RegistrationError("no pose puts any rock on any box")
    worth = [fit.sum_iou - options.survey_weight * prior.chi2(fit.sandbox_from_left) for fit in fits]
    best = fits[int(np.argmax(worth))]
    rival = max((fit.sum_iou for fit in fits if not _same(fit, best)), default=0.0)
    pose = refine_pose(best.sandbox_from_left, outlines, boxes, lens, prior, options.final_gates_px, fine)
    fit = judge_pose(pose, outlines, boxes, lens, prior, options.match_gate_px, fine)
    possible = max(1, min(fit.in_view, len(boxes)))
    return checked(LabelPlacement(fit, fit.sum_iou / possible, rival / possible, prior), options)


def final_noise(options: CamerasOptions) -> EdgeNoise:
    """Of the last fits: edges that are far off hardly count."""
    return EdgeNoise(options.edge_sd_px, options.border_px, "cauchy", FINAL_LOSS_SCALE)


def with_shifts(
    placements: Mapping[str, LabelPlacement],
    boxes: Mapping[str, np.ndarray],
    outlines: Outlines,
    lens: Lens,
    options: CamerasOptions,
) -> tuple[dict[str, LabelPlacement], Shifts]:
    """All positions placed anew together with small shifts of the rocks, by the boxes (b, 4) of each."""
    noise, gate = final_noise(options), options.match_gate_px
    views = {position: View(boxes[position], one.fit, one.prior) for position, one in placements.items()}
    unknowns, shifts = fit_shifts(views, outlines, lens, options.rock_shift_sd_mm / 1000, gate, noise)
    moved = shifted(outlines, shifts.metres)
    placed = {}
    for position, one in placements.items():
        fit = judge_pose(pose_of(unknowns[position]), moved, boxes[position], lens, one.prior, gate, noise)
        placed[position] = replace(one, fit=fit)
    return placed, shifts


def checked(placement: LabelPlacement, options: CamerasOptions) -> LabelPlacement:
    """Refuse a pose that neither explains enough nor stands clearly above all others."""
    leads = placement.share >= options.min_led_fit and placement.share - placement.runner_up >= options.min_lead
    if placement.share < options.min_fit and not leads:
        raise RegistrationError(
            f"the best pose explains {placement.share:.2f} of what could match, the next {placement.runner_up:.2f}; "
            f"{options.min_fit:g}, or {options.min_led_fit:g} with a lead of {options.min_lead:g}, is needed"
        )
    return placement


def survey_prior(surveyed: Pose | None, options: CamerasOptions) -> PosePrior:
    """The survey as a prior; without it only the roll is known to be small."""
    roll = np.radians(options.roll_sd_deg)
    if surveyed is None:
        return PosePrior(np.zeros(6), np.append(np.full(5, np.inf), roll))
    yaw, pitch, _ = yaw_pitch_roll(surveyed)
    turn = np.radians(options.survey_sd_deg)
    sd = np.array([options.survey_sd_m] * 3 + [turn, turn, roll])
    return PosePrior(np.array([*surveyed.translation, yaw, pitch, 0.0]), sd)


def _same(first: BoxFit, second: BoxFit) -> bool:
    return bool(np.linalg.norm(first.sandbox_from_left.translation - second.sandbox_from_left.translation) < SAME_PLACE)
