"""Translations of rocks by millimetres that make the boxes of all views agree: meshes were cut and placed by hand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from polarsim.cameras.labels import FINAL_NOISE, LabelLocalisation
from polarsim.cameras.refine import BoxFit, EdgeProblem, pose_of_unknowns, unknowns_of
from polarsim.geometry.boxes import match_by_position_and_size, match_gate_px
from polarsim.geometry.camera import Camera
from polarsim.geometry.lens import Lens
from polarsim.geometry.outlines import Outlines
from polarsim.run_files.rock_translations import TRANSLATION_COLUMNS

PAIRINGS = 3  # number of times that rocks and boxes are paired
OUTLIER_SD = 2.0  # standard deviations of the prior beyond which a rock was clearly moved: the prior loses weight
MAX_TRANSLATION = 0.1  # maximum translation, metres: boxes that imply more belong to another rock
STEPS = 30  # maximum number of steps of a fit
TRANSLATIONS_CONVERGED = 1e-6  # metres and radians: smaller steps end a fit


@dataclass(frozen=True)
class Translations:
    """Translations of rocks in the sandbox frame."""

    metres: np.ndarray  # (m, 3)
    sd: np.ndarray  # (m, 3) metres; of the prior for rocks without boxes
    boxes: np.ndarray  # (m,) number of boxes that determine a translation


def no_translations(outlines: Outlines, sd: float) -> Translations:
    """Return zero translations with standard deviation `sd`, metres, on each axis."""
    shape = len(outlines), 3
    return Translations(np.zeros(shape), np.full(shape, sd), np.zeros(len(outlines), int))


def translated(outlines: Outlines, metres: np.ndarray) -> Outlines:
    """Translate outlines by (m, 3)."""
    return replace(outlines, whole=outlines.whole + metres[:, None], upper=outlines.upper + metres[:, None])


def fit_translations(
    positions: Mapping[str, LabelLocalisation], outlines: Outlines, lens: Lens, sd: float, start: np.ndarray
) -> tuple[dict[str, np.ndarray], Translations]:
    """Fit poses of all views and translations of all rocks by iterated least squares with Cauchy weights of the edges.

    A prior of `sd` metres on each axis fixes the rocks and the terrain's frame, because moving all rocks and all
    cameras by the same translation changes no box. The prior has the tails of a Cauchy distribution: a few rocks were
    moved by centimetres, and must not shift the rest.

    `start` (m, 3): previous translations, metres. Return `unknowns_of` (6,) the left cameras, and the translations.
    """
    unknowns = {
        position: unknowns_of(localisation.fit.sandbox_from_left) for position, localisation in positions.items()
    }
    metres, gate_px = start, match_gate_px(lens.width)
    mismatched = np.zeros(len(outlines), bool)  # rocks with boxes of another rock
    pairs: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for _ in range(PAIRINGS):
        moved = translated(outlines, metres)
        for position, localisation in positions.items():
            rows, columns = match_by_position_and_size(
                moved.seen(Camera(pose_of_unknowns(unknowns[position]), lens)), localisation.boxes, gate_px
            )
            known = ~mismatched[rows]
            pairs[position] = rows[known], columns[known]
        for _ in range(STEPS):
            normal_matrix, right_side = _normal_equations(positions, pairs, unknowns, outlines, metres, lens, sd)
            step = np.linalg.solve(normal_matrix, right_side)
            for number, position in enumerate(unknowns):
                unknowns[position] = unknowns[position] + step[6 * number : 6 * number + 6]
            metres = metres + step[6 * len(positions) :].reshape(-1, 3)
            if np.abs(step).max() < TRANSLATIONS_CONVERGED:
                break
        mismatched |= np.linalg.norm(metres, axis=1) > MAX_TRANSLATION
        metres = np.where(mismatched[:, None], 0.0, metres)
    normal_matrix, _ = _normal_equations(positions, pairs, unknowns, outlines, metres, lens, sd)
    variance = np.diag(np.linalg.inv(normal_matrix))[6 * len(positions) :].reshape(-1, 3)
    matched = np.concatenate([rows for rows, _ in pairs.values()])
    return unknowns, Translations(metres, np.sqrt(variance), np.bincount(matched, minlength=len(outlines)))


def _normal_equations(
    positions: Mapping[str, LabelLocalisation],
    pairs: Mapping[str, tuple[np.ndarray, np.ndarray]],
    unknowns: Mapping[str, np.ndarray],
    outlines: Outlines,
    metres: np.ndarray,
    lens: Lens,
    sd: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return matrix and right side for the unknowns of the poses (6 each), then the translations (3 each)."""
    poses = 6 * len(positions)
    size = poses + 3 * len(outlines)
    moved = translated(outlines, metres)
    matrix, side = np.zeros((size, size)), np.zeros(size)
    for number, (position, localisation) in enumerate(positions.items()):
        rows, columns = pairs[position]
        problem = EdgeProblem(moved.part(rows), localisation.boxes[columns], lens, localisation.prior, FINAL_NOISE)
        residuals, slopes = problem.residuals(unknowns[position]), problem.jacobian(unknowns[position])
        weights = 1 / (1 + (residuals / FINAL_NOISE.loss_scale) ** 2)
        weights[-6:] = 1  # the prior is not an outlier
        jacobian = np.zeros((len(residuals), size))
        jacobian[:, 6 * number : 6 * number + 6] = slopes
        for pair, rock in enumerate(rows):  # moving a rock is equivalent to moving the camera in the opposite direction
            edges = slice(4 * pair, 4 * pair + 4)
            jacobian[edges, poses + 3 * rock : poses + 3 * rock + 3] = -slopes[edges, :3]
        matrix += (jacobian * weights[:, None]).T @ jacobian
        side -= jacobian.T @ (weights * residuals)
    held = np.arange(poses, size)
    hold = np.repeat(sd**-2 / (1 + (metres**2).sum(axis=1) / (OUTLIER_SD * sd) ** 2), 3)
    matrix[held, held] += hold
    side[poses:] -= hold * metres.ravel()
    return matrix, side


def translation_table(
    rocks: np.ndarray, translations: Translations, before: Sequence[BoxFit], after: Sequence[BoxFit]
) -> pd.DataFrame:
    """Return a row for each rock, rounded to 0.01 mm; IoU are means over the views that show the rock, NaN without.

    `before`, `after`: fits of all views to the original and to the translated meshes.
    """
    millimetres = np.round(1000 * translations.metres, 2) + 0.0
    columns = {
        "rock": rocks,
        **dict(zip(TRANSLATION_COLUMNS, millimetres.T, strict=True)),
        "sd_mm": np.round(1000 * np.linalg.norm(translations.sd, axis=1), 2),
        "boxes": translations.boxes,
        "iou_before": _mean_iou(before, len(rocks)),
        "iou_after": _mean_iou(after, len(rocks)),
    }
    return pd.DataFrame(columns).sort_values("rock", ignore_index=True)


def _mean_iou(fits: Sequence[BoxFit], rocks: int) -> np.ndarray:
    outline = np.concatenate([fit.outline for fit in fits])
    total = np.bincount(outline, np.concatenate([fit.iou for fit in fits]), rocks)
    count = np.bincount(outline, minlength=rocks)
    return np.round(np.divide(total, count, out=np.full(rocks, np.nan), where=count > 0), 4)
