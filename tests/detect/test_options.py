import pytest
from pydantic import ValidationError

from polarsim.detect.options import PACKAGED, DetectOptions, TrainingOptions


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"splits": ["photo", "photo"]}, "named twice"),
        ({"splits": []}, "at least 1 item"),
        ({"seeds": [3, 3]}, "named twice"),
        ({"seeds": [-1]}, "seed -1, expected 0 or more"),
        ({"mixes": {"real_on_hapke": {"real": 1}}}, "expected a name of small letters"),
        ({"mixes": {"mixed": {}}}, "expected domains with weights above 0"),
        ({"mixes": {"mixed": {"real": 0}}}, "expected domains with weights above 0"),
        ({"mixes": {"mixed": {"real": float("nan")}}}, "expected domains with weights above 0"),
    ],
)
def test_options_that_name_nothing_or_one_thing_twice_are_refused(changes, told):
    with pytest.raises(ValidationError, match=told):
        DetectOptions(**changes)


def test_the_packaged_detector_is_named_and_fits_one_model():
    options = TrainingOptions(model="compact", pretrained="packaged")
    assert options.start_weights == PACKAGED
    assert options.start == PACKAGED.name
    assert TrainingOptions.model_validate({"model": "compact", "pretrained": "w.pt"}).start == "w.pt"
    with pytest.raises(ValidationError, match="of model compact, not yolov5n"):
        TrainingOptions(model="yolov5n", pretrained="packaged")
