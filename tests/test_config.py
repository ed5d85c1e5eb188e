import pytest

from polarsim.config import render_options
from polarsim.errors import ConfigError
from polarsim.render.options import RenderOptions


def test_no_assignment_leaves_the_defaults():
    assert render_options([]) == RenderOptions()


def test_assignments_reach_any_depth_and_the_last_one_wins():
    found = render_options(["samples=9", "samples=4", "blur_px=0.6", "principled.roughness=0.5", "gain={hapke: 150}"])
    expected = {"samples": 4, "blur_px": 0.6, "principled": {"roughness": 0.5}, "gain": {"hapke": 150}}
    assert found == RenderOptions.model_validate(expected)
    assert render_options(["hapke.w=0.3", "hapke.b=0.2", "hapke.c=0.1"]).hapke.b == 0.2


@pytest.mark.parametrize(
    ("assignment", "told"),
    [
        ("samples", "'samples' is no option: expected KEY=VALUE"),
        ("=4", "'=4' is no option: expected KEY=VALUE"),
        ("samples=5", "samples: Input should be 1, 4, 9 or 16, found 5"),
        ("blurr_px=1", "blurr_px: unknown key"),
        ("blur_px=wide", "blur_px: .*number.*found 'wide'"),
        ("gain={", "gain: '{' is no YAML value"),
        ("principled.shine=1", "principled.shine: unknown key"),
        ("pixel_filter=gaussian", "pixel_filter: gaussian needs samples"),
    ],
)
def test_a_wrong_assignment_is_told_in_one_line(assignment, told):
    with pytest.raises(ConfigError, match=told) as error:
        render_options([assignment])
    assert "\n" not in str(error.value)
