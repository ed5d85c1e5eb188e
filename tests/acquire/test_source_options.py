import re

import pytest
from pydantic import ValidationError

from polarsim.acquire.options import SeedOptions, SourceOptions, describe_seeds, seed_choice


@pytest.mark.parametrize(
    ("content", "key"),
    [
        ({"kind": "release"}, ()),
        ({"kind": "files"}, ()),
        ({"kind": "moon"}, ("kind",)),
        ({"kind": "polar", "root": "x"}, ("kind",)),
        ({"kind": "files", "root": "x", "url": {}}, ("url",)),
        ({"kind": "files", "root": "x", "urls": {"../a.zip": "http://x/a.zip"}}, ("urls",)),
        ({"kind": "files", "root": "x", "urls": {"a.tar": "http://x/a.tar"}}, ("urls",)),
        ({"kind": "files", "root": "x", "urls": {"a.zip": "file:///etc/passwd"}}, ("urls",)),
    ],
)
def test_an_invalid_source_is_an_error(content, key):
    with pytest.raises(ValidationError) as caught:
        SourceOptions(**content)
    assert caught.value.errors()[0]["loc"] == key


@pytest.mark.parametrize(
    "content",
    [
        {"light": False},
        {"azimuths": [30, False]},
        {"camera": "left"},
        {"exposure": 0},
        {"exposure": "good"},
        {"exposures": 256},
    ],
)
def test_invalid_seeds_are_errors(content):
    with pytest.raises(ValidationError) as caught:
        SeedOptions(**content)
    assert caught.value.errors()[0]["loc"][0] in content


def test_azimuths_may_be_written_as_numbers():
    assert SeedOptions(azimuths=[30, "350"]).azimuths == ("30", "350")


def test_seeds_are_options_or_none():
    assert seed_choice("none") == "none"
    assert seed_choice({"camera": "R"}) == SeedOptions(camera="R")
    assert seed_choice(SeedOptions()) == SeedOptions()
    for content in (None, "nine", "None"):
        with pytest.raises(ValueError, match=re.escape(repr(content))):
            seed_choice(content)


def test_the_selection_of_seeds_is_described_as_text():
    assert describe_seeds("none") == "none"
    assert describe_seeds(SeedOptions(azimuths=[30, 180])) == "L, rover light off, azimuths 30 180, exposure best"
    assert describe_seeds(SeedOptions(exposure=256)).endswith("exposure 256 ms")
