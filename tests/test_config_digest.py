"""The configuration digest of tables: equal for equal data, different for every option that can change a result."""

from __future__ import annotations

import copy
from pathlib import Path

import pytest
import yaml

from polarsim.config import Config, parse_config
from polarsim.render.options import OF_FITTED

CONFIGURATIONS = Path(__file__).parents[1] / "config"
WHOLE = ("accuracy", "config", "covers", "full", "paper", "polar", "release", "rover_release")


def content(name: str) -> dict:
    return yaml.safe_load((CONFIGURATIONS / f"{name}.yaml").read_text())


CONTENTS = {name: content(name) for name in WHOLE}
DIGESTS = {name: parse_config(found).digest() for name, found in CONTENTS.items()}


@pytest.mark.parametrize("name", WHOLE)
def test_neither_names_nor_folders_nor_downloads_change_the_digest(name):
    changed = copy.deepcopy(CONTENTS[name])
    changed["run"] = "r0.9_Z-"
    changed["source"] |= {"root": "/é other", "urls": {"Terrain11_FreshCrater.zip": "https://host/a"}}
    changed["publish"] = {"forms": ["pds4", "usd"]}
    if "root" in changed.get("labels", {}).get("seeds", {}):
        changed["labels"]["seeds"]["root"] = "/seeds"
    assert parse_config(changed).digest() == DIGESTS[name]


@pytest.mark.parametrize(
    "section",
    [
        lambda folder: {"labels": {"corrections": folder}},
        lambda folder: {"labels": {"seeds": {"root": f"/other{folder}"}}},
        lambda folder: {"scoring": {"annotated_root": f"/other{folder}"}},
        lambda folder: {"detect": {"views": folder}},
        lambda folder: {"detect": {"training": {"model": "yolov5n", "pretrained": f"{folder}/weights.pt"}}},
    ],
    ids=["corrections", "seeds", "annotated", "views", "weights"],
)
def test_where_further_data_are_stored_does_not_change_the_digest(section):
    source = {"source": {"kind": "files", "root": "data/polar"}}
    first, second = (parse_config(source | section(folder)).digest() for folder in ("/a b/é", "/other/../c"))
    assert first == second


@pytest.mark.parametrize("name", WHOLE)
def test_defaults_and_the_sign_of_zero_do_not_change_the_digest(name):
    plain = parse_config(CONTENTS[name])

    def written_out(value):
        if isinstance(value, dict):
            return {key: written_out(part) for key, part in reversed(value.items())}
        if isinstance(value, list):
            return [written_out(part) for part in value]
        return -0.0 if isinstance(value, float) and value == 0 else value

    written = plain.model_dump(mode="json")
    for option in OF_FITTED if plain.domains_to_fit else ():  # plain and fitted twins have different defaults
        del written["render"][option]
    assert Config.model_validate(written_out(written)).digest() == plain.digest()


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"analog": {"seed": 9}}, "release"),
        ({"detect": {"training": {"epochs": 9}}}, "full"),
        ({"rover": {"seeds": [5]}}, "config"),
        ({"covers": {"carved_epochs": 9}}, "config"),
        ({"rover": {"run": True, "bags": False, "world": {"terrains": [3, 1, 11]}, "seeds": [0, 1, 2]}}, None),
    ],
    ids=["analog", "detect", "rover", "covers", "bags"],
)
def test_options_of_unused_sections_do_not_change_the_digest(change, name):
    if name is None:
        base = CONTENTS["config"] | {"rover": change["rover"] | {"bags": True}}
        assert parse_config(base | change).digest() == parse_config(base).digest()
        return
    base = CONTENTS[name]
    changed = {section: base.get(section, {}) | options for section, options in change.items()}
    assert parse_config(base | changed).digest() == parse_config(base).digest()


@pytest.mark.parametrize(
    "change",
    [
        {"analog": {"seed": 9}},
        {"terrains": [1]},
        {"positions": ["A"]},
        {"grid": {"exposures_ms": [64]}},
        {"rocks": {"rock_cell_mm": 2.5}},
        {"labels": {"min_contrast_dn": 20}},
        {"labels": {"seeds": "none"}},
        {"labels": {"corrections": "corrections"}},
        {"detect": {"views": "views"}},
        {"labels": {"excluded_annotations": ["03_A_off_180_L_0256"]}},
        {"render": {"models": ["hapke"]}},
        {"detect": {"seeds": [1]}},
        {"rover": {"run": True, "world": {"terrains": [3, 1, 11]}}},
    ],
    ids=lambda change: next(iter(change)),
)
def test_an_option_that_changes_results_changes_the_digest(change):
    assert parse_config(CONTENTS["config"] | change).digest() != parse_config(CONTENTS["config"]).digest()
