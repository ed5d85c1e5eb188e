"""Assignment of labels to cells, and loss functions."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional

from polarsim.detect.detectors.compact.network import STRIDE, cell_centres

BOX_WEIGHT, MASK_WEIGHT = 2.0, 2.0
_CORE = 0.25  # half size of the region of assigned cells around the centre of a box, relative to the box


def assign_labels(classes: Tensor, boxes: Tensor, shape: tuple[int, int, int]) -> Tensor:
    """Return the index of the label (c, h, w) assigned to each cell, -1 for none.

    A label is assigned to the cells in the central half of its box, including the cell of its centre. If several labels
    of a class cover a cell, the smallest label is assigned. Labels are classes (n,) int64 and boxes (n, 4), px; `shape`
    is the number of classes, rows and columns.
    """
    _, rows, columns = shape
    owner = torch.full(shape, -1, dtype=torch.int64, device=boxes.device)
    x, y = cell_centres(rows, columns, boxes.device)
    centre, sides = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    reach = _CORE * sides
    across = (x - centre[:, :1]).abs() <= reach[:, :1]  # (n, w)
    down = (y - centre[:, 1:]).abs() <= reach[:, 1:]  # (n, h)
    centre_cell = (centre / STRIDE).long()
    index = torch.arange(len(boxes), device=boxes.device)
    across[index, centre_cell[:, 0].clamp(0, columns - 1)] = True
    down[index, centre_cell[:, 1].clamp(0, rows - 1)] = True
    for n in torch.argsort(sides.prod(dim=1), descending=True, stable=True).tolist():
        owner[classes[n]][down[n][:, None] & across[n]] = n
    return owner


def losses(logits: Tensor, boxes: Tensor, labels: Sequence[tuple[Tensor, Tensor]]) -> tuple[Tensor, Tensor]:
    """Return class loss and box loss of a batch, each summed over cells and divided by the number of labelled cells.

    The target score of a cell is the IoU of its box with its label (quality focal loss, Li et al., NeurIPS 2020), so
    that the confidence ranks boxes by accuracy. The box loss is 1 - GIoU (Rezatofighi et al., CVPR 2019). Logits and
    boxes are of `Compact.forward`; labels are classes (n,) and boxes (n, 4) of each image.
    """
    target = torch.zeros_like(logits)
    targets, predicted, indices = [], [], []
    for picture, (classes, corners) in enumerate(labels):
        if not len(corners):
            continue
        owner = assign_labels(classes, corners, logits.shape[1:])
        index = (owner >= 0).nonzero()
        targets.append(corners[owner[index[:, 0], index[:, 1], index[:, 2]]])
        predicted.append(boxes[picture, index[:, 0], :, index[:, 1], index[:, 2]])
        indices.append(functional.pad(index, (1, 0), value=picture))
    if not indices:
        return _quality_focal(logits, target).sum(), boxes.sum() * 0
    overlap, generalised = _overlaps(torch.cat(predicted), torch.cat(targets))
    target[torch.cat(indices).unbind(1)] = overlap.detach().clamp(min=0)
    count = len(overlap)
    return _quality_focal(logits, target).sum() / count, BOX_WEIGHT * (1 - generalised).sum() / count


def mask_loss(logits: Tensor, shares: Tensor) -> Tensor:
    """Return the cross entropy of masks, mean over labelled pixels.

    `shares` (b, classes, h, w) are the shares of the pixels of each cell by class; unlabelled pixels have no class.
    """
    entropy = -(shares * functional.log_softmax(logits, dim=1)).sum()
    return MASK_WEIGHT * entropy / shares.sum().clamp(min=1)


def _quality_focal(logits: Tensor, target: Tensor) -> Tensor:
    entropy = functional.binary_cross_entropy_with_logits(logits, target, reduction="none")
    return entropy * (torch.sigmoid(logits) - target).abs() ** 2


def _overlaps(first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
    """Return IoU and GIoU (n,) of corresponding boxes (n, 4)."""
    shared = (torch.minimum(first[:, 2:], second[:, 2:]) - torch.maximum(first[:, :2], second[:, :2])).clamp(min=0)
    around = torch.maximum(first[:, 2:], second[:, 2:]) - torch.minimum(first[:, :2], second[:, :2])
    intersection, hull = shared.prod(dim=1), around.prod(dim=1)
    union = (first[:, 2:] - first[:, :2]).prod(dim=1) + (second[:, 2:] - second[:, :2]).prod(dim=1) - intersection
    overlap = intersection / union
    return overlap, overlap - (hull - union) / hull
