import numpy as np
import pytest

torch = pytest.importorskip("torch")

from polarsim.detect.nms import nms  # noqa: E402


def kept_by_definition(boxes, scores, limit):
    """Greedy suppression: keep the most confident box, drop boxes that overlap it, repeat."""
    order, kept = np.argsort(-scores, kind="stable").tolist(), []
    while order:
        best, *rest = order
        kept.append(best)
        low, high = np.maximum(boxes[best, :2], boxes[rest, :2]), np.minimum(boxes[best, 2:], boxes[rest, 2:])
        shared = np.prod(np.clip(high - low, 0, None), axis=1)
        area = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
        order = [one for one, part in zip(rest, shared, strict=True) if part <= limit * (area[best] + area[one] - part)]
    return kept


@pytest.mark.parametrize("seed", range(3))
def test_suppression_agrees_with_its_definition(seed):
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 200, (300, 2))
    boxes = np.concatenate([low, low + rng.uniform(5, 60, (300, 2))], axis=1).astype(np.float32)
    boxes += np.float32(7680) * rng.integers(0, 2, (300, 1))  # an offset separates the classes
    scores = rng.permutation(np.linspace(0.01, 0.99, 300)).astype(np.float32)
    found = nms(torch.from_numpy(boxes), torch.from_numpy(scores), 0.6)
    assert found.dtype == torch.int64
    assert found.tolist() == kept_by_definition(boxes.astype(float), scores, 0.6)


def test_no_boxes_and_one_box():
    assert nms(torch.zeros((0, 4)), torch.zeros(0), 0.5).tolist() == []
    assert nms(torch.tensor([[0.0, 0, 4, 4]]), torch.tensor([0.5]), 0.5).tolist() == [0]
