"""Which cells answer for which label, and how wrong their answers are."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from polarsim.detect.detectors.compact.network import STRIDE, cell_centres

BOX_WEIGHT, MASK_WEIGHT = 2.0, 2.0
_CORE = 0.25  # cells this share of the box's sides around its centre answer for it


def assign(classes: Tensor, boxes: Tensor, shape: tuple[int, int, int]) -> Tensor:
    """The label (c, h, w) that each cell answers for, -1 for none.

    A label has the cells in the central half of its box, and always the cell of its centre; of several labels of a
    class the smallest has a cell.

    Parameters
    ----------
    classes : (n,) int64
    boxes : (n, 4)
        x0, y0, x1, y1, px.
    shape
        Classes, rows and columns of the map.
    """
    _, rows, columns = shape
    owner = torch.full(shape, -1, dtype=torch.int64, device=boxes.device)
    x, y = cell_centres(rows, columns, boxes.device)
    centre, sides = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    reach = _CORE * sides
    across = (x - centre[:, :1]).abs() <= reach[:, :1]  # (n, w)
    down = (y - centre[:, 1:]).abs() <= reach[:, 1:]  # (n, h)
    own = (centre / STRIDE).long()
    one = torch.arange(len(boxes), device=boxes.device)
    across[one, own[:, 0].clamp(0, columns - 1)] = True
    down[one, own[:, 1].clamp(0, rows - 1)] = True
    for n in torch.argsort(sides.prod(dim=1), descending=True, stable=True).tolist():
        owner[classes[n]][down[n][:, None] & across[n]] = n
    return owner


def losses(logits: Tensor, boxes: Tensor, labels: Sequence[tuple[Tensor, Tensor]]) -> tuple[Tensor, Tensor]:
    """Class loss and box loss of a batch, each a sum over cells divided by the number of cells with a label.

    A cell's score is to be the IoU of its box with its label (quality focal loss, Li et al., NeurIPS 2020), so that
    the best of several boxes is the surest; the box loss is 1 - GIoU (Rezatofighi et al., CVPR 2019).

    Parameters
    ----------
    logits, boxes : see `Compact.forward`
    labels
        Classes (n,) and boxes (n, 4) of each picture.
    """
    target = torch.zeros_like(logits)
    wanted, found, indices = [], [], []
    for picture, (classes, corners) in enumerate(labels):
        if not len(corners):
            continue
        owner = assign(classes, corners, logits.shape[1:])
        index = (owner >= 0).nonzero()
        wanted.append(corners[owner[index[:, 0], index[:, 1], index[:, 2]]])
        found.append(boxes[picture, index[:, 0], :, index[:, 1], index[:, 2]])
        indices.append(functional.pad(index, (1, 0), value=picture))
    if not indices:
        return _quality_focal(logits, target).sum(), boxes.sum() * 0
    overlap, generalised = _overlaps(torch.cat(found), torch.cat(wanted))
    target[torch.cat(indices).unbind(1)] = overlap.detach().clamp(min=0)
    count = len(overlap)
    return _quality_focal(logits, target).sum() / count, BOX_WEIGHT * (1 - generalised).sum() / count


def mask_loss(logits: Tensor, shares: Tensor) -> Tensor:
    """Cross entropy of what cells show, mean over all that is known of them.

    Parameters
    ----------
    logits : (b, classes, h, w)
    shares : (b, classes, h, w)
        Of each cell's pixels; pixels of which nothing is known are in none.
    """
    entropy = -(shares * functional.log_softmax(logits, dim=1)).sum()
    return MASK_WEIGHT * entropy / shares.sum().clamp(min=1)


def _quality_focal(logits: Tensor, target: Tensor) -> Tensor:
    entropy = functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
    return entropy * (torch.sigmoid(logits) - target).abs() ** 2


def _overlaps(first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
    """IoU and GIoU (n,) of boxes (n, 4) pair by pair."""
    shared = (torch.minimum(first[:, 2:], second[:, 2:]) - torch.maximum(first[:, :2], second[:, :2])).clamp(min=0)
    around = torch.maximum(first[:, 2:], second[:, 2:]) - torch.minimum(first[:, :2], second[:, :2])
    intersection, hull = shared.prod(dim=1), around.prod(dim=1)
    union = (first[:, 2:] - first[:, :2]).prod(dim=1) + (second[:, 2:] - second[:, :2]).prod(dim=1) - intersection
    overlap = intersection / union
    return overlap, overlap - (hull - union) / hull
