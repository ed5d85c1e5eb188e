import pytest
from pydantic import ValidationError

from polarsim.detect.options import PACKAGED, DetectOptions, TrainingOptions


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("splits", ["photo", "photo"]),
        ("splits", []),
        ("seeds", [3, 3]),
        ("seeds", [-1]),
        ("mixes", {"real_on_hapke": {"real": 1}}),
        ("mixes", {"mixed": {}}),
        ("mixes", {"mixed": {"real": 0}}),
        ("mixes", {"mixed": {"real": float("nan")}}),
    ],
)
def test_empty_and_repeated_option_values_are_an_error(key, value):
    with pytest.raises(ValidationError, match=key):
        DetectOptions(**{key: value})


def test_the_packaged_detector_requires_model_compact():
    options = TrainingOptions(model="compact", pretrained="packaged")
    assert options.start_weights == PACKAGED
    assert options.start == PACKAGED.name
    assert TrainingOptions.model_validate({"model": "compact", "pretrained": "w.pt"}).start == "w.pt"


@pytest.mark.parametrize(
    "given",
    [
        {"model": "yolov5n", "pretrained": "packaged"},
        {"model": "compact", "mosaic": True},
        {"model": "yolov8n", "masks": True},
    ],
)
def test_options_that_a_model_does_not_support_are_an_error(given):
    with pytest.raises(ValidationError):
        TrainingOptions(**given)
